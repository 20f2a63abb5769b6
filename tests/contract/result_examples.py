"""An example of every result class, by what it shows."""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

import jointz
from jointz.analysis.saved_analysis import Analysis
from jointz.comparison.comparison_result import Comparison
from jointz.control.design import design_joint
from jointz.control.rendering.actuators import read_actuator
from jointz.control.rendering.check import check_rendering
from jointz.core.events import GapRecord, PulseRecord, StrideRecord
from jointz.inspection.inspection_result import (
    Answer,
    Inspection,
    Question,
    SeenChannel,
    SeenClock,
    SeenRecording,
)
from jointz.planning.plan_result import (
    Plan,
    PlannedCourse,
    PlannedEstimate,
    PlannedMeasure,
    PlannedPeople,
    PlannedShape,
)
from jointz.pooling.plain_tables import typed_table
from jointz.pooling.pooled_result import COLUMNS, PooledStudies
from jointz.results.bench.bench_fits import FullRecordFit, PulseFit
from jointz.results.bench.calibration_fit import (
    CalibrationFailure,
    CalibrationFit,
    CalibrationSeries,
    decided,
    failed,
)
from jointz.results.bench.paired_runs_fit import PairedRunsFit
from jointz.results.certificate_result import (
    Certificate,
    ComparedStatistic,
    VirtualEstimate,
    expected_errors,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate, Response
from jointz.results.log_posterior import LogPosterior
from jointz.results.run_report import RunReport, StudyRun
from jointz.results.series.cycle_curve import CurvePoint, ParameterBand, PhaseCurve
from jointz.results.series.joint_fit import FitSeries, JointFit
from jointz.results.series.reflex_fit import ReflexFit, ReflexPath, ReflexSeries
from jointz.results.statistics.comparison_rows import (
    Difference,
    FactorTest,
    PersonValue,
    ReferenceRange,
    Repeatability,
    Source,
    SourceMean,
)
from jointz.results.statistics.pulse_effect_tests import PulseEffects, PulseMeans, PulseTest
from jointz.results.study_analysis import PopulationEstimate
from jointz.rig.calibration.report import Calibration
from jointz.verification.verify import AdditionResult, Verification


def cell(person: str, point: str, onset: float | None, status: str = "ok") -> CellEstimate:
    failed = status not in ("ok", "at_bound")
    value = None if failed else 50.0
    stiffness = ParameterEstimate("stiffness", value, value, value, status, ci_method="bootstrap")
    inertia = ParameterEstimate("inertia", None, None, None, "undecided", unbounded=-0.01)
    return CellEstimate(
        participant=person,
        timing_point=point,
        onset_gait_pct=onset,
        parameters=(stiffness, inertia),
        vaf_pct=None if failed else 97.5,
        n_used=0 if failed else 3,
        n_excluded=1,
        method="dissertation",
        baseline="pre_pulse",
        condition_number=None if failed else 12.0,
        displacement_rad=None if failed else 0.1,
        response=None if failed else Response(*np.arange(12.0).reshape(4, 3)),
    )


def walking_analysis() -> Analysis:
    return Analysis(
        cells=(
            cell("S01", "LRE", 7.1),
            cell("S01", "MST", 21.4, "at_bound"),
            cell("S02", "LRE", 6.9),
            cell("S02", "MST", None, "failed:no_pulses"),
        ),
        comparison=(cell("S01", "LRE", 7.1),),
        population=(
            PopulationEstimate(
                "LRE", 7.0, "stiffness", 50.0, "N*m/rad", 1.0, 48.0, 52.0, 2, "m", "ok"
            ),
            PopulationEstimate(
                "MST", None, "stiffness", None, "N*m/rad", None, None, None, 1, "m", "undecided"
            ),
        ),
        pulses=(
            PulseRecord("S01", "a.csv", 1.25, 0.25, -7.0, "LRE", 7.0, 7.1),
            PulseRecord("S01", "a.csv", 9.5, None, None, "MST", code="gap", detail="0.2 s"),
        ),
        strides=(
            StrideRecord("S01", "a.csv", "perturbed", 0.5, 1.1),
            StrideRecord("S01", "a.csv", "perturbed", 1.6, 2.2, "missing_strike"),
        ),
        gaps=(GapRecord("S01", "a.csv", 9.4, 0.2),),
        statistics={"vaf": {"mean_pct": 97.5, "n": 3}, "points": ["LRE", "MST"]},
        settings={"method": "dissertation", "seed": 0, "window_s": 0.1},
        provenance={"inputs": {"a.csv": {"sha256": "00"}}, "time": None},
    )


def bench_analysis() -> Analysis:
    return Analysis(cells=(cell("spring", "case 1", None), cell("spring", "case 2", None)))


def joint_fit() -> JointFit:
    return JointFit(
        model="kbj",
        estimator="output_error",
        input="torque",
        parameters=(
            ParameterEstimate("stiffness", 50.0, 48.0, 52.0, "ok", ci_method="sandwich"),
            ParameterEstimate("damping", 1e-9, 0.0, 0.5, "at_bound", share_at_bound=0.7),
            ParameterEstimate("inertia", None, None, None, "undecided"),
        ),
        vaf_pct=98.0,
        vaf_of="angle",
        status="undecided",
        n_samples=1000,
        rate_hz=500.0,
        cutoff_hz=30.0,
        condition_number=4.0,
        covariance=((1.0, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 1e-6)),
        residual_correlation_time_s=0.05,
        ci_method="sandwich",
        settings={"ci_level": 0.95, "cutoff_hz": 30.0},
        warnings=("the record is short",),
        series=FitSeries((0.0, 0.002), (0.1, 0.2), (0.11, 0.19)),
    )


def run_report() -> RunReport:
    row: dict[str, Any] = dict.fromkeys(("planned", "completed", "n"), 50)
    row |= {"participant": "S01", "condition": "perturbed", "timing_point": "LRE"}
    row |= {"planned_pct": 7.0, "missed": 2, "aborted": 0}
    row |= {"error_mean_pct": 0.1, "error_sd_pct": 1.5, "theory_sd_pct": 1.4}
    gaps = {"participant": "S01", "condition": "perturbed", "fewest": 3, "most": 7}
    return RunReport("walking", 0, (row,), (gaps,), ({"participant": "S01", "overruns": 0},))


def full_record_fit() -> FullRecordFit:
    return FullRecordFit(
        parameters=(
            ParameterEstimate("stiffness", 168.0, 167.0, 169.0, "ok", ci_method="sandwich"),
            ParameterEstimate("damping", -0.001, -0.02, 0.02, "ok"),
            ParameterEstimate("inertia", None, None, None, "undecided"),
            ParameterEstimate("coulomb_friction", 0.03, 0.02, 0.04, "ok"),
            ParameterEstimate("torque_lag", 0.0022, 0.0021, 0.0023, "ok"),
        ),
        lag_model="mixed",
        filter_time_s=0.001,
        vaf_pct=99.99,
        residual_sd_nm=0.02,
        n_samples=10_800,
        rate_hz=900.0,
        condition_number=12.0,
        covariance=((1.0, 0.0), (0.0, 0.1)),
        settings={"n_trials": 7, "lag_s": None},
        warnings=("the kind of lag is not decided",),
        series=FitSeries((0.0, 0.1), (1.0, 2.0), (1.1, 1.9)),
    )


def pulse_fit() -> PulseFit:
    return PulseFit(**{f.name: getattr(full_record_fit(), f.name)
                       for f in dataclasses.fields(PulseFit)})  # fmt: skip


def pulse_effects() -> PulseEffects:
    numbers = (9.0, 1.0, 46.0, 0.004, 0.008, 1.5, 0.5, 2.5, 56, 7)
    test = PulseTest("1", "A", "stiffness", "type", "mixed", *numbers)
    mean = PulseMeans("1", "A", "stiffness", 169.0, 167.5, 168.2, None, 56, 0, 0.5, 1.0, None)
    return PulseEffects((test,), (mean,), notes=("type and direction are confounded",))


def responding() -> dict[str, np.ndarray]:
    """Return a joint moved by noise: torque, angle, and a motor that made the torque."""
    rng = np.random.default_rng(1)
    sos = butter(2, 20.0, fs=500.0, output="sos")
    angle = 0.02 * sosfiltfilt(sos, rng.standard_normal(5000))
    velocity = np.gradient(angle, 0.002)
    torque = 50.0 * angle + 1.0 * velocity + 0.02 * np.gradient(velocity, 0.002)
    noisy = torque + 0.01 * rng.standard_normal(5000)
    current = (noisy + 0.3 * np.sign(velocity)) / 0.99
    return {"angle": angle, "torque": noisy, "velocity": velocity, "current": current}


def bandwidth_fit() -> Any:
    command = np.random.default_rng(2).standard_normal(20_000)
    slow = sosfiltfilt(butter(1, 20.0, fs=500.0, output="sos"), command)
    return jointz.identify_bandwidth(command=command, torque=slow, rate_hz=500.0)


def joint_model(model: Any) -> Any:
    made = responding()
    return jointz.identify_joint(
        angle=made["angle"], torque=made["torque"], rate_hz=500.0, input="angle", model=model
    )


def actuator_fit() -> Any:
    made = responding()
    return jointz.identify_actuator(
        current=made["current"],
        velocity=made["velocity"],
        torque=made["torque"],
        gear_ratio=9.0,
        model="friction",
    )


def reflex_fit() -> ReflexFit:
    return ReflexFit(
        model="reflex",
        estimator="parallel_cascade",
        input="angle",
        parameters=(
            ParameterEstimate("stiffness", 70.0, 68.0, 72.0, "ok", ci_method="sandwich"),
            ParameterEstimate("reflex_gain", 5.0, 4.0, 6.0, "ok"),
            ParameterEstimate("reflex_delay", None, None, None, "undecided"),
        ),
        vaf_pct=95.0,
        intrinsic_vaf_pct=81.0,
        reflex_vaf_pct=-3.0,
        linear_vaf_pct=86.0,
        linear_stiffness=104.0,
        vaf_of="torque",
        status="undecided",
        path=ReflexPath("positive", 0.25, 1.5, 0.75, 0.001),
        n_samples=5900,
        rate_hz=1000.0,
        fit_rate_hz=100.0,
        cutoff_hz=20.0,
        condition_number=6.5,
        covariance=((1.0, 0.0), (0.0, 0.25)),
        ci_method="sandwich",
        settings={"delay_range_s": [0.02, 0.1]},
        warnings=("the delay cannot be told",),
        series=ReflexSeries((0.0, 0.01), (0.1, 0.2), (0.1, 0.2), (0.05, 0.1), (0.05, 0.1)),
    )


def static_stiffness_fit() -> Any:
    made = responding()
    return jointz.identify_static_stiffness(
        angle=made["angle"], torque=made["torque"], rate_hz=500.0, direction=made["velocity"]
    )


def dither_stiffness_fit() -> Any:
    wave = 0.02 * np.exp(0.04j * np.pi * np.arange(5000))
    return jointz.identify_dither_stiffness(
        angle=wave.real, torque=((50.0 + 3.0j) * wave).real, rate_hz=500.0, frequency_hz=10.0
    )


def paired_runs_fit() -> Any:
    made, time = responding(), np.arange(5000) / 500.0
    run = {"time": time, "reference": np.sin(time), "command": (time % 2.0 > 1.8) * 1.0}
    still = {"angle": np.zeros(5000), "torque": np.zeros(5000)}
    return jointz.identify_paired_runs([(run | still, run | made)])


def undecided_paired_runs() -> PairedRunsFit:
    fit = paired_runs_fit()
    unknown = ParameterEstimate("stiffness", None, None, None, "undecided", unbounded=-1.0)
    return dataclasses.replace(
        fit,
        parameters=(unknown, *fit.parameters[1:]),
        left_out=("pair 1, pulse at 3 s: its window runs past the end of a run",),
        warnings=("the stiffness is negative",),
    )


def time_varying_fit() -> Any:
    rng = np.random.default_rng(3)
    torque = sosfiltfilt(butter(2, 20.0, fs=250.0, output="sos"), rng.standard_normal(10_000))
    angle = 0.01 * sosfiltfilt(butter(2, 5.0, fs=250.0, output="sos"), torque)
    return jointz.identify_time_varying(
        angle=angle,
        torque=torque,
        rate_hz=250.0,
        heel_strikes=np.arange(0.0, 40.0),
        n_phases=4,
        resamples=100,
    )


def log_posterior() -> LogPosterior:
    names = ("stiffness", "damping", "inertia")
    covariance = 0.04 * np.eye(6) + 0.01
    return LogPosterior(
        participant="S01",
        parameters=tuple(name for name in names for _ in range(2)),
        timing_points=("LRE", "MST") * 3,
        mean=np.log([60.0, 40.0, 2.0, 1.5, 0.05, 0.06]),
        covariance=covariance,
        prior_mean=np.log([50.0, 50.0, 2.0, 2.0, 0.05, 0.05]),
        prior_covariance=covariance + 0.2 * np.eye(6),
        session="day 2",
        side="left",
    )


def certificate() -> Certificate:
    estimates = tuple(
        VirtualEstimate(who, "LRE", name, truth, value, low, high, status)
        for who, name, truth, value, low, high, status in (
            ("V01", "stiffness", 100.0, 104.0, 95.0, 113.0, "ok"),
            ("V02", "stiffness", 90.0, None, None, None, "undecided"),
            ("V01", "damping", 3.0, 3.1, 2.8, 3.4, "ok"),
            ("V01", "inertia", 0.05, 0.051, 0.047, 0.055, "ok"),
        )
    )
    return Certificate(
        "strapped",
        expected_errors(estimates),
        estimates,
        2,
        (ComparedStatistic("misfit", 1.2, 1.0, 0.8, 1.1),),
        world="realistic",
        protocol="+17 N*m for 250 ms",
        left_out={"V03": "no pulse"},
        settings={"seed": 1},
    )


def plan() -> Plan:
    names = ("stiffness", "damping", "inertia")
    return Plan(
        protocol="walking_doublets",
        pulses="short: doublet of 40 + 22 ms, 10 and 17 N*m, both signs",
        window_s=0.15,
        sensors=("goniometer", "encoder"),
        walking="220 unperturbed strides of 1 person of my-walking",
        estimates=tuple(
            PlannedEstimate(point, pct, name, 48, half, 1.4 * half, 0.8, 0.5 * half, half < 50, 6.0)
            for point, pct in (("LRE", 7.0), ("MST", 21.5))
            for name, half in zip(names, (28.0, 34.0, 120.0), strict=True)
        ),
        shapes=(
            PlannedShape("as in the protocol", "hold: 8 N*m", 9.8, 80.0, 130.0, 28.0, why_not="no"),
            PlannedShape("two doublets", "short: doublet", 12.1, 28.0, 34.0, 12.0, chosen=True),
        ),
        measures=(PlannedMeasure("as planned", 28.0, 34.0, 12.0),),
        people=(PlannedPeople(2, "stiffness", 45.0, 7264.0, 753.0, 53.9),),
        participants=2,
        minutes=29.0,
        peak_deg=12.1,
        wishes={"share": 0.8, "parameters": ("stiffness", "damping")},
        notes=("No number of pulses decides J of a typical leg.",),
        sources={"stiffness": {"strap": 0.2, "noise": 0.5}},
        courses=(PlannedCourse("short", (0.0, 0.0, 0.04), (0.0, 1.0, 1.0), (10.0, 17.0), (1.0,)),),
        protocol_text="jointz_protocol = 1\n",
        provenance={"seed": 1},
    )


def seen_afterwards() -> Plan:
    return dataclasses.replace(
        plan(),
        recorded=True,
        reached={"stiffness": {"LRE": 31.0}, "damping": {}},
        refused=("20 % cannot be had. Nearest: --half-width 41.",),
        protocol_text="",
    )


def phase_curve() -> PhaseCurve:
    point = CurvePoint("LRE", 10.0, 90.0, 80.0, 100.0, True)
    low, middle, high = (80.0, 20.0, 80.0), (90.0, 40.0, 90.0), (100.0, 60.0, 100.0)
    band = ParameterBand("S01", "stiffness", middle, low, high, "logarithmic", 15.0, (point,))
    return PhaseCurve((0.0, 50.0, 100.0), (band,), 0.95, "process", {}, ("note",))


def waveform_curves() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    a, b = np.cumsum(rng.standard_normal((2, 8, 21)), axis=2)
    a += 20.0 * np.exp(-(((np.arange(21) - 10) / 3) ** 2))
    b[:, 0] = a[:, 0]
    return a, b


def mapped_curves() -> Any:
    return jointz.stats.spm_paired_t(*waveform_curves())


def flipped_curves() -> Any:
    _, b = waveform_curves()
    return jointz.stats.sign_flip_max_t(b, -b[::-1], equivalence_margin=30.0)


def mixed_model_fit() -> Any:
    rng = np.random.default_rng(5)
    table = pd.DataFrame(
        [(f"S{i}", point) for i in range(6) for point in ("LRE", "MST", "TST")],
        columns=["who", "point"],
    )
    table["k"] = rng.standard_normal(len(table)) + np.tile([2.0, 1.0, 1.2], 6)
    return jointz.stats.mixed_model(table[1:], response="k", within="point", participant="who")


def quasi_stiffness_of_a_cycle() -> Any:
    pct = np.linspace(0.0, 100.0, 101)
    angle = 0.4 + 0.3 * np.sin(2.0 * np.pi * pct / 100.0)
    return jointz.stats.quasi_stiffness(angle, 2.0 * angle**2, gait_pct=pct)


def quasi_stiffness_compared() -> Any:
    quasi = {"LRE": 3.6, "MST": 3.8, "TST": 1.3}
    stiffness = {"LRE": 1.8, "MST": 0.6, "TST": 1.2}
    return jointz.stats.compare_quasi_stiffness(quasi, stiffness)


def comparison() -> Comparison:
    of = ("stiffness", "N*m/rad", "LRE")
    people = tuple(Source(name, ("S01", "S02"), ("rigid",)) for name in ("day1", "day2"))
    numbers = (60.0, 50.0, 10.0, 2.0, 18.0, 3.0, 1.0, 0.2, 0.4)
    return Comparison(
        sources=people,
        values=(
            PersonValue("day1", "S01", "stiffness", "LRE", 61.0, 58.0, 64.0),
            PersonValue("day1", "S02", "stiffness", "LRE", None, status="undecided"),
        ),
        means=(
            SourceMean("day1", *of, 2, 0, 1, 60.0, 2.0, 42.0, 78.0, 1.5),
            SourceMean("day2", *of, 1, 1, 0, None, None, None, None),
        ),
        differences=(
            Difference(*of, "day1", "day2", "paired", 2, 2, 0, *numbers, margin=5.0),
            Difference(*of, "day1", "day2", "paired", 1, 1, 0, status="no_spread"),
        ),
        tests=(
            FactorTest("stiffness", "N*m/rad", "timing_point", "day1", mixed_model_fit()),
            FactorTest("inertia", "kg*m^2", "timing_point", "day1", None, "one value"),
        ),
        repeatability=(Repeatability(*of, 2, 2, 0.8, 0.1, 0.9), Repeatability(*of, 1, 2)),
        references=(ReferenceRange("Pfeifer", "stiffness", "LRE", None, 1.0, 2.0, "words"),),
        margin_pct=10.0,
        settings={"days": True},
        notes=("two people",),
        provenance={"jointz": "0"},
    )


def calibration_fit() -> CalibrationFit:
    shown = (0.0, 1.0, 2.0)
    return CalibrationFit(
        step="hinge",
        entries=(
            decided("angle_lag_s", 0.0065, {"noise": 3e-4, "delay_or_filter": 4e-4}),
            decided("angle_gain", 1.01, {"noise": 0.2}, largest_sd=0.03),
        ),
        reported=(decided("angle_delay_s", 0.002, {"noise": 1e-3}),),
        method="in words",
        n_samples=3,
        notes=("a note",),
        settings={"shares": 6},
        series=CalibrationSeries(shown, shown, shown, "time (s)", "angle (rad)"),
    )


def refused_calibration() -> CalibrationFit:
    names = ("angle_zero_rad",)
    return CalibrationFit("zero", failed(names, CalibrationFailure.NOT_STILL, "straight"))


def calibration() -> Calibration:
    fits = {"S01": calibration_fit(), "S02": calibration_fit()}
    return Calibration("hinge", fits, "study", ("calibration.toml",), ("a note",))


def pooled_studies() -> PooledStudies:
    cell = {"timing_point": "MST", "condition": "level", "parameter": "stiffness"}
    cell |= {"unit": "N*m/rad", "walking_speed_m_s": 1.2}
    numbers = {"value": 60.0, "ci_low": 50.0, "ci_high": 70.0}
    ends = {"prediction_low": 40.0, "prediction_high": 80.0}
    row = cell | numbers | ends | {"n_studies": 2, "n_people": 9, "status": "ok"}
    study = cell | numbers | {"n_people": 4, "weight_pct": 50.0, "status": "ok"}
    studies = [study | {"study": f"lab-{k}"} for k in range(2)]
    studies.append(cell | {"study": "lab-c", "status": "no_value"})
    tables = {"table": [row, cell | {"parameter": "damping"}], "studies": studies}
    return PooledStudies(
        **{name: typed_table(tables.get(name, [cell]), COLUMNS[name]) for name in COLUMNS},
        notes=("Values at their bound are used as they are.",),
    )


def nothing_pooled() -> PooledStudies:
    return PooledStudies(*(typed_table([], kinds) for kinds in COLUMNS.values()))


def verification() -> Verification:
    parts = (
        AdditionResult("S01", "stiffness", 50.0, 1.0, 36.0, 29.0, 43.0, "fail", None),
        AdditionResult("S01", "inertia", 0.0, 0.0, 0.01, -0.01, 0.03, "pass", None),
        AdditionResult("S02", "stiffness", 50.0, 1.0, 51.0, 20.0, 82.0, "cannot tell", 1.8),
    )
    verdicts = {"S01": "fail", "S02": "cannot tell"}
    return Verification(parts, verdicts, {"S01": 1e-4, "S02": 0.9}, {"S01": "the torque gain"})


def inspection() -> Inspection:
    course = (0.0, 1.0, None, -0.5)
    angle = SeenChannel(
        "", "2", "knee", "angle", "its name", "deg", "guessed", 100, 1, -1.0, 60.0,
        outline=course, notes=("saturated?",),
    )  # fmt: skip
    phase = SeenChannel("", "3", n=100, n_missing=2, levels=("ENP", "EWP"))
    clock = SeenClock("", "1", 100, 200.0, 0.0, 0.6, False, 0.2, ((0.1, 0.2),), (50,), 1)
    return Inspection(
        "a.csv",
        {"delimiter": ";", "skip_rows": 6},
        (angle, phase),
        (clock, SeenClock("other", "", 7)),
        2,
        ("a note",),
        ("no torque",),
        ("jointz identify takes it",),
        "jointz = 1\n",
        (Question("coupling", "How?", (Answer("strap", "cuffs"), Answer(None, "unknown"))),),
        (SeenRecording("a.csv", "S01", "perturbed", rate_hz=100.0), SeenRecording("b", "S02", "")),
    )


@functools.cache
def published_profile():
    return jointz.impedance_profile(mass_kg=75.0)


EXAMPLES: dict[str, Callable[[], Any]] = {
    "profile": published_profile,
    "rendering check": lambda: check_rendering(published_profile(), read_actuator("sea")),
    "design": lambda: design_joint({"walking": published_profile()}),
    "inspection": inspection,
    "nothing seen": lambda: Inspection("empty.csv"),
    "pooled studies": pooled_studies,
    "nothing pooled": nothing_pooled,
    "comparison": comparison,
    "nothing compared": lambda: Comparison((), (), (), ()),
    "walking": walking_analysis,
    "bench": bench_analysis,
    "empty": lambda: Analysis(cells=()),
    "fit": joint_fit,
    "fit without intervals": lambda: dataclasses.replace(joint_fit(), covariance=(), warnings=()),
    "run report": run_report,
    "run": lambda: StudyRun(Path("study"), run_report()),
    "full record": full_record_fit,
    "pulse": pulse_fit,
    "pulses": pulse_effects,
    "no pulses": lambda: PulseEffects((), ()),
    "bandwidth": bandwidth_fit,
    "frequency response": lambda: joint_model("frf"),
    "impulse response": lambda: joint_model("irf"),
    "reflex": reflex_fit,
    "no reflex": lambda: dataclasses.replace(reflex_fit(), path=ReflexPath(p_value=0.5)),
    "actuator": actuator_fit,
    "static stiffness": static_stiffness_fit,
    "dither stiffness": dither_stiffness_fit,
    "paired runs": paired_runs_fit,
    "undecided paired runs": undecided_paired_runs,
    "time-varying": time_varying_fit,
    "certificate": certificate,
    "calibration step": calibration_fit,
    "refused calibration step": refused_calibration,
    "calibration": calibration,
    "log posterior": log_posterior,
    "plan": plan,
    "seen afterwards": seen_afterwards,
    "phase curve": phase_curve,
    "mapped curves": mapped_curves,
    "flipped curves": flipped_curves,
    "mixed model": mixed_model_fit,
    "quasi-stiffness": quasi_stiffness_of_a_cycle,
    "quasi-stiffness beside stiffness": quasi_stiffness_compared,
    "verification": verification,
    "no leg fitted": lambda: Verification((), {"S01": "cannot tell"}, {"S01": None}, {}),
}


@functools.cache
def example(name: str) -> Any:
    return EXAMPLES[name]()
