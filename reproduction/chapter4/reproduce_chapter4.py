"""Chapter IV: published tables tested, the walking experiment and its pilot simulated."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from statistics import fmean
from typing import Any

import pandas as pd

from jointz.analysis.analyze import analyze
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.errors import DataError, EstimationError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.protocol import Protocol
from jointz.results.statistics.mixed_model_fit import MixedModelFit, RandomEffectTest
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.stats.mixed_models import mixed_model
from jointz.tasks.progress import Progress, RunProgress
from reproduction import printed_numbers
from reproduction.chapter4.person_tables import (
    accuracy_table,
    impedance_figure,
    literature_figure,
    means_table,
    participant_grids,
)
from reproduction.chapter4.published_statistics import published_statistics
from reproduction.chapter4.walking import (
    COLUMNS,
    MARGIN_RAD,
    WalkedStudy,
    device_effect,
    effect_figure,
    estimated,
    rows_of,
    run_people,
    stride_figure,
    true_values,
    walking_study,
)
from reproduction.printed_numbers import PARAMETER_NAMES
from reproduction.printed_settings import PEOPLE, printed_settings
from reproduction.reproduction_result import Reproduction
from reproduction.reproduction_tables import (
    Claim,
    ClaimTable,
    Compared,
    ComparedTable,
    Table,
    Verdict,
    audit_claims,
    claim_table,
    compare,
    compared_table,
    stated_claims,
)

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
_SOURCES = ("pilot", "recommended", "truth")
#: The pilot's method makes no resamples; of the one beside it nothing is shown.
_FEWEST_RESAMPLES = 2


def reproduce_chapter4(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Test the published tables, run the walking experiment on simulated people, set it beside."""
    tell(0, 1, "published tables")
    published, curves = published_statistics()
    with tempfile.TemporaryDirectory() as folder:
        pilot = pilot_study(Path(folder), seed, preset, run_progress=_pulses("pilot", tell))
        walked = walking_study(
            Path(folder), seed, preset, tell, run_progress=_pulses("walking", tell)
        )
    pilot_table, curves["pilot"] = pilot_results(pilot)
    simulated, more = simulated_chapter(walked)
    tables = (printed_settings(4, preset), *published, *simulated, pilot_table, audit_claims(4))
    return Reproduction.of_chapter(4, tables, curves | more, seed=seed, preset=preset)


def _pulses(what: str, tell: Progress) -> RunProgress:
    """Return what tells of all people's pulses together."""
    done: dict[str, tuple[int, int]] = {}

    def note(participant: str, condition: str, strides: int, completed: int, planned: int) -> None:
        del condition, strides
        if planned:
            done[participant] = (completed, planned)
        pulses, of = (sum(part) for part in zip(*done.values(), strict=True)) if done else (0, 1)
        tell(pulses, of, f"{what}: pulses")

    return note


# --- simulated people ----------------------------------------------------------------------------


def simulated_chapter(study: WalkedStudy) -> tuple[tuple[Table, ...], dict[str, Any]]:
    """Return the tables of a simulated study, and what figures 4.2 to 4.4 and A.1 draw."""
    tests = device_effect(study.gait)
    shown = study.people[min(_SHOWN_PERSON, len(study.people) - 1)]
    tables: tuple[Table, ...] = (
        *participant_grids(study),
        means_table(study),
        accuracy_table(study),
        simulated_statistics(study, tests),
    )
    curves = {
        "strides": stride_figure(study.gait, shown),
        "device_effect": effect_figure(study.gait, tests),
        "impedance": impedance_figure(study),
        "literature": literature_figure(study),
    }
    return tables, curves


def simulated_statistics(
    study: WalkedStudy, tests: tuple[WaveformTest, WaveformTest] | None
) -> ClaimTable:
    """Return the statistics of 4.3 on the simulated people, people being what is counted."""
    rows = _device_claims(tests)
    for name in PARAMETER_NAMES:
        for source in _METHODS:
            rows += _factor_claims(study, source, name)
    return claim_table(4, "simulated_statistics", rows)


# --- timing point and subject --------------------------------------------------------------------


