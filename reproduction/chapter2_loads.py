"""Tables 2.1 and 2.2, figure 2.6, and the statistics and claims of chapter II beside ours."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple

import pandas as pd

from jointz.analysis.analyze import analyze
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.events import PulseEstimate
from jointz.core.study import Study
from jointz.io.study_reader import open_study
from jointz.reference import Printed
from jointz.results.statistics.pulse_effect_tests import PulseEffects
from jointz.stats.pulse_effects import pulse_effects
from reproduction import printed_numbers
from reproduction.reproduction_tables import Compared, ComparedTable, compare, compared_table

PARAMETERS = ("stiffness", "damping", "inertia")
#: Load of the protocol -> case of the dissertation.
CASES = {f"case-{case}": case for case in printed_numbers.CASES}
#: Rises at all four onsets: type and direction are one factor there (2.2.3).
_CONFOUNDED = "E"
_TESTED = ("stiffness", "inertia")
_METHODS = ("dissertation", "recommended")


class Pair(NamedTuple):
    """A case and trajectory: truth and estimates of one parameter."""

    case: str
    trajectory: str
    parameter: str
    truth: float  # SI, as the following values
    dissertation: float  # mean by the method of the dissertation
    dissertation_sd: float  # sd over the pulses
    recommended: float | None  # value by the recommended method
    ci_low: float | None
    ci_high: float | None


class LoadStudy(NamedTuple):
    """Estimates of one load by both methods, and the gain of its torque record."""

    pairs: list[Pair]
    vaf_pct: dict[str, float]  # trajectory -> VAF by the method of the dissertation, %
    single: list[PulseEstimate]  # pulse estimates by the method of the dissertation
    recommended_single: list[PulseEstimate]  # pulse estimates by the recommended method
    torque_gain: float  # recorded over true torque


def analyze_load(study: Path, load: str, truth: Mapping[str, Any], seed: int) -> LoadStudy:
    """Estimate one load of ``sea-mass-spring`` by both methods."""
    opened = _study_of_load(open_study(study), load)
    analysis = analyze(opened, method="recommended", resamples=2, seed=seed)
    published = analyze(opened, method="dissertation", resamples=2, seed=seed)
    single = [_without_intrinsic(p, opened) for p in published.single]
    pairs = []
    for cell in analysis.cells:
        point = cell.timing_point
        for name in PARAMETERS:
            ours = cell.parameter(name)
            values = [getattr(p, name) for p in single if p.timing_point == point]
            pairs.append(
                Pair(
                    CASES.get(load, load),
                    point,
                    name,
                    truth["load"][name],
                    fmean(values),
                    stdev(values),
                    *((ours.value, ours.ci_low, ours.ci_high) if ours else (None, None, None)),
                )
            )
    vaf = {c.timing_point: float(c.vaf_pct) for c in published.cells if c.vaf_pct is not None}
    ours_single = [_without_intrinsic(p, opened) for p in analysis.single]
    return LoadStudy(pairs, vaf, single, ours_single, truth["torque_gain"])


def _study_of_load(study: Study, load: str) -> Study:
    spec = study.spec
    kept = spec.model_copy(
        update={
            "participants": tuple(p for p in spec.participants if p.id == load),
            "recordings": tuple(r for r in spec.recordings if r.participant == load),
        }
    )
    return Study(study.root, kept, study.sha256, study.units, study.group_edges)


def _without_intrinsic(pulse: PulseEstimate, study: Study) -> PulseEstimate:
    """Return a pulse's estimate of the load alone."""
    known = study.spec.participant(pulse.participant).calibration
    values = asdict(pulse)
    for name in PARAMETERS:
        entry = getattr(known, f"intrinsic_{name}", None)
        values[name] -= entry.value if entry else 0.0
    return PulseEstimate(**values)


# --- tables --------------------------------------------------------------------------------------


