"""Synthetic analyses: nobody's data, but of the shape and size of a real study."""

import shutil
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.analysis.page.figure_files import draw_figures
from jointz.core.events import GapRecord, PulseRecord, StrideRecord
from jointz.core.gait_phases import TIMING_POINTS
from jointz.results.estimates import CellEstimate, ParameterEstimate, PulseExample, Response
from jointz.results.mean_stride import MeanStride
from jointz.results.study_analysis import ParticipantModel, PopulationEstimate, StudyAnalysis

# Per kg, as in the dissertation's table 4.1: stiff in early stance, compliant in swing.
STIFFNESS_PER_KG = dict(zip(TIMING_POINTS, (3.0, 2.1, 1.5, 0.9, 0.40, 0.35), strict=True))
DAMPING_PER_KG = dict(zip(TIMING_POINTS, (0.060, 0.045, 0.040, 0.035, 0.030, 0.029), strict=True))
PULSES = 48
#: Sources of the errors of the former method ``rigid``.
SOURCES = ("noise", "lag", "friction", "drift", "prior", "gain")


def response(rng, stiffness, damping, inertia):
    time = np.arange(101) * 1e-3
    torque = 17.0 * np.clip(time / 0.075, 0.0, 1.0)
    angle = np.zeros_like(time)
    velocity = 0.0
    for i in range(1, time.size):
        velocity += 1e-3 * (torque[i] - stiffness * angle[i - 1] - damping * velocity) / inertia
        angle[i] = angle[i - 1] + 1e-3 * velocity
    noise = 0.3 * np.sin(2 * np.pi * rng.uniform(2, 7) * time + rng.uniform(0, 6))
    return Response(time, angle, torque + noise, torque)


def estimate(rng, name, truth, spread=0.08, status="ok"):
    if status == "at_bound":
        return ParameterEstimate(name, 2e-14, 0.0, 0.6 * truth, status, share_at_bound=0.7)
    if status != "ok":
        return ParameterEstimate(name, None, None, None, status)
    value = truth * (1 + spread * rng.standard_normal())
    return ParameterEstimate(
        name, value, value - 2 * spread * truth, value + 2 * spread * truth, "ok",
        ci_method="percentile bootstrap over pulses and unperturbed strides",
    )  # fmt: skip


def pulse_example(rng, person, answer):
    """Return a pulse of a cell: its response with noise, on a line as baseline."""
    line = 0.3 + 2.0 * answer.time_s
    noisy = answer.angle + 0.002 * rng.standard_normal(answer.angle.size)
    return PulseExample(
        f"{person}_ewp.csv", 20.0, answer.time_s, line + noisy, answer.torque, line,
        0.0 * line, noisy if answer.fitted_angle is not None else answer.torque, PULSES,
    )  # fmt: skip


def mean_strides(rng, person):
    """Return the mean strides without the device and with it."""
    gait_pct = np.linspace(0.0, 100.0, 101)
    turn = 2 * np.pi * gait_pct / 100.0
    waves = sum(rng.normal(0.0, 0.02) * np.sin(k * turn + k) for k in range(1, 6))
    return tuple(
        MeanStride(person, condition, 60, gait_pct, 0.4 - 0.4 * np.cos(turn) + shift + waves,
                   np.full(101, 0.03), None if condition == "no_device" else np.sin(turn))
        for condition, shift in (("no_device", 0.0), ("unperturbed", 0.05 + 0.02 * np.sin(turn)))
    )  # fmt: skip


