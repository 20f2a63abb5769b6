"""Tables 2.1 and 2.2, figure 2.6 and the statistics of 2.2.4, printed beside ours."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from jointz.core.analysis import StudyAnalysis
from jointz.core.errors import EstimationError
from jointz.core.estimates import CellEstimate
from jointz.core.events import PulseEstimate
from jointz.core.pulse_effects import PulseEffects
from jointz.core.reproduction import Compared, ComparedTable
from jointz.core.study import Study
from jointz.identify.pulse_likelihood import fit_pulse
from jointz.io.recordings import read_recording
from jointz.io.study import open_study
from jointz.reference import Printed, chapter2
from jointz.stats.pulse_effects import pulse_effects
from jointz.workflows.analysis import analyze
from jointz.workflows.chapter2 import PARAMETERS, UNITS

_WINDOW_S = 0.25
#: Samples on either side of the window that the likelihood may use.
_MARGIN_S = 0.03
_TWO_SIDED_Z = 1.96
_CASES = {f"case-{case}": case for case in chapter2.CASES}


class Pair(NamedTuple):
    """A case and trajectory: truth and estimates of one parameter."""

    case: str
    trajectory: str
    parameter: str
    truth: float
    dissertation: float
    dissertation_sd: float
    recommended: float | None
    ci_low: float | None
    ci_high: float | None


class LoadStudy(NamedTuple):
    """What the analysis of one load gave, by both methods."""

    pairs: list[Pair]
    vaf_pct: dict[str, float]
    single: list[PulseEstimate]
    recommended_single: list[PulseEstimate]


def analyze_load(study: Path, load: str, truth: Mapping[str, Any], seed: int) -> LoadStudy:
    """Estimate one load of ``sea-mass-spring`` by both methods.

    Parameters
    ----------
    study : pathlib.Path
        Of the protocol.
    load : str
        Which participant.
    truth : mapping
        Of the load: ``stiffness``, ``damping``, ``inertia``.
    seed : int
        Of the resampling.
    """
    opened = _only(open_study(study), load)
    analysis = analyze(opened, method="recommended", resamples=2, seed=seed)
    case = _CASES.get(load, load)
    single = [_external(p, opened) for p in analysis.single]
    pairs = []
    for cell in analysis.cells:
        mine = [p for p in single if p.timing_point == cell.timing_point]
        for name in PARAMETERS:
            found = cell.parameter(name)
            values = [getattr(p, name) for p in mine]
            pairs.append(
                Pair(
                    case,
                    cell.timing_point,
                    name,
                    truth[name],
                    fmean(values),
                    stdev(values),
                    *((found.value, found.ci_low, found.ci_high) if found else (None, None, None)),
                )
            )
    vaf = {c.timing_point: float(c.vaf_pct) for c in analysis.comparison if c.vaf_pct is not None}
    return LoadStudy(pairs, vaf, single, _by_likelihood(opened, analysis, single))


def _only(study: Study, load: str) -> Study:
    """Return the study of one of its loads."""
    spec = study.spec
    kept = spec.model_copy(
        update={
            "participants": tuple(p for p in spec.participants if p.id == load),
            "recordings": tuple(r for r in spec.recordings if r.participant == load),
        }
    )
    return Study(study.root, kept, study.sha256, study.units, study.group_edges)


def _external(pulse: PulseEstimate, study: Study) -> PulseEstimate:
    """Return a pulse's estimate without the intrinsic impedance."""
    known = study.spec.participant(pulse.participant).calibration
    values = asdict(pulse)
    for name in PARAMETERS:
        entry = getattr(known, f"intrinsic_{name}", None)
        values[name] -= entry.value if entry else 0.0
    return PulseEstimate(**values)