def error_tables(pairs: Sequence[Pair], torque_gain: float) -> tuple[ComparedTable, ...]:
    """Return tables 2.1 and 2.2 and the averages of 2.3.2."""
    values = {"gain_pct": 100.0 * (torque_gain - 1.0), "loads": _load_names()}
    printed = {
        "stiffness": printed_numbers.STIFFNESS_ERRORS,
        "inertia": printed_numbers.INERTIA_ERRORS,
    }
    tables = []
    for parameter, table in printed.items():
        rows = [
            _error_row(f"{load}, trajectory {trajectory}", pairs, parameter, load, trajectory, cell)
            for load, cells in table.items()
            for trajectory, cell in cells.items()
        ]
        tables.append(compared_table(2, f"{parameter}_errors", rows, **values))
    averages = []
    for load, number in printed_numbers.AVERAGE_ERRORS.items():
        parameter = "stiffness" if load in printed_numbers.SPRINGS else "inertia"
        averages.append(
            _error_row(f"{load}, all trajectories", pairs, parameter, load, None, number)
        )
    return (*tables, compared_table(2, "average_errors", averages, **values))


def _load_names() -> str:
    """Return the sizes of springs and inertias, and which of them a case has."""
    springs = " and ".join(f"{n} = {v.value:g} N*m/rad" for n, v in printed_numbers.SPRINGS.items())
    inertias = " and ".join(
        f"{n} = {v.value:g} kg*m^2" for n, v in printed_numbers.INERTIAS.items()
    )
    cases = ", ".join(
        f"case {case}: {' and '.join(loads)}" for case, loads in printed_numbers.CASE_LOADS.items()
    )
    return f"Springs {springs}, inertias {inertias}; {cases}."


def _error_row(
    quantity: str,
    pairs: Sequence[Pair],
    parameter: str,
    load: str,
    trajectory: str | None,
    printed: Printed,
) -> Compared:
    own = pairs_of(pairs, parameter, load, trajectory)
    published = [error_pct(p.dissertation, p.truth) for p in own]
    ours = [error_pct(p.recommended, p.truth) for p in own if p.recommended is not None]
    spread = (fmean(published), stdev(published))
    return compare(quantity, "%", printed, spread, fmean(ours) if ours else None)


def pairs_of(
    pairs: Sequence[Pair], parameter: str, load: str, trajectory: str | None = None
) -> list[Pair]:
    """Return the pairs of a parameter whose case has a spring or inertia."""
    return [
        p
        for p in pairs
        if p.parameter == parameter
        and load in printed_numbers.CASE_LOADS.get(p.case, ())
        and trajectory in (None, p.trajectory)
    ]


def error_pct(value: float, truth: float) -> float:
    """Return an error in percent of the truth."""
    return 100.0 * (value / truth - 1.0)


def pair_table(pairs: Sequence[Pair]) -> ComparedTable:
    """Return every case-trajectory pair with its truth (figure 2.6)."""
    rows = []
    for p in pairs:
        case = f"case {p.case}" if p.case in printed_numbers.CASES else f"{p.case} "
        rows.append(
            compare(
                f"{case}{p.trajectory}: {p.parameter}",
                PARAMETER_UNITS[p.parameter],
                dissertation=(p.dissertation, p.dissertation_sd),
                recommended=(p.recommended, p.ci_low, p.ci_high),
                truth=p.truth,
            )
        )
    return compared_table(2, "pairs", rows, loads=_load_names())


def vaf_table(studies: Mapping[str, LoadStudy]) -> ComparedTable:
    """Return the VAF of all pairs of the four cases."""
    values = {
        f"{CASES[load]}{trajectory}": vaf
        for load, study in studies.items()
        if load in CASES
        for trajectory, vaf in study.vaf_pct.items()
    }
    above = float(sum(v > printed_numbers.VAF_LOWER_LIMIT.value for v in values.values()))
    lowest = min(values, key=values.__getitem__)
    note = f"printed: case 4B; here: case {lowest}"
    rows = (
        compare("pairs with VAF above 99.9 %", "", Printed(19.0), above, note="of 20"),
        compare("lowest VAF", "%", printed_numbers.VAF_4B, values[lowest], note=note),
    )
    return compared_table(2, "vaf", rows)