def walking_cell(rng, person, mass, point, *, method="rigid", bias=1.0, status="ok"):
    onset = TIMING_POINTS[point]
    k, b = bias * mass * STIFFNESS_PER_KG[point], bias * mass * DAMPING_PER_KG[point]
    failed = status.startswith("failed")
    parameters = [
        estimate(rng, "stiffness", k, status=status),
        estimate(rng, "damping", b, status="ok" if status == "at_bound" else status),
        estimate(rng, "stiffness_per_mass", k / mass, status=status),
        estimate(
            rng, "damping_per_mass", b / mass, status="ok" if status == "at_bound" else status
        ),
    ]
    if method == "dissertation":
        parameters.append(estimate(rng, "inertia", bias * 0.0045 * mass, spread=0.2))
    answer = None if failed or method == "dissertation" else response(rng, k, b, 0.3)
    return CellEstimate(
        person, point, None if failed else onset + rng.normal(0, 0.3), tuple(parameters),
        vaf_pct=None if failed else rng.uniform(95, 99.9), n_used=0 if failed else PULSES,
        n_excluded=50 if failed else 50 - PULSES, method=method, baseline="predicted",
        displacement_rad=None if failed else 0.2,
        response=answer,
        # Of its own generator: the other numbers stay as they were.
        example=answer and pulse_example(np.random.default_rng(0), person, answer),
    )  # fmt: skip


def shared_inertia(rng, person, mass):
    inertia = estimate(rng, "inertia", 0.0045 * mass)
    return CellEstimate(person, "all", None, (inertia,), None, PULSES * 6, 12, "rigid", "predicted")


def population(cells):
    rows = []
    table = pd.DataFrame([row for cell in cells for row in cell.rows()])
    for (point, name), group in table.groupby(["timing_point", "parameter"], sort=False):
        values = group["value"].dropna()
        half = 2.26 * values.std() / np.sqrt(len(values)) if len(values) > 1 else None
        mean = values.mean() if len(values) else None
        onset = group["onset_gait_pct"].mean()
        rows.append(
            PopulationEstimate(
                point, None if np.isnan(onset) else onset, name, mean, group["unit"].iloc[0],
                values.std() if half else None, mean - half if half else None,
                mean + half if half else None, len(values), "rigid",
                "ok" if half else "failed:too_few_participants",
            )
        )  # fmt: skip
    return tuple(rows)


def walk(rng, person, recording, condition, stride_s, end_s):
    strides, time = [], 1.0
    while time < end_s:
        duration = stride_s * (1 + 0.02 * rng.standard_normal() + 0.01 * np.sin(time / 60))
        code = "pulse_in_stride" if condition == "perturbed" and rng.random() < 0.2 else ""
        if rng.random() < 0.004:
            duration, code = 2 * duration, "missing_strike"
        elif rng.random() < 0.004:
            duration, code = 0.4 * duration, "spurious_strike"
        strides.append(StrideRecord(person, recording, condition, time, duration, code))
        time += duration
    return strides


def pulses_of(rng, person, cell):
    target = TIMING_POINTS[cell.timing_point]
    for i in range(cell.n_used + cell.n_excluded):
        used = i < cell.n_used
        yield PulseRecord(
            person, f"{person}_ewp.csv", 20.0 + 5.5 * i, 0.25, 17.0, cell.timing_point, target,
            (target + rng.normal(0.1, 0.15 + 0.02 * target)) % 100.0 if used else None,
            "" if used else ("no_recent_strides" if i % 2 else "gap"),
        )  # fmt: skip


