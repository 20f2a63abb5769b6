"""Noise-free responses return K, B and J to 0.1 %: the first kind of truth."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, PerturbationsSpec
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import BENCH, WALKING

STRIDE_S = 1.1  # a whole number of samples at 500, 900 and 1000 Hz
PULSE_S = 0.25
JOINTS = {
    "soft and light": (5.0, 0.3, 0.005),
    "soft and heavy": (5.0, 1.0, 0.4),
    "middling": (50.0, 1.5, 0.05),
    "stiff and light": (500.0, 3.0, 0.005),
    "stiff and heavy": (500.0, 10.0, 0.4),
}
#: Time after the onset (s), width (s) and height (rad) of the bumps of a response.
BUMPS = ((0.055, 0.018, 0.05), (0.11, 0.03, -0.03), (0.30, 0.05, 0.02))


def bump(t: np.ndarray) -> np.ndarray:
    """Return angle, velocity and acceleration of a response, (3, n)."""
    total = np.zeros((3, t.size))
    for centre, width, height in BUMPS:
        z = (t - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


def cycle(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unperturbed angle and torque: they repeat, and no K, B, J joins them."""
    w = 2 * np.pi * t / STRIDE_S
    angle = 0.5 + 0.3 * np.cos(w) + 0.2 * np.sin(2 * w) + 0.05 * np.cos(3 * w + 1.0)
    return angle, 4.0 * np.sin(w + 0.4) - 3.0 * np.cos(2 * w) + 1.5 * np.sin(5 * w)


def onsets(n_strides: int, *, pct: float, rate_hz: float) -> np.ndarray:
    """Return one onset every fourth stride from the sixth on, on a sample."""
    stride = np.arange(6, n_strides - 2, 4)
    return np.round((stride + pct / 100.0) * STRIDE_S * rate_hz) / rate_hz


def walking(
    joint: tuple[float, float, float],
    *,
    rate_hz: float,
    condition: str,
    n_strides: int = 28,
    pct: float = 21.5,
) -> xr.Dataset:
    t = np.arange(round(n_strides * STRIDE_S * rate_hz)) / rate_hz
    angle, torque = cycle(t)
    command = np.zeros(t.size)
    starts = onsets(n_strides, pct=pct, rate_hz=rate_hz) if condition == "perturbed" else []
    for k, onset in enumerate(starts):
        sign = (-1.0) ** k
        response = sign * bump(t - onset)
        angle = angle + response[0]
        torque = torque + np.array(joint) @ response
        command[(t > onset - 0.2 / rate_hz) & (t < onset + PULSE_S)] = 17.0 * sign
    per_stride = round(STRIDE_S * rate_hz)
    contact = np.arange(t.size) % per_stride < 0.6 * per_stride
    return build_recording(
        t,
        {"angle": angle, "torque": torque, "command": command, "contact": contact},
        participant="S01",
        condition=condition,
        file=f"{condition}.csv",
        contact_kind="contact",
    )


def settings(*methods: str, baseline: str | None = None, walking: bool = True, **more):
    return ParticipantSettings(
        kind=WALKING if walking else BENCH,
        perturbations=PerturbationsSpec(baseline=baseline, **more),
        methods=methods,
        n_resamples=40,
        mass_kg=70.0,
        coupling="rigid",
    )


def inputs(*recordings: xr.Dataset) -> list[RecordingInput]:
    return [RecordingInput(r, CalibrationSpec()) for r in recordings]


def assert_finds(cell, joint: tuple[float, float, float]) -> None:
    found = [cell.parameter(n).value for n in ("stiffness", "damping", "inertia")]
    np.testing.assert_allclose(found, joint, rtol=1e-3)
    assert cell.vaf_pct > 99.999
    assert {p.status for p in cell.parameters} == {"ok"}


RATES = pytest.mark.parametrize("rate_hz", [500.0, 900.0, 1000.0])


def pair(joint: tuple[float, float, float], *, rate_hz: float, pct: float = 21.5):
    return [
        walking(joint, rate_hz=rate_hz, condition=c, pct=pct) for c in ("unperturbed", "perturbed")
    ]


@RATES
@pytest.mark.parametrize(
    ("joint", "pct"),
    [
        *((joint, 21.5) for joint in JOINTS.values()),
        *((JOINTS["middling"], p) for p in (7, 56, 81)),
    ],
)
def test_pulses_of_both_signs_on_a_repeating_cycle_return_the_joint(joint, pct, rate_hz):
    recordings = pair(joint, rate_hz=rate_hz, pct=pct)

    result = analyze_participant(
        "S01", inputs(*recordings), settings("dissertation", "matched_strides")
    )

    for method in ("dissertation", "matched_strides"):
        (cell,) = result.cells[method]
        assert (cell.n_used, cell.n_excluded) == (5, 0)
        assert_finds(cell, joint)