def _by_likelihood(
    study: Study, analysis: StudyAnalysis, single: Sequence[PulseEstimate]
) -> list[PulseEstimate]:
    """Return every pulse again, by errors-in-variables likelihood over 250 ms."""
    trials = {}
    for entry in study.spec.recordings:
        if entry.condition == "perturbed":
            for recording in read_recording(study, entry):
                trials[entry.file, str(recording.attrs["trial"])] = {
                    name: recording[name].to_numpy() for name in ("time", "angle", "torque")
                }
    lags = {c.timing_point: _lag_of(c) for c in analysis.cells}
    found = []
    for pulse in single:
        trial = trials[pulse.recording, pulse.trial]
        first, last = np.searchsorted(
            trial["time"],
            [pulse.onset_s - _MARGIN_S, pulse.onset_s + _WINDOW_S + _MARGIN_S],
        )
        part = {name: values[first:last] for name, values in trial.items()}
        try:
            fit = fit_pulse(
                part["time"],
                part["angle"],
                part["torque"],
                onset_s=pulse.onset_s,
                window_s=_WINDOW_S,
                signal="raw",
                lag=lags[pulse.timing_point],
            )
        except EstimationError:
            continue
        values = {name: fit.parameter(name).value for name in PARAMETERS}
        if None not in values.values():
            found.append(
                _external(PulseEstimate(**asdict(pulse) | values | {"vaf_pct": fit.vaf_pct}), study)
            )
    return found


def _lag_of(cell: CellEstimate) -> tuple[float, float] | None:
    """Return the lag of a case's torque record and its sd, where it was found."""
    lag = next((p for p in cell.nuisance if p.name == "torque_lag"), None)
    if lag is None or lag.value is None or lag.ci_high is None:
        return None
    return lag.value, (lag.ci_high - lag.value) / _TWO_SIDED_Z


# --- tables --------------------------------------------------------------------------------------


def error_tables(pairs: Sequence[Pair]) -> tuple[ComparedTable, ...]:
    """Return tables 2.1 and 2.2 and the averages of 2.3.2.

    Parameters
    ----------
    pairs : sequence of Pair
        Of all loads.
    """
    printed: dict[str, Mapping[str, Mapping[str, Printed]]] = {
        "stiffness": chapter2.STIFFNESS_ERRORS,
        "inertia": chapter2.INERTIA_ERRORS,
    }
    numbers = {"stiffness": "2.1", "inertia": "2.2"}
    tables = []
    for parameter, rows in printed.items():
        compared = [
            _error_row(f"{load}, trajectory {trajectory}", pairs, parameter, load, trajectory, cell)
            for load, cells in rows.items()
            for trajectory, cell in cells.items()
        ]
        tables.append(
            ComparedTable(
                f"{parameter}_errors",
                f"Error of {parameter} by load and trajectory (table {numbers[parameter]})",
                "Percent of the truth: mean over the two cases of a load, after the plus-minus "
                "sign their standard deviation. The dissertation's method: every pulse by least "
                "squares over 100 ms of the response, perturbed minus unperturbed. Recommended: "
                "the full record. Both hold the error of the torque's calibration.",
                tuple(compared),
            )
        )
    averages = [
        _error_row(f"{load}, all trajectories", pairs, parameter, load, None, number)
        for load, number in chapter2.AVERAGE_ERRORS.items()
        for parameter in [_parameter_of(load)]
    ]
    tables.append(
        ComparedTable(
            "average_errors",
            "Average errors (2.3.2)",
            "Mean and standard deviation over the ten case-trajectory pairs of a load.",
            tuple(averages),
        )
    )
    return tuple(tables)


def _parameter_of(load: str) -> str:
    return "stiffness" if load in chapter2.SPRINGS else "inertia"


def _error_row(
    quantity: str,
    pairs: Sequence[Pair],
    parameter: str,
    load: str,
    trajectory: str | None,
    printed: Printed,
) -> Compared:
    mine = [
        p
        for p in pairs
        if p.parameter == parameter
        and load in chapter2.CASE_LOADS.get(p.case, ())
        and trajectory in (None, p.trajectory)
    ]
    letter = [_error_pct(p.dissertation, p.truth) for p in mine]
    ours = [_error_pct(p.recommended, p.truth) for p in mine if p.recommended is not None]
    return Compared(
        quantity=quantity,
        unit="%",
        printed=printed.value,
        printed_sd=printed.sd,
        dissertation=fmean(letter),
        dissertation_sd=stdev(letter),
        recommended=fmean(ours) if ours else None,
        note=printed.note,
    )


def _error_pct(value: float, truth: float) -> float:
    return 100.0 * (value / truth - 1.0)