# --- statistics and claims (2.2.4, 2.4) ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Share:
    """How many of how many."""

    count: int
    of: int  # total

    @property
    def pct(self) -> float | None:
        """In percent; None of none."""
        return 100.0 * self.count / self.of if self.of else None


def share(held: Iterable[bool]) -> Share:
    """Return how many of some comparisons hold."""
    results = list(held)
    return Share(sum(results), len(results))


def claim_tables(
    pairs: Sequence[Pair], single: Sequence[PulseEstimate], ours: Sequence[PulseEstimate]
) -> tuple[ComparedTable, tuple[str, ...]]:
    """Return counts of ANOVAs and the claims of 2.4, and notes on what is confounded."""
    published, recommended = _effects(single), _effects(ours)
    rows = [
        *_anova_rows(published, recommended),
        *_larger_rows(published, recommended),
        *_below_rows(pairs),
        *_order_rows(pairs),
        _damping_row(pairs),
    ]
    confounded = [f"case {t.case}{t.trajectory}" for t in recommended.tests if t.effect == "joint"]
    notes = (
        f"Type and direction are confounded in {', '.join(dict.fromkeys(confounded))}: only their "
        "joint effect is tested there.",
    )
    return compared_table(2, "claims", rows), notes if confounded else ()


def _effects(pulses: Sequence[PulseEstimate]) -> PulseEffects:
    rows = [p for p in pulses if p.participant in CASES and p.direction]
    names = {"participant": "case", "timing_point": "trajectory"}
    table = pd.DataFrame([asdict(p) for p in rows]).rename(columns=names)
    return pulse_effects(table.assign(case=table["case"].map(CASES)))


def _compared(quantity: str, printed: Printed | None, *shares: Share, note: str = "") -> Compared:
    """Return a row of shares whose note says how many of how many they are."""
    notes = [f"printed: {printed.note}"] if printed and printed.note else []
    names = ("dissertation's method", "recommended")
    notes += [f"{n} {s.count} of {s.of}" for n, s in zip(names, shares, strict=False) if s.of]
    notes += [note] if note else []
    return compare(quantity, "%", printed, *(s.pct for s in shares), note="; ".join(notes))


# --- ANOVAs --------------------------------------------------------------------------------------


def _anova_rows(published: PulseEffects, ours: PulseEffects) -> list[Compared]:
    rows = []
    for effect, number in printed_numbers.SIGNIFICANT_SHARES.items():
        factors = ("type", "direction") if effect == "all" else (effect,)
        name = " and ".join(factors)
        both = ((published, "one_way"), (ours, "mixed"))
        rows += [
            _compared(
                f"ANOVAs with p < 0.05, {name}", number, _significant(published, "one_way", factors)
            ),
            _compared(
                f"ANOVAs with p < 0.05, {name}, without E",
                _printed_without_e(factors),
                *(_significant(*test, factors, without=_CONFOUNDED) for test in both),
            ),
            _compared(
                f"ANOVAs with p < 0.05 after Holm, {name}, without E",
                None,
                *(_significant(*test, factors, without=_CONFOUNDED, holm=True) for test in both),
            ),
        ]
    return rows


def _significant(
    effects: PulseEffects,
    analysis: str,
    factors: Sequence[str],
    *,
    without: str = "",
    holm: bool = False,
) -> Share:
    p_values = [
        t.p_holm if holm else t.p
        for t in effects.tests
        if t.analysis == analysis and t.effect in factors and t.trajectory != without
    ]
    return share(p < effects.alpha for p in p_values if p is not None)