@pytest.mark.parametrize(("own_hz", "other_hz"), [(1000.0, 500.0), (500.0, 1000.0)])
def test_an_unperturbed_recording_of_another_rate_serves_as_baseline(own_hz, other_hz):
    joint = JOINTS["middling"]
    unperturbed = walking(joint, rate_hz=other_hz, condition="unperturbed")
    perturbed = walking(joint, rate_hz=own_hz, condition="perturbed")

    result = analyze_participant("S01", inputs(unperturbed, perturbed), settings("dissertation"))

    found = [p.value for p in result.cells["dissertation"][0].parameters[:3]]
    # Between samples signals are interpolated linearly, which costs a little.
    np.testing.assert_allclose(found, joint, rtol=5e-3)


@RATES
@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS.keys())
def test_motion_integrated_by_scipy_returns_the_joint(joint, rate_hz):
    """Physics that shares nothing with jointz: an adaptive eighth-order integrator.

    The level before a pulse is baseline enough for a quiet record.
    """
    K, B, J = joint
    n = round(4.25 * rate_hz)
    t = np.arange(n) / rate_hz
    starts = np.array([0.5, 1.75, 3.0])
    signs = np.array([1.0, -1.0, 1.0])

    def torque(s):
        z = (np.asarray(s)[..., None] - starts - 0.05) / 0.02
        return 7.0 * (signs * np.exp(-(z**2) / 2)).sum(axis=-1)

    def motion(s, x):
        return [x[1], (torque(s) - B * x[1] - K * x[0]) / J]

    solution = solve_ivp(
        motion, (0, t[-1]), [1e-3, 0], "DOP853", t, rtol=1e-11, atol=1e-13, max_step=0.01
    )
    command = sum(
        17 * s * ((t >= a - 1e-9) & (t < a + 0.2)) for a, s in zip(starts, signs, strict=True)
    )
    recording = build_recording(
        t,
        {"angle": 0.7 + solution.y[0], "torque": torque(t) - 3.0, "command": command},
        participant="S01",
        condition="perturbed",
        file="bench.csv",
    )
    # The second pulse meets a joint that may still swing: the whole record is the response.
    result = analyze_participant(
        "S01", inputs(recording), settings("pre_pulse", baseline="pre_pulse", walking=False)
    )

    assert_finds(result.cells["pre_pulse"][0], joint)


def test_two_sessions_with_cycles_of_their_own_are_each_their_own_baseline():
    joint = JOINTS["middling"]
    recordings = []
    for session, offset in (("1", 0.0), ("2", 0.3)):
        for recording in pair(joint, rate_hz=500.0):
            moved = recording.assign(
                angle=recording["angle"] + offset, torque=recording["torque"] - 10 * offset
            )
            recordings.append(
                moved.assign_attrs(session=session, file=f"{recording.condition}{session}.csv")
            )

    result = analyze_participant(
        "S01", inputs(*recordings), settings("dissertation", "matched_strides")
    )

    for method in ("dissertation", "matched_strides"):
        assert [cell.session for cell in result.cells[method]] == ["1", "2"]
        for cell in result.cells[method]:
            assert cell.n_used == 5
            assert_finds(cell, joint)


STUDY = """
jointz = 1
joint = "knee"
kind = "walking"
coupling = "rigid"
torque_acts_on = "device"
[channels.time]
column = "t"
unit = "ms"
[channels.angle]
column = "knee"
unit = "deg"
positive = "extension"
[channels.torque]
column = "tau"
unit = "N*m"
[channels.command]
column = "cmd"
[channels.contact]
column = "foot"
kind = "contact"
[[participants]]
id = "S01"
mass_kg = 70
[[recordings]]
participant = "S01"
condition = "NPC"
file = "unperturbed.csv"
[[recordings]]
participant = "S01"
condition = "EWP"
file = "perturbed.csv"
"""


def test_files_in_the_units_of_a_lab_return_the_joint_through_the_command(jointz, tmp_path):
    joint = JOINTS["middling"]
    study = tmp_path / "study"
    study.mkdir()
    (study / "study.toml").write_text(STUDY)
    for recording in pair(joint, rate_hz=900.0):
        write_lab_file(recording, study)

    out = tmp_path / "results"
    more = ("--resamples", 40, "--method", "dissertation", "--no-figures", "--json")
    outcome = jointz("analyze", study, "--out", out, *more)

    assert outcome.code == 0
    table = pd.read_csv(out / "estimates.csv").query("timing_point == 'MST'")
    values = table.set_index("parameter")["value"]
    names = ["stiffness", "damping", "inertia", "stiffness_per_mass", "damping_per_mass"]
    truth = [*joint, joint[0] / 70.0, joint[1] / 70.0]
    np.testing.assert_allclose(values[names], truth, rtol=1e-3)
    assert set(table["n_used"]) == {5}


def write_lab_file(recording: xr.Dataset, folder: Path) -> None:
    pd.DataFrame(
        {
            "t": 1e3 * recording["time"].to_numpy(),
            "knee": -np.rad2deg(recording["angle"].to_numpy()),
            "tau": -recording["torque"].to_numpy(),
            "cmd": recording["command"].to_numpy(),
            "foot": recording["contact"].to_numpy(),
        }
    ).to_csv(folder / recording.attrs["file"], index=False)