def pair_table(pairs: Sequence[Pair]) -> ComparedTable:
    """Return every case-trajectory pair with its truth (figure 2.6).

    Parameters
    ----------
    pairs : sequence of Pair
        Of all loads.
    """
    return ComparedTable(
        "pairs",
        "Every load and trajectory (figure 2.6)",
        "The truth is that of the simulated bench: springs and inertias were drawn within their "
        "printed uncertainty. Case 'damper' has a known damper, which the dissertation had not "
        "(2.4.4). After the plus-minus sign the standard deviation over pulses.",
        tuple(
            Compared(
                quantity=f"{p.case}{p.trajectory} {p.parameter}",
                unit=UNITS[p.parameter],
                dissertation=p.dissertation,
                dissertation_sd=p.dissertation_sd,
                recommended=p.recommended,
                recommended_low=p.ci_low,
                recommended_high=p.ci_high,
                truth=p.truth,
            )
            for p in pairs
        ),
    )


def vaf_table(studies: Mapping[str, LoadStudy]) -> ComparedTable:
    """Return the VAF of all pairs of the four cases.

    Parameters
    ----------
    studies : mapping of str to LoadStudy
        Load -> its analysis.
    """
    values = {
        f"{_CASES[load]}{trajectory}": vaf
        for load, study in studies.items()
        if load in _CASES
        for trajectory, vaf in study.vaf_pct.items()
    }
    above = sum(v > chapter2.VAF_LOWER_LIMIT.value for v in values.values())
    lowest = min(values, key=values.__getitem__)
    return ComparedTable(
        "vaf",
        "Variance accounted for (2.3.3)",
        "On the average response of a pair. A VAF this high goes with inertias that are off by "
        "what the tables above show.",
        (
            Compared(
                "pairs with VAF above 99.9 %", printed=19.0, dissertation=float(above), note="of 20"
            ),
            Compared(
                "lowest VAF",
                "%",
                printed=chapter2.VAF_4B.value,
                dissertation=values[lowest],
                note=f"printed: 4B; here: {lowest}",
            ),
        ),
    )


# --- statistics of 2.2.4 and claims --------------------------------------------------------------


def claim_tables(
    pairs: Sequence[Pair], single: Sequence[PulseEstimate], ours: Sequence[PulseEstimate]
) -> tuple[ComparedTable, tuple[str, ...]]:
    """Return counts of ANOVAs and the claims of 2.4, and what is confounded.

    Parameters
    ----------
    pairs : sequence of Pair
        Of the four cases.
    single, ours : sequence of PulseEstimate
        Pulses by the dissertation's method, and by the likelihood over 250 ms.
    """
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
        "Shares of the 20 case-trajectory pairs of the four cases. ANOVAs: the dissertation's are "
        "one-way, every pulse taken as independent; recommended: sign by direction with the trial "
        "as a random factor, on pulses estimated by likelihood over 250 ms. None is adjusted here; "
        "statistics.json of the study holds Holm's p-values.",
        tuple(rows),
    )
    return table, tuple(recommended.notes[:4])


def _effects(pulses: Sequence[PulseEstimate]) -> PulseEffects:
    rows = [p for p in pulses if p.participant in _CASES and p.direction]
    names = {"participant": "case", "timing_point": "trajectory"}
    table = pd.DataFrame([asdict(p) for p in rows]).rename(columns=names)
    return pulse_effects(table.assign(case=table["case"].map(_CASES)))


def _anova_rows(letter: PulseEffects, ours: PulseEffects) -> list[Compared]:
    return [
        Compared(
            quantity=f"ANOVAs with p < 0.05, {name}",
            unit="%",
            printed=number.value,
            dissertation=_share(letter, "significant", "one_way", "all", name),
            recommended=_share(ours, "significant", "mixed", "all", name),
            note=number.note,
        )
        for name, number in chapter2.SIGNIFICANT_SHARES.items()
    ]


def _larger_rows(letter: PulseEffects, ours: PulseEffects) -> list[Compared]:
    claims = (
        ("positive_larger", "type", "positive pulses give the larger", chapter2.POSITIVE_LARGER),
        ("with_larger", "direction", "pulses with the trajectory the larger", chapter2.WITH_LARGER),
    )
    return [
        Compared(
            quantity=f"{text} {parameter}",
            unit="%",
            printed=number.value,
            dissertation=_share(letter, claim, "means", parameter, effect),
            recommended=_share(ours, claim, "means", parameter, effect),
            note=number.note,
        )
        for claim, effect, text, printed in claims
        for parameter, number in printed.items()
    ]


def _share(effects: PulseEffects, claim: str, analysis: str, response: str, effect: str) -> float:
    found = effects.count(claim, analysis, response, effect)
    return 100.0 * found.count / found.of if found.of else float("nan")