def _printed_without_e(factors: Sequence[str]) -> Printed:
    """Return the printed share without trajectory E: 2.3.3 lists what is not significant."""
    of = (
        len(factors)
        * len(_TESTED)
        * len(printed_numbers.CASES)
        * (len(printed_numbers.TRAJECTORIES) - 1)
    )
    listed = [
        pair
        for (_, name), pairs in printed_numbers.ANOVA_NOT_SIGNIFICANT.items()
        if name in factors
        for pair in pairs
        if not pair.endswith(_CONFOUNDED)
    ]
    count = of - len(listed)
    note = f"{count} of {of}, out of those 2.3.3 lists"
    return Printed(round(100.0 * count / of, 1), None, "%", "2.3.3", note)


# --- means ---------------------------------------------------------------------------------------


def _larger_rows(published: PulseEffects, ours: PulseEffects) -> list[Compared]:
    claims = (
        (
            "positive_larger",
            "type",
            "positive pulses give the larger",
            printed_numbers.POSITIVE_LARGER,
        ),
        (
            "with_larger",
            "direction",
            "pulses with the trajectory the larger",
            printed_numbers.WITH_LARGER,
        ),
    )
    rows = []
    for claim, effect, text, printed in claims:
        for parameter, number in printed.items():
            counts = [e.count(claim, "means", parameter, effect) for e in (published, ours)]
            shares = (Share(c.count, c.of) for c in counts)
            rows.append(_compared(f"{text} {parameter}", number, *shares))
    return rows


def _below_rows(pairs: Sequence[Pair]) -> list[Compared]:
    """Return how often estimates lie below the truth (2.4.4)."""
    tables = (
        ("pairs", printed_numbers.UNDERESTIMATED_BY_PAIR),
        ("trajectories", printed_numbers.UNDERESTIMATED_BY_TRAJECTORY),
    )
    rows = []
    for unit, printed in tables:
        for parameter, number in printed.items():
            shares = []
            for method in _METHODS:
                errors: dict[tuple[str, ...], list[float]] = {}
                for p in pairs:
                    value = getattr(p, method)
                    if p.parameter == parameter and value is not None:
                        key = (p.trajectory, p.case if unit == "pairs" else "")
                        errors.setdefault(key, []).append(value / p.truth - 1.0)
                shares.append(share(fmean(e) < 0.0 for e in errors.values()))
            rows.append(_compared(f"{parameter} below the truth, {unit}", number, *shares))
    return rows


def _order_rows(pairs: Sequence[Pair]) -> list[Compared]:
    """Return how often the larger of two springs or inertias is estimated better (2.4.1)."""
    rows = []
    for parameter, loads in (("stiffness", ("k1", "k2")), ("inertia", ("I1", "I2"))):
        shares = []
        for method in _METHODS:
            sizes = {
                (load, t): _mean_error(pairs_of(pairs, parameter, load, t), method)
                for load, t in product(loads, printed_numbers.TRAJECTORIES)
            }
            small, large = (
                [sizes[load, t] for t in printed_numbers.TRAJECTORIES] for load in loads
            )
            errors = zip(small, large, strict=True)
            shares.append(share(b < a for a, b in errors if a is not None and b is not None))
        exception = printed_numbers.HIGHER_IS_BETTER_EXCEPT[parameter]
        printed = Printed(80.0, None, "%", "2.4.1", f"4 of 5, all but {exception}")
        rows.append(
            _compared(f"{parameter} better at the higher value, trajectories", printed, *shares)
        )
    return rows


def _mean_error(pairs: Sequence[Pair], method: str) -> float | None:
    values = [(getattr(p, method), p.truth) for p in pairs]
    errors = [error_pct(value, truth) for value, truth in values if value is not None]
    return abs(fmean(errors)) if errors else None


def _damping_row(pairs: Sequence[Pair]) -> Compared:
    least = printed_numbers.DAMPING_SD_OVER_MEAN.value
    damping = [p for p in pairs if p.parameter == "damping"]
    return _compared(
        "damping with an SD of at least 1.4 means, pairs",
        replace(printed_numbers.DAMPING_NOISY_SHARE, note="no count"),
        share(p.dissertation_sd >= least * abs(p.dissertation) for p in damping),
        note="no damper is there; a lag of the torque record makes the damping negative, not "
        "noisy, so this share tells mechanisms apart",
    )
