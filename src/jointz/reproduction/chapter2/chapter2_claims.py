"""The statistics of 2.2.4 and the claims of 2.4, printed beside ours: every share as k of n."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import fmean

import pandas as pd

from jointz.core.events import PulseEstimate
from jointz.reference import Printed, chapter2
from jointz.reproduction.chapter2.chapter2_loads import CASES, Pair, error_pct
from jointz.reproduction.reproduction_tables import Compared, ComparedTable
from jointz.results.statistics.pulse_effect_tests import PulseEffects
from jointz.stats.pulse_effects import pulse_effects

#: Rises at all four onsets: type and direction are one factor there (2.2.3).
_CONFOUNDED = "E"
_TESTED = ("stiffness", "inertia")


@dataclass(frozen=True, slots=True)
class Share:
    """How many of how many."""

    count: int  # the numbers
    of: int

    @property
    def pct(self) -> float | None:
        """In percent; None of none."""
        return 100.0 * self.count / self.of if self.of else None


def claim_tables(
    pairs: Sequence[Pair], single: Sequence[PulseEstimate], ours: Sequence[PulseEstimate]
) -> tuple[ComparedTable, tuple[str, ...]]:
    """Return counts of ANOVAs and the claims of 2.4, and what is confounded."""
    letter, recommended = _effects(single), _effects(ours)
    rows = [
        *_anova_rows(letter, recommended),
        *_larger_rows(letter, recommended),
        *_below_rows(pairs),
        *_order_rows(pairs),
        *_damping_rows(pairs),
    ]
    table = ComparedTable(
        "claims",
        "Statistics and claims (2.3.3, 2.4.1, 2.4.2, 2.4.4)",
        "Every share is k of the n in its note. ANOVAs, each of stiffness and of inertia in every "
        "case and trajectory: the dissertation's are one-way, every pulse taken as independent; "
        "recommended: type by direction with the trial as a random factor, on pulses estimated by "
        "likelihood over 250 ms. Along reference E type and direction are one factor and the "
        "recommended analysis tests neither, so that the two are compared without E. Holm's "
        "correction runs over all tests of a column; the dissertation adjusted none.",
        tuple(rows),
    )
    return table, _confounded_note(recommended)


def _effects(pulses: Sequence[PulseEstimate]) -> PulseEffects:
    rows = [p for p in pulses if p.participant in CASES and p.direction]
    names = {"participant": "case", "timing_point": "trajectory"}
    table = pd.DataFrame([asdict(p) for p in rows]).rename(columns=names)
    return pulse_effects(table.assign(case=table["case"].map(CASES)))


def _confounded_note(effects: PulseEffects) -> tuple[str, ...]:
    found = [f"case {t.case}{t.trajectory}" for t in effects.tests if t.effect == "joint"]
    if not found:
        return ()
    return (
        f"Type and direction are confounded in {', '.join(dict.fromkeys(found))}: only their "
        "joint effect is tested there.",
    )


def _compared(
    quantity: str,
    printed: Printed | None,
    dissertation: Share | None,
    recommended: Share | None = None,
    *,
    note: str = "",
) -> Compared:
    """Return a row of shares whose note says how many of how many they are."""
    ours = (("dissertation's method", dissertation), ("recommended", recommended))
    told = [f"printed: {printed.note}"] if printed and printed.note else []
    told += [f"{name} {s.count} of {s.of}" for name, s in ours if s is not None and s.of]
    return Compared(
        quantity=quantity,
        unit="%",
        printed=printed.value if printed else None,
        dissertation=dissertation.pct if dissertation else None,
        recommended=recommended.pct if recommended else None,
        note="; ".join([*told, *([note] if note else [])]),
    )


# --- ANOVAs --------------------------------------------------------------------------------------


def _anova_rows(letter: PulseEffects, ours: PulseEffects) -> list[Compared]:
    rows = []
    for effect, number in chapter2.SIGNIFICANT_SHARES.items():
        name = "type and direction" if effect == "all" else effect
        rows += [
            _compared(
                f"ANOVAs with p < 0.05, {name}", number, _significant(letter, "one_way", effect)
            ),
            _compared(
                f"ANOVAs with p < 0.05, {name}, without E",
                _printed_without_e(effect),
                _significant(letter, "one_way", effect, without_e=True),
                _significant(ours, "mixed", effect, without_e=True),
            ),
            _compared(
                f"ANOVAs with p < 0.05 after Holm, {name}, without E",
                None,
                _significant(letter, "one_way", effect, without_e=True, holm=True),
                _significant(ours, "mixed", effect, without_e=True, holm=True),
            ),
        ]
    return rows


def _significant(
    effects: PulseEffects,
    analysis: str,
    effect: str,
    *,
    without_e: bool = False,
    holm: bool = False,
) -> Share:
    wanted = ("type", "direction") if effect == "all" else (effect,)
    p = [
        value
        for t in effects.tests
        if t.analysis == analysis
        and t.effect in wanted
        and not (without_e and t.trajectory == _CONFOUNDED)
        and (value := t.p_holm if holm else t.p) is not None
    ]
    return Share(sum(value < effects.alpha for value in p), len(p))


def _printed_without_e(effect: str) -> Printed:
    """Return the printed share without trajectory E: 2.3.3 lists what is not significant."""
    wanted = ("type", "direction") if effect == "all" else (effect,)
    of = len(wanted) * len(_TESTED) * len(chapter2.CASES) * (len(chapter2.TRAJECTORIES) - 1)
    not_significant = sum(
        not pair.endswith(_CONFOUNDED)
        for (_, name), listed in chapter2.ANOVA_NOT_SIGNIFICANT.items()
        if name in wanted
        for pair in listed
    )
    share = Share(of - not_significant, of)
    pct = round(100.0 * share.count / of, 1)
    return Printed(pct, None, "%", "2.3.3", f"{share.count} of {of}, out of those 2.3.3 lists")


# --- means ---------------------------------------------------------------------------------------


def _larger_rows(letter: PulseEffects, ours: PulseEffects) -> list[Compared]:
    claims = (
        ("positive_larger", "type", "positive pulses give the larger", chapter2.POSITIVE_LARGER),
        ("with_larger", "direction", "pulses with the trajectory the larger", chapter2.WITH_LARGER),
    )
    return [
        _compared(
            f"{text} {parameter}",
            number,
            _share(letter, claim, parameter, effect),
            _share(ours, claim, parameter, effect),
        )
        for claim, effect, text, printed in claims
        for parameter, number in printed.items()
    ]


def _share(effects: PulseEffects, claim: str, response: str, effect: str) -> Share:
    found = effects.count(claim, "means", response, effect)
    return Share(found.count, found.of)


def _below_rows(pairs: Sequence[Pair]) -> list[Compared]:
    rows = []
    ways = (
        ("pairs", chapter2.UNDERESTIMATED_BY_PAIR, _below),
        ("trajectories", chapter2.UNDERESTIMATED_BY_TRAJECTORY, _below_by_trajectory),
    )
    for what, printed, count in ways:
        for parameter, number in printed.items():
            mine = [p for p in pairs if p.parameter == parameter]
            rows.append(
                _compared(
                    f"{parameter} below the truth, {what}",
                    number,
                    count(mine, lambda p: p.dissertation),
                    count(mine, lambda p: p.recommended),
                )
            )
    return rows


def _below(pairs: Sequence[Pair], value: Callable[[Pair], float | None]) -> Share:
    found = [(v, p.truth) for p in pairs if (v := value(p)) is not None]
    return Share(sum(v < truth for v, truth in found), len(found))


def _below_by_trajectory(pairs: Sequence[Pair], value: Callable[[Pair], float | None]) -> Share:
    errors: dict[str, list[float]] = {}
    for p in pairs:
        if (v := value(p)) is not None:
            errors.setdefault(p.trajectory, []).append(v / p.truth - 1.0)
    return Share(sum(fmean(e) < 0.0 for e in errors.values()), len(errors))


def _order_rows(pairs: Sequence[Pair]) -> list[Compared]:
    """Return how often the larger of two springs or inertias is estimated better (2.4.1)."""
    rows = []
    for parameter, (small, large) in (("stiffness", ("k1", "k2")), ("inertia", ("I1", "I2"))):
        found = []
        for name in ("dissertation", "recommended"):
            sizes = [
                [_size(pairs, parameter, load, t, name) for load in (small, large)]
                for t in chapter2.TRAJECTORIES
            ]
            known = [(a, b) for a, b in sizes if a is not None and b is not None]
            found.append(Share(sum(b < a for a, b in known), len(known)))
        exception = chapter2.HIGHER_IS_BETTER_EXCEPT[parameter]
        printed = Printed(80.0, None, "%", "2.4.1", f"4 of 5, all but {exception}")
        rows.append(
            _compared(f"{parameter} better at the higher value, trajectories", printed, *found)
        )
    return rows


def _size(
    pairs: Sequence[Pair], parameter: str, load: str, trajectory: str, method: str
) -> float | None:
    errors = [
        error_pct(value, p.truth)
        for p in pairs
        if p.parameter == parameter
        and p.trajectory == trajectory
        and load in chapter2.CASE_LOADS[p.case]
        and (value := getattr(p, method)) is not None
    ]
    return abs(fmean(errors)) if errors else None


def _damping_rows(pairs: Sequence[Pair]) -> list[Compared]:
    mine = [p for p in pairs if p.parameter == "damping"]
    least = chapter2.DAMPING_SD_OVER_MEAN.value
    noisy = [p.dissertation_sd >= least * abs(p.dissertation) for p in mine]
    row = _compared(
        "damping with an SD of at least 1.4 means, pairs",
        replace(chapter2.DAMPING_NOISY_SHARE, note="no count"),
        Share(sum(noisy), len(noisy)),
        note="no damper is there; a lag of the torque record makes the damping negative, not "
        "noisy, so this share tells mechanisms apart",
    )
    return [row]