def _below_rows(pairs: Sequence[Pair]) -> list[Compared]:
    rows = []
    for parameter, number in chapter2.UNDERESTIMATED_BY_PAIR.items():
        mine = [p for p in pairs if p.parameter == parameter]
        rows.append(
            Compared(
                quantity=f"{parameter} below the truth, pairs",
                unit="%",
                printed=number.value,
                dissertation=_below(mine, lambda p: p.dissertation),
                recommended=_below(mine, lambda p: p.recommended),
                note=number.note,
            )
        )
    for parameter, number in chapter2.UNDERESTIMATED_BY_TRAJECTORY.items():
        mine = [p for p in pairs if p.parameter == parameter]
        rows.append(
            Compared(
                quantity=f"{parameter} below the truth, trajectories",
                unit="%",
                printed=number.value,
                dissertation=_below_by_trajectory(mine, lambda p: p.dissertation),
                recommended=_below_by_trajectory(mine, lambda p: p.recommended),
                note=number.note,
            )
        )
    return rows


def _below(pairs: Sequence[Pair], value: Callable[[Pair], float | None]) -> float:
    found = [(v, p.truth) for p in pairs if (v := value(p)) is not None]
    return 100.0 * sum(v < truth for v, truth in found) / len(found)


def _below_by_trajectory(pairs: Sequence[Pair], value: Callable[[Pair], float | None]) -> float:
    errors: dict[str, list[float]] = {}
    for p in pairs:
        if (v := value(p)) is not None:
            errors.setdefault(p.trajectory, []).append(v / p.truth - 1.0)
    return 100.0 * sum(fmean(e) < 0.0 for e in errors.values()) / len(errors)


def _order_rows(pairs: Sequence[Pair]) -> list[Compared]:
    """Return how often the larger of two springs or inertias is estimated better (2.4.1)."""
    rows = []
    for parameter, (small, large) in (("stiffness", ("k1", "k2")), ("inertia", ("I1", "I2"))):
        found = {}
        for name in ("dissertation", "recommended"):
            better = [
                _size(pairs, parameter, large, t, name) < _size(pairs, parameter, small, t, name)
                for t in chapter2.TRAJECTORIES
            ]
            found[name] = 100.0 * sum(better) / len(better)
        exception = chapter2.HIGHER_IS_BETTER_EXCEPT[parameter]
        rows.append(
            Compared(
                quantity=f"{parameter} better at the higher value, trajectories",
                unit="%",
                printed=80.0,
                note=f"printed: all but {exception}; no linear mechanism gives it",
                **found,
            )
        )
    return rows


def _size(pairs: Sequence[Pair], parameter: str, load: str, trajectory: str, method: str) -> float:
    errors = [
        _error_pct(value, p.truth)
        for p in pairs
        if p.parameter == parameter
        and p.trajectory == trajectory
        and load in chapter2.CASE_LOADS[p.case]
        and (value := getattr(p, method)) is not None
    ]
    return abs(fmean(errors))


def _damping_rows(pairs: Sequence[Pair]) -> list[Compared]:
    mine = [p for p in pairs if p.parameter == "damping"]
    least = chapter2.DAMPING_SD_OVER_MEAN.value
    noisy = [p.dissertation_sd >= least * abs(p.dissertation) for p in mine]
    return [
        Compared(
            quantity="damping with an SD of at least 1.4 means, pairs",
            unit="%",
            printed=chapter2.DAMPING_NOISY_SHARE.value,
            dissertation=100.0 * sum(noisy) / len(noisy),
            note="no damper is there; a lag of the torque record makes the damping negative, not "
            "noisy, so this share tells mechanisms apart",
        )
    ]


def other_devices() -> ComparedTable:
    """Return what the dissertation compares itself with (2.4.1)."""
    return ComparedTable(
        "other_devices",
        "Other devices (2.4.1)",
        "Errors of others as the dissertation prints them, with its own citation numbers.",
        tuple(
            Compared(
                quantity=f"{d.quantity} [{', '.join(map(str, d.citations))}]",
                unit=d.unit,
                printed=d.high,
                note=d.note,
            )
            for d in chapter2.OTHER_DEVICES
        ),
    )


def load_curves(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
    """Return what figure 2.6 draws.

    Parameters
    ----------
    pairs : sequence of Pair
        Of all loads.
    """
    return [p._asdict() for p in pairs]
