"""Statistics of 4.3 on the simulated study, and all of its tables and curves."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4
from jointz.reproduction.chapter4.gait_claims import (
    MARGIN_RAD,
    device_effect,
    effect_figure,
    stride_figure,
)
from jointz.reproduction.chapter4.grids import accuracy_table, means_table, participant_grids
from jointz.reproduction.chapter4.literature_claims import impedance_figure, literature_figure
from jointz.reproduction.chapter4.walking import PARAMETERS, WalkedStudy
from jointz.reproduction.reproduction_tables import Claim, ClaimTable, Table, Verdict
from jointz.results.statistics.mixed_model_fit import MixedModelFit, RandomEffectTest
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.stats.mixed_model import mixed_model

_NAMES = {"stiffness_per_mass": "stiffness", "damping_per_mass": "damping", "inertia": "inertia"}
_METHODS = {
    "dissertation": "by the dissertation's method",
    "recommended": "by the recommended method",
}
_SIGNIFICANT = 0.001
#: What the band of the difference makes of 'no effect'.
_DEVICE_VERDICT: Mapping[str, Verdict] = {
    "equivalent": "reproduced",
    "different": "not reproduced",
    "undecided": "not shown",
}
#: The person whom figure 4.2 shows is the ninth.
_SHOWN_PERSON = 8
_DEGREES = 57.29577951308232
#: What is so in the simulation.
_DRAWN = "a person's true values at two timing points have nothing in common"
_TRUTH = {
    ("stiffness_per_mass", "timing_point"): "timing points truly differ",
    ("damping_per_mass", "timing_point"): "timing points truly differ",
    ("inertia", "timing_point"): "truly they do not: a simulated person has one inertia",
    ("stiffness_per_mass", "participant"): _DRAWN,
    ("damping_per_mass", "participant"): _DRAWN,
    ("inertia", "participant"): "people truly differ",
}


def simulated_chapter(found: WalkedStudy) -> tuple[tuple[Table, ...], dict[str, Any]]:
    """Return the tables of a simulated study, and what figures 4.2 to 4.4 and A.1 draw."""
    tests = device_effect(found.gait)
    shown = found.people[min(_SHOWN_PERSON, len(found.people) - 1)]
    tables: tuple[Table, ...] = (
        *participant_grids(found),
        means_table(found),
        accuracy_table(found),
        simulated_statistics(found, tests),
    )
    curves = {
        "strides": stride_figure(found.gait, shown),
        "device_effect": effect_figure(found.gait, tests),
        "impedance": impedance_figure(found),
        "literature": literature_figure(found),
    }
    return tables, curves


def simulated_statistics(
    found: WalkedStudy, tests: tuple[WaveformTest, WaveformTest] | None
) -> ClaimTable:
    """Return the statistics of 4.3 on the simulated people, people being what is counted."""
    rows = [*_device_claims(tests)]
    for name in PARAMETERS:
        for source in _METHODS:
            rows += _factor_claims(found, source, name)
    rows.append(
        Claim(
            "4.3.2.3",
            "quasi-stiffness of the simulated walk beside its stiffness",
            f"p = {chapter4.QUASI_STIFFNESS_P.value:g}",
            "",
            "not tested",
            "The simulation moves a leg along measured-like angles and answers pulses with K, B "
            "and J; it has no moment of walking, so there is nothing to take a slope of.",
        )
    )
    return ClaimTable(
        "simulated_statistics",
        "Statistics of 4.3 on simulated people",
        "The tests of 4.2.4 on one value a person and timing point. A verdict says whether the "
        "simulated study would have led to the printed statement; it says nothing of the real "
        "people, of whom the statistics of the published tables tell.",
        tuple(rows),
    )


# --- timing point and subject --------------------------------------------------------------------


def _factor_claims(found: WalkedStudy, source: str, name: str) -> list[Claim]:
    if (source, name) == ("recommended", "inertia"):
        return [
            Claim(
                "4.3.2.2",
                f"inertia, timing point, {_METHODS[source]}",
                f"p < {_SIGNIFICANT:g}",
                "",
                "not tested",
                "This method takes one inertia a person for likely and shares it between timing "
                "points: rows of a person are one finding, not six.",
            )
        ]
    try:
        fit = _model(found, source, name)
    except (DataError, EstimationError) as exc:
        where = f"{_NAMES[name]}, {_METHODS[source]}"
        return [Claim("4.3.2.2", where, f"p < {_SIGNIFICANT:g}", "", "not tested", str(exc))]
    # The true inertia is alike at all timing points of a person: nothing to test.
    true = None if name == "inertia" else _model(found, "truth", name)
    missing = _missing(fit, found)
    return [
        Claim(
            "4.3.2.2",
            f"{_NAMES[name]}, {factor}, {_METHODS[source]}",
            f"p < {_SIGNIFICANT:g}",
            ours,
            "reproduced" if p < _SIGNIFICANT else "not reproduced",
            f"{remark[0].upper()}{remark[1:]}{missing}.",
        )
        for factor, (ours, p, remark) in (
            ("timing point", _points(fit, true, name)),
            ("subject", _persons(fit, true, name)),
        )
    ]


def _model(found: WalkedStudy, source: str, name: str) -> MixedModelFit:
    """Fit people and timing points; a cell without a value is missing, the person's others used."""
    table = found.of(source, name).dropna(subset=["value"])
    levels = [point for point in TIMING_POINTS if (table["timing_point"] == point).any()]
    order = pd.Categorical(table["timing_point"], categories=levels, ordered=True)
    return mixed_model(
        table.assign(timing_point=order),
        response="value",
        within="timing_point",
        participant="participant",
    )