def _factor_claims(study: WalkedStudy, source: str, name: str) -> list[Claim]:
    if (source, name) == ("recommended", "inertia"):
        return stated_claims("simulated_inertia", limit=_SIGNIFICANT)
    try:
        fit = _model(study, source, name)
    except (DataError, EstimationError) as exc:
        where = f"{PARAMETER_NAMES[name]}, {_METHODS[source]}"
        return [Claim("4.3.2.2", where, f"p < {_SIGNIFICANT:g}", "", "not tested", str(exc))]
    # The true inertia is alike at all timing points of a person: nothing to test.
    true = None if name == "inertia" else _model(study, "truth", name)
    missing = _missing(fit, study)
    return [
        Claim(
            "4.3.2.2",
            f"{PARAMETER_NAMES[name]}, {factor}, {_METHODS[source]}",
            f"p < {_SIGNIFICANT:g}",
            ours,
            "reproduced" if p < _SIGNIFICANT else "not reproduced",
            f"{remark[0].upper()}{remark[1:]}{missing}.",
            PEOPLE[name],  # which timing points and people differ in it, or do not
        )
        for factor, (ours, p, remark) in (
            ("timing point", _points(fit, true, name)),
            ("subject", _persons(fit, true, name)),
        )
    ]


def _model(study: WalkedStudy, source: str, name: str) -> MixedModelFit:
    """Fit people and timing points; a cell without a value is missing, the person's others used."""
    table = study.of(source, name).dropna(subset=["value"])
    levels = [point for point in TIMING_POINTS if (table["timing_point"] == point).any()]
    order = pd.Categorical(table["timing_point"], categories=levels, ordered=True)
    return mixed_model(
        table.assign(timing_point=order),
        response="value",
        within="timing_point",
        participant="participant",
    )