def walking_analysis(people=10, *, minutes=27.5, seed=1):
    rng = np.random.default_rng(seed)
    cells, comparison, pulses, strides, gaps, walked = [], [], [], [], [], []
    for i in range(people):
        person, mass, stride_s = f"S{i + 1:02d}", rng.uniform(55, 90), rng.uniform(1.0, 1.25)
        for point in TIMING_POINTS:
            status = {(2, "MSW"): "at_bound", (5, "ISW"): "at_bound", (4, "TST"): "undecided",
                      (8, "PSW"): "failed:all_pulses_excluded"}.get((i, point), "ok")  # fmt: skip
            cell = walking_cell(rng, person, mass, point, status=status)
            cells.append(cell)
            comparison.append(
                walking_cell(rng, person, mass, point, method="dissertation", bias=0.7)
            )
            pulses += pulses_of(rng, person, cell)
        cells.append(shared_inertia(rng, person, mass))
        for name, condition, end in (
            ("enp", "unperturbed", 70.0),
            ("ewp", "perturbed", 60 * minutes),
        ):
            own = walk(rng, person, f"{person}_{name}.csv", condition, stride_s, end)
            strides += own
            good = [s.duration_s for s in own if not s.code]
            walked.append(
                {"participant": person, "recording": f"{person}_{name}.csv", "condition": condition,
                 "n_strikes": len(own) + 1, "n_accepted": len(good),
                 "n_rejected": len(own) - len(good), "mean_s": float(np.mean(good)),
                 "sd_s": float(np.std(good)), "n_gaps": int(i == 1),
                 "longest_gap_s": 0.137 * (i == 1)}
            )  # fmt: skip
        gaps += [GapRecord(person, f"{person}_ewp.csv", 400.0, 0.137)] if i == 1 else []
    return StudyAnalysis(
        tuple(cells), tuple(comparison), population(cells), tuple(pulses), tuple(strides),
        tuple(gaps),
        mean_strides=tuple(
            m for i in range(people)
            for m in mean_strides(np.random.default_rng(i), f"S{i + 1:02d}")
        ),
        statistics={
            "onset_accuracy": [
                {"timing_point": n, "n": 480, "mean_pct": t + 0.1, "sd_pct": 0.15 + 0.02 * t,
                 "target_pct": t} for n, t in TIMING_POINTS.items()
            ],
            "strides": walked,
            "vaf": {"mean_pct": 98.1, "sd_pct": 1.2, "median_pct": 98.4},
        },
        settings={
            "method": "rigid", "baseline": "predicted", "resamples": 1000, "seed": 1,
            "window_s": 0.1, "cutoff_hz": 20.0, "ci_level": 0.95, "joint": "knee",
            "kind": "walking", "positive": "flexion", "study": "demo",
        },
        provenance={
            "jointz": "0.1.0", "python": "3.11.9",
            "packages": {"numpy": "2.4.0", "scipy": "1.17.0"},
            "created": "2025-11-21T10:00:00+00:00", "study_sha256": "ab" * 32,
            "inputs": [{"file": f"S{i + 1:02d}_ewp.csv", "sha256": f"{i:02x}" * 32,
                        "size_bytes": 120_000_000 + i} for i in range(people)],
        },
    )  # fmt: skip