def _missing(fit: MixedModelFit, found: WalkedStudy) -> str:
    """Say how many cells, people and timing points are without a value; nothing where none is."""
    counts = (
        (len(fit.missing), "cell", "cells"),
        (len(found.people) - fit.n_participants, "person", "people"),
        (len(TIMING_POINTS) - len(fit.levels), "timing point", "timing points"),
    )
    without = [f"{n} {one if n == 1 else many} without a value" for n, one, many in counts if n]
    return f"; {', '.join(without)}; all others used" if without else ""


def _points(fit: MixedModelFit, true: MixedModelFit | None, name: str) -> tuple[str, float, str]:
    """Return test, p and remark of the timing points."""
    test, repeated = fit.f_test, fit.repeated_measures
    remark = _TRUTH[name, "timing_point"]
    if true is not None:
        remark += f" (of the true values {_p(true.f_test.p)})"
    if repeated is not None:
        remark += f"; Greenhouse-Geisser {_p(repeated.p_epsilon)}"
    ours = f"F({test.df_num:.0f}, {test.df_den:.1f}) = {test.F:.2f}, {_p(test.p)}"
    return ours, test.p, remark


def _persons(fit: MixedModelFit, true: MixedModelFit | None, name: str) -> tuple[str, float, str]:
    """Return test, p and remark of the people: the exact F test where there is one."""
    test = _of_people(fit)
    p = test.p_mixture if test.p is None else test.p
    ours = f"likelihood ratio {test.likelihood_ratio:.2f}, {_p(test.p_mixture)}"
    if test.F is not None:
        ours = f"F({test.df_num:.0f}, {test.df_den:.0f}) = {test.F:.2f}, {_p(p)}; {ours}"
    remark = _TRUTH[name, "participant"]
    if true is not None:
        of_truth = _of_people(true)
        true_p = of_truth.p_mixture if of_truth.p is None else of_truth.p
        remark += f" (of the true values {_p(true_p)})"
        if p < _SIGNIFICANT <= true_p:
            remark += "; found all the same: a person's timing points share errors, such as a lag"
    return ours, p, f"{remark}; ICC {fit.icc.value:.2f}"


def _of_people(fit: MixedModelFit) -> RandomEffectTest:
    return next(one for one in fit.random_effects if one.effect == "participant")


def _p(p: float) -> str:
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


# --- the device and gait -------------------------------------------------------------------------


def _device_claims(tests: tuple[WaveformTest, WaveformTest] | None) -> list[Claim]:
    printed = f"t within \N{PLUS-MINUS SIGN}{chapter4.SPM_THRESHOLD.value:g}: not different"
    claim = "angle over the gait cycle, without and with the device"
    if tests is None:
        reason = "Fewer than three people walked in both conditions."
        return [Claim("4.3.1", claim, printed, "", "not tested", reason)]
    field, flips = tests
    margin = MARGIN_RAD * _DEGREES
    left_open = field.largest_open_difference * _DEGREES
    inside = sum(field.equivalent or ())
    return [
        Claim(
            "4.3.1",
            f"{claim}: SPM, paired t",
            printed,
            f"{_found(field)}; width {field.fwhm_nodes:.1f} nodes",
            "not reproduced" if field.clusters else "reproduced",
            "In the simulation the device changes nothing on average, but every person's "
            "goniometer sits a little differently in every condition.",
        ),
        Claim(
            "4.3.1",
            f"{claim}: max-t by flipping signs",
            printed,
            f"{_found(flips)}; {flips.threshold_from}",
            "not reproduced" if flips.clusters else "reproduced",
            "Needs no smoothness and no normal distribution.",
        ),
        Claim(
            "4.4",
            "the device has no effect on gait",
            "accepting the null hypothesis",
            f"differences up to {left_open:.1f}\N{DEGREE SIGN} remain open; within "
            f"\N{PLUS-MINUS SIGN}{margin:.0f}\N{DEGREE SIGN} at {inside} of {len(field.t)} nodes",
            _DEVICE_VERDICT[field.verdict],
            "That nothing was found does not show that nothing is there. Equivalent would be a "
            f"95 % band inside \N{PLUS-MINUS SIGN}{margin:.0f}\N{DEGREE SIGN} at every node.",
        ),
    ]


def _found(test: WaveformTest) -> str:
    largest = max(abs(t) for t in test.t)
    text = f"largest |t| {largest:.2f}, threshold {test.threshold:.2f}, {_p(test.p_value)}"
    if not test.clusters:
        return f"{text}, no cluster"
    spans = ", ".join(f"{c.start_node:.0f} to {c.end_node:.0f} %" for c in test.clusters)
    return f"{text}, different at {spans}"