def _missing(fit: MixedModelFit, study: WalkedStudy) -> str:
    """Say how many cells, people and timing points are without a value; nothing where none is."""
    counts = (
        (len(fit.missing), "cell", "cells"),
        (len(study.people) - fit.n_participants, "person", "people"),
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
    if tests is None:  # fewer than three people walked in both conditions
        return []
    field, flips = tests
    return stated_claims(
        "device",
        printed=printed_numbers.SPM_THRESHOLD.value,
        field=_largest_t(field),
        fwhm_nodes=field.fwhm_nodes,
        field_verdict="not reproduced" if field.clusters else "reproduced",
        flips=_largest_t(flips),
        threshold_from=flips.threshold_from,
        flips_verdict="not reproduced" if flips.clusters else "reproduced",
        left_open=degrees(field.largest_open_difference),
        margin=degrees(MARGIN_RAD),
        inside=sum(field.equivalent or ()),
        nodes=len(field.t),
        verdict=_DEVICE_VERDICT[field.verdict],
    )


def _largest_t(test: WaveformTest) -> str:
    largest = max(abs(t) for t in test.t)
    text = f"largest |t| {largest:.2f}, threshold {test.threshold:.2f}, {_p(test.p_value)}"
    if not test.clusters:
        return f"{text}, no cluster"
    spans = ", ".join(f"{c.start_node:.0f} to {c.end_node:.0f} %" for c in test.clusters)
    return f"{text}, different at {spans}"


# --- pilot (3.2.4, 3.3.4) ------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class PilotStudy:
    """A simulated pilot."""

    people: tuple[str, ...]  # ids
    # columns of ``WalkedStudy.estimates``, for the sources ``pilot``, ``recommended`` and ``truth``
    estimates: pd.DataFrame

    def mean(self, source: str, parameter: str) -> dict[str, float]:
        """Return the mean over people by timing point.

        A timing point that lacks a person's value has no mean: half a pilot is no average.
        """
        rows = rows_of(self.estimates, source, parameter)
        by_point = rows.groupby("timing_point")["value"].agg(["mean", "count"])
        whole = by_point.loc[by_point["count"] == len(self.people), "mean"]
        return {point: float(whole[point]) for point in TIMING_POINTS if point in whole}


def pilot_study(
    folder: Path,
    seed: int,
    preset: str,
    *,
    run_progress: RunProgress | None = None,
    protocol: str | Protocol = "walking-pilot",
) -> PilotStudy:
    """Run the pilot on simulated people and analyse it by its own and the recommended method."""
    study = run_people(protocol, folder / "pilot", seed, preset, run_progress)
    masses = {person.id: person.mass_kg for person in study.spec.participants}
    rows = true_values(study.root, masses)
    for method in ("pilot", "recommended"):
        analysis = analyze(study, method=method, resamples=_FEWEST_RESAMPLES, seed=seed)
        rows += estimated(method, analysis.cells)
    return PilotStudy(tuple(masses), pd.DataFrame(rows, columns=list(COLUMNS)))


def pilot_results(pilot: PilotStudy) -> tuple[ComparedTable, dict[str, Any]]:
    """Return the numbers of 3.3.4 beside ours, and what figure 3.7 draws."""
    rows = [row for name in PARAMETER_NAMES for row in _range_rows(pilot, name)]
    curves = {
        "onset_pct": dict(TIMING_POINTS),
        "people": list(pilot.people),
        "printed_range": {
            name: [printed.value for printed in printed_numbers.PILOT_RANGES[name]]
            for name in PARAMETER_NAMES
        },
        "parameters": {
            name: {
                source: {
                    "people": [_of_person(pilot, source, name, person) for person in pilot.people],
                    "mean": pilot.mean(source, name),
                }
                for source in _SOURCES
            }
            for name in PARAMETER_NAMES
        },
    }
    return compared_table(4, "pilot", (*rows, *_vaf_rows(pilot))), curves


def _range_rows(pilot: PilotStudy, name: str) -> list[Compared]:
    means = {source: pilot.mean(source, name).values() for source in _SOURCES}
    recommended = rows_of(pilot.estimates, "recommended", name)
    refused = sorted(set(recommended.loc[recommended["value"].isna(), "participant"]))
    undecided = f"recommended: undecided in {', '.join(refused)}" if refused else ""
    rows = []
    for word, pick, printed in zip(
        ("largest", "smallest"), (max, min), printed_numbers.PILOT_RANGES[name], strict=True
    ):
        published, ours, truth = (pick(means[source], default=None) for source in _SOURCES)
        quantity = f"{word} average {PARAMETER_NAMES[name]}"
        note = "; ".join(filter(None, (printed.note, undecided)))
        unit = PARAMETER_UNITS[name]
        more: dict[str, Any] = {"truth": truth, "note": note, "built_in": PEOPLE[name]}
        rows.append(compare(quantity, unit, printed, published, ours, **more))
    return rows


def _vaf_rows(pilot: PilotStudy) -> list[Compared]:
    vaf = [_mean_vaf(pilot, source) for source in ("pilot", "recommended")]
    rows = [
        compare(
            f"VAF of person {number}", "%", printed_numbers.PILOT_VAF[number], *_values(vaf, person)
        )
        for number, person in zip(("1", "2"), pilot.people, strict=False)
    ]
    both = [fmean(of_people.values()) if of_people else None for of_people in vaf]
    return [*rows, compare("VAF of both", "%", printed_numbers.PILOT_VAF["mean"], *both)]


def _values(vaf: list[dict[str, float]], person: str) -> list[float | None]:
    return [of_people.get(person) for of_people in vaf]


def _mean_vaf(pilot: PilotStudy, source: str) -> dict[str, float]:
    """Return every person's mean VAF over timing points; a person without any is left out."""
    rows = rows_of(pilot.estimates, source, "inertia").dropna(subset=["vaf_pct"])
    return {str(who): float(v) for who, v in rows.groupby("participant")["vaf_pct"].mean().items()}


def _of_person(pilot: PilotStudy, source: str, name: str, person: str) -> Mapping[str, Any]:
    """Return timing point -> value, low, high, None where there is none."""
    rows = rows_of(pilot.estimates, source, name)
    rows = rows[rows["participant"] == person].set_index("timing_point")
    values = rows[["value", "ci_low", "ci_high"]].astype(object)
    return {str(point): list(v) for point, v in values.where(values.notna(), None).T.items()}