def bench_analysis(groups=("k1 I1", "k2 I1", "k1 I2", "k2 I2")):
    rng = np.random.default_rng(2)
    cells = tuple(
        CellEstimate(
            "rig", group, None,
            (estimate(rng, "stiffness", 170.0 + 100.0 * (i % 2), 0.01),
             estimate(rng, "damping", 0.05, 0.2, "at_bound" if i == 3 else "ok"),
             estimate(rng, "inertia", 0.036 + 0.034 * (i // 2), 0.02)),
            99.9, 28, 0, "least_squares", "unperturbed_mean",
            response=response(rng, 170.0 + 100.0 * (i % 2), 0.5, 0.036 + 0.034 * (i // 2)),
        )
        for i, group in enumerate(groups)
    )  # fmt: skip
    return StudyAnalysis(cells, settings={"method": "least_squares", "kind": "bench"})


def recommended_cell(rng, cell, *, undecided=()):
    """Return a cell as the recommended method makes it: angle fitted, budget, gravity."""
    joint = {"stiffness": cell.parameter("stiffness").value, "inertia": 0.05}
    joint["damping"] = cell.parameter("damping").value
    rows, budget = [], {}
    for name, value in joint.items():
        parts = rng.uniform(0.5, 1.0, len(SOURCES))
        parts *= (0.4 if name in undecided else 0.05) * value / np.linalg.norm(parts)
        budget[name] = dict(zip(SOURCES, map(float, parts), strict=True))
        half = 0.098 * value
        rows.append(
            ParameterEstimate(name, None, None, None, "undecided", unbounded=value)
            if name in undecided
            else ParameterEstimate(name, value, value - half, value + half, "ok", unbounded=value)
        )
    value = joint["stiffness"]
    shown = response(rng, value, joint["damping"], 0.05)
    return replace(
        cell,
        parameters=tuple(rows),
        budget=budget,
        displacement_rad=float(np.abs(shown.angle).max()),
        centre_gait_pct=cell.onset_gait_pct + 5.0,
        gravity_corrected=ParameterEstimate(
            "stiffness_gravity_corrected",
            value - 10.0,
            0.9 * value - 10.0,
            1.1 * value - 10.0,
            "ok",
        ),
        response=replace(shown, fitted_torque=shown.torque, fitted_angle=1.01 * shown.angle),
    )


def recommended_analysis(people=3, *, seed=5, undecided=((0, "ISW", "stiffness"),)):
    """Return an analysis by the recommended method beside the dissertation's."""
    rng = np.random.default_rng(seed)
    cells, comparison, models = [], [], []
    for i in range(people):
        person, mass = f"S{i + 1:02d}", rng.uniform(55, 90)
        for point in TIMING_POINTS:
            plain = walking_cell(rng, person, mass, point)
            left_open = [n for who, at, n in undecided if (who, at) == (i, point)]
            cell = recommended_cell(rng, plain, undecided=left_open)
            cells.append(cell)
            other = walking_cell(rng, person, mass, point, method="dissertation", bias=0.7)
            off = replace(cell.response, angle=cell.response.angle + 0.02, fitted_angle=None)
            comparison.append(replace(other, response=off))
        models.append(
            ParticipantModel(person, 0.004 + 0.003 * i, 0.001, 1.1, 0.1, 0.02, 0.5, 0.97, 900 + i)
        )
    settings = {"method": "rigid", "baseline": "predicted", "window_s": 0.1,
                "cutoff_hz": 20.0, "resamples": 1000, "seed": 1, "kind": "walking",
                "joint": "knee", "calibration": {}}  # fmt: skip
    walked = [m for i in range(people) for m in mean_strides(np.random.default_rng(i), f"S{i}")]
    return StudyAnalysis(
        tuple(cells), tuple(comparison), population(cells), models=tuple(models), settings=settings,
        mean_strides=tuple(walked),
    )  # fmt: skip


def failed_analysis(code="no_pulses"):
    parameters = tuple(
        ParameterEstimate(name, None, None, None, f"failed:{code}")
        for name in ("stiffness", "damping", "inertia")
    )
    cell = CellEstimate("S01", "LRE", None, parameters, None, 0, 3, "rigid")
    return StudyAnalysis((cell,))


def unperturbed_analysis():
    """Return an analysis of one walker without a device, as that of examples/treadmill_strides."""
    status = "failed:no_perturbed_recording"
    names = ("stiffness", "damping", "inertia", "stiffness_per_mass", "damping_per_mass")
    parameters = tuple(ParameterEstimate(n, None, None, None, status) for n in names)
    cells = tuple(
        CellEstimate("15", p, None, parameters, None, 0, 0, "rigid", "predicted")
        for p in TIMING_POINTS
    )
    strides = tuple(
        StrideRecord("15", "a.csv", "no_device", 1.3 * k, 1.3 + 0.01 * (k % 3), "")
        for k in range(42)
    )
    found = {
        ("LRE", "slope"): (90.0, 12.0, "ok", ""),
        ("LRE", "local_slope"): (80.0, 14.0, "ok", ""),
        ("LRE", "secant"): (-49.0, 9.0, "ok", ""),
        ("TST", "slope"): (181.0, 37.0, "ill_conditioned", "angle_turns"),
        ("TST", "local_slope"): (None, None, "undecided", "no_range"),
        ("TST", "secant"): (-108.0, 14.0, "ok", ""),
    }
    rows = [
        {
            "participant": "15", "side": "right", "timing_point": point,
            "onset_gait_pct": TIMING_POINTS[point], "measure": measure, "value": value,
            "unit": "N*m/rad", "ci_low": None if value is None else value - half,
            "ci_high": None if value is None else value + half, "ci_level": 0.95,
            "r_squared": None, "angle_range_rad": None, "n_strides": 42, "status": own,
            "doubts": doubts,
        }
        for (point, measure), (value, half, own, doubts) in found.items()
    ]  # fmt: skip
    return StudyAnalysis(
        cells,
        strides=strides,
        settings={"method": "rigid", "kind": "walking", "joint": "knee", "window_s": 0.1,
                  "positive": "flexion", "baseline": "predicted", "resamples": 1000, "seed": 0},
        statistics={
            "quasi_stiffness": rows,
            "sampling": [{"participant": "15", "recording": "a.csv", "condition": "no_device",
                          "rate_hz": 100.0}],
        },
        provenance={
            "jointz": "0.1.0",
            "study": {
                "jointz": 1, "joint": "knee", "kind": "walking", "torque_acts_on": "device",
                "channels": {"angle": {"column": "knee"}, "torque": {"column": "KneeMoment"}},
                "participants": [{"id": "15", "mass_kg": 79.4}],
                "recordings": [{"participant": "15", "file": "a.csv", "condition": "no_device"}],
            },
        },
    )  # fmt: skip


def truth_of(analysis, seed=3):
    rng = np.random.default_rng(seed)
    table = analysis.to_frame()
    table = table[table["parameter"].isin(["stiffness", "damping", "inertia"])]
    truth = table["value"] * (1 + 0.08 * rng.standard_normal(len(table)))
    covered = (truth >= table["ci_low"]) & (truth <= table["ci_high"])
    return pd.DataFrame(
        {
            "participant": table["participant"], "timing_point": table["timing_point"],
            "parameter": table["parameter"], "truth": truth, "estimate": table["value"],
            "ci_low": table["ci_low"], "ci_high": table["ci_high"],
            "error_pct": 100 * (table["value"] - truth) / truth, "covered": covered,
        }
    )  # fmt: skip


@pytest.fixture(scope="session")
def walking():
    return walking_analysis()


@pytest.fixture(scope="session")
def recommended():
    return recommended_analysis()


@pytest.fixture(scope="session")
def bench():
    return bench_analysis()


@pytest.fixture(scope="session")
def unperturbed():
    return unperturbed_analysis()


@pytest.fixture(scope="session")
def failed():
    return failed_analysis()


@pytest.fixture(scope="session")
def truth(walking):
    return truth_of(walking)


@pytest.fixture(scope="session")
def walking_figures(walking):
    """The figures of ten people, and the processor time that they took, s."""
    start = time.process_time()
    return draw_figures(walking), time.process_time() - start


@pytest.fixture(scope="session")
def rigid_analysis(small_study_source):
    """The small study as the recommended method analyses it."""
    return jointz.analyze(small_study_source, resamples=50, seed=3)


@pytest.fixture(scope="session")
def rigid_results(rigid_analysis, small_study_source, tmp_path_factory):
    """A folder with the small study and its results; a test that changes them copies it."""
    above = tmp_path_factory.mktemp("rigid")
    shutil.copytree(small_study_source, above / "study")
    rigid_analysis.save(above / "results", figures=False)
    return above


@pytest.fixture(scope="session")
def strapped_results(small_study_source, tmp_path_factory):
    """A folder with the first person of the small study and results of the method strapped."""
    above = tmp_path_factory.mktemp("strapped")
    shutil.copytree(small_study_source, above / "study")
    file = above / "study" / "study.toml"
    blocks = file.read_text().split("[[")
    file.write_text("[[".join(block for block in blocks if '"S02"' not in block))
    made = jointz.analyze(above / "study", method="strapped", resamples=20)
    made.save(above / "results", figures=False)
    return above
