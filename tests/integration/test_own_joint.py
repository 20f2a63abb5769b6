"""Other joints than the knee, other devices, one participant, and nobody perturbed.

The truth of a joint at rest is a second-order system solved by scipy; walkers are those of
:mod:`jointz.rig.sim`. Neither shares anything with :mod:`jointz.identify`.
"""

import html
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lsim

from jointz.analysis.analyze import analyze
from jointz.core.errors import StudyError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.study_reader import open_study
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import QUICK_GRID, WALKING_PULSE, WalkPlan, walk_directly
from jointz.rig.sim.rig import simulated_rig

RATE_HZ = 500.0
QUICK = ("--resamples", 50, "--no-figures", "--workers", 1)
PARAMETERS = ("stiffness", "damping", "inertia")


# --- simulated recordings ------------------------------------------------------------------------


def at_rest(joint, rng, *, pulse_nm, noise_rad=2e-4):
    """Return 35 s of pulses of either sign on a joint at rest: time, angle, torque, command."""
    stiffness, damping, inertia = joint
    time = np.arange(round(35.0 * RATE_HZ)) / RATE_HZ
    command = np.zeros(time.size)
    onsets = np.arange(2.0, 33.0, 1.7) + rng.uniform(0.0, 0.4, 19)
    for k, onset in enumerate(onsets):
        command[(time >= onset) & (time < onset + 0.3)] = pulse_nm * (-1.0) ** k
    # A motor does not step: first order, 5 ms.
    _, torque, _ = lsim(([1.0], [0.005, 1.0]), command, time)
    _, angle, _ = lsim(([1.0], [inertia, damping, stiffness]), torque, time)
    return time, angle + noise_rad * rng.standard_normal(time.size), torque, command


def words_of(report) -> str:
    """Return what a reader reads: no tags, no styles, no drawings."""
    page = re.sub(r"(?s)<(style|svg|script)\b.*?</\1>", " ", report.read_text(encoding="utf-8"))
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", page)))


def written(study, head, participants, recordings):
    """Write a study.toml."""
    lines = [head]
    lines += [f'[[participants]]\nid = "{name}"\n{more}' for name, more in participants.items()]
    lines += [f"[[recordings]]\n{text}" for text in recordings]
    (study / "study.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return study


# --- joints at rest ------------------------------------------------------------------------------

ANKLE = {
    ("A", "relaxed"): (35.0, 0.55, 0.018),
    ("A", "contracted"): (110.0, 1.4, 0.018),
    ("B", "relaxed"): (48.0, 0.8, 0.021),
    ("B", "contracted"): (95.0, 1.6, 0.021),
}
ANKLE_HEAD = """jointz = 1
joint = "right ankle"
kind = "bench"
subjects = "people"
positive = "dorsiflexion"
torque_acts_on = "device"
channels.time = { column = "t", unit = "s" }
channels.angle = { column = "foot_deg", unit = "deg" }
channels.torque = { column = "cell_Nm", unit = "N*m" }
channels.command = { column = "cmd_Nm", unit = "N*m" }
calibration.angle_lag_s = { value = 0.0, sd = 0.0003 }
calibration.torque_lag_s = { value = 0.0, sd = 0.0003 }
"""


@pytest.fixture(scope="module")
def ankles_source(tmp_path_factory):
    study = tmp_path_factory.mktemp("ankles")
    rng = np.random.default_rng(3)
    recordings = []
    for (person, case), joint in ANKLE.items():
        time, angle, torque, command = at_rest(joint, rng, pulse_nm=4.0)
        table = {"t": time, "foot_deg": np.degrees(angle), "cell_Nm": -torque, "cmd_Nm": command}
        pd.DataFrame(table).round(6).to_csv(study / f"{person}_{case}.csv", index=False)
        recordings.append(
            f'participant = "{person}"\nsession = "{case}"\ncondition = "perturbed"\n'
            f'file = "{person}_{case}.csv"'
        )
    return written(study, ANKLE_HEAD, {"A": "mass_kg = 70.0", "B": ""}, recordings)


@pytest.fixture
def ankles(ankles_source, tmp_path):
    return shutil.copytree(ankles_source, tmp_path / "ankles")


def test_two_ankles_relaxed_and_contracted_come_back_under_their_own_names(
    jointz, ankles, tmp_path
):
    assert jointz("analyze", ankles, "--out", tmp_path / "r", *QUICK).code == 0

    table = pd.read_csv(tmp_path / "r" / "estimates.csv")
    assert set(table["status"]) == {"ok"}
    table = table.set_index(["participant", "timing_point", "parameter"])
    held = []
    for (person, case), joint in ANKLE.items():
        truth = np.array(joint)
        found = table.loc[(person, case)].loc[list(PARAMETERS)]
        # Of a stiff joint the damping is known to a tenth only: its interval says so.
        np.testing.assert_allclose(found["value"].iloc[[0, 2]], truth[[0, 2]], rtol=0.05)
        held += list(found["ci_low"].le(truth) & found["ci_high"].ge(truth))
    assert sum(held) >= 10  # of 12, at 95 %
    means = pd.read_csv(tmp_path / "r" / "population.csv")
    mean = means.set_index(["timing_point", "parameter"]).loc[("relaxed", "stiffness")]
    assert mean["status"] == "failed:too_few_participants"  # two people are no mean
    assert mean["n_participants"] == 2
    told = words_of(tmp_path / "r" / "report.html").split("Settings")[0]
    assert re.search(r"\b(knee|load|loads|trajectory|thigh|shank)\b", told) is None


def test_means_over_people_are_made_and_those_over_loads_are_not(ankles):
    file = ankles / "study.toml"
    file.write_text(file.read_text().replace('subjects = "people"', ""))

    assert analyze(ankles, resamples=2).population == ()


def test_loads_that_walk_and_directions_of_two_planes_are_refused(ankles):
    file = ankles / "study.toml"
    text = file.read_text()
    for place, changes in (
        ("subjects", [('"bench"', '"walking"'), ('"people"', '"loads"')]),
        (
            "adduction",
            [('"dorsiflexion"', '"abduction"'), ('"deg"', '"deg", positive = "extension"')],
        ),
    ):
        spoilt = text
        for old, new in changes:
            spoilt = spoilt.replace(old, new)
        file.write_text(spoilt)
        with pytest.raises(StudyError, match=place):
            open_study(ankles)


WRIST = {"flexed": (1.6, 0.022, 0.0021), "neutral": (1.1, 0.018, 0.0021)}
WRIST_HEAD = """jointz = 1
joint = "wrist"
kind = "bench"
subjects = "people"
positive = "radial_deviation"
channels.time = { column = "t", unit = "s" }
channels.angle = { column = "hand", unit = "rad", positive = "ulnar_deviation" }
channels.torque = { column = "tau", unit = "mN*m" }
channels.command = { column = "cmd", unit = "mN*m" }
channels.flexion_angle = { column = "flex", unit = "deg" }
[perturbations]
baseline = "pre_pulse"
cutoff_hz = 40.0
group = { channel = "flexion_angle", edges = [-10.0, 20.0, 60.0], unit = "deg" }
"""


def test_a_wrist_is_grouped_by_posture_and_its_ulnar_sensor_is_turned(tmp_path):
    study = tmp_path / "wrist"
    study.mkdir()
    rng = np.random.default_rng(5)
    parts = []
    for flexion_deg, joint in ((40.0, WRIST["flexed"]), (0.0, WRIST["neutral"])):
        time, angle, torque, command = at_rest(joint, rng, pulse_nm=0.15)
        start = parts[-1]["t"].iloc[-1] + 1.0 / RATE_HZ if parts else 0.0
        columns = {"t": time + start, "hand": -angle, "tau": 1e3 * torque, "cmd": 1e3 * command}
        parts.append(pd.DataFrame(columns).assign(flex=flexion_deg))
    pd.concat(parts).round(6).to_csv(study / "w.csv", index=False)
    written(
        study, WRIST_HEAD, {"W": ""}, ['participant = "W"\ncondition = "perturbed"\nfile = "w.csv"']
    )

    table = by_cell(analyze(study, resamples=50))
    groups = list(dict.fromkeys(point for point, _ in table.index))
    for group, case in zip(groups, ("neutral", "flexed"), strict=True):
        found = [table.loc[(group, name), "value"] for name in PARAMETERS]
        np.testing.assert_allclose(found, WRIST[case], rtol=0.03)


# --- walkers: another joint, and a device that acts the other way --------------------------------

POINTS = {"MST": 21.5, "PSW": 56.0, "MSW": 81.0}
AS_RECORDED = """jointz = 1
joint = "{joint}"
kind = "walking"
coupling = "rigid"
positive = "{positive}"
torque_acts_on = "{side}"
channels.time = {{ column = "t", unit = "s" }}
channels.angle = {{ column = "angle", unit = "rad"{own} }}
channels.torque = {{ column = "torque", unit = "N*m"{own} }}
channels.command = {{ column = "command", unit = "N*m"{own} }}
channels.contact = {{ column = "contact" }}
[perturbations]
timing_points = {{ MST = 21.5, PSW = 56.0, MSW = 81.0 }}
[calibration]
angle_lag_s = {{ value = {lag_s}, sd = 0.0005 }}
"""


@pytest.fixture(scope="module")
def walk():
    """Return the signals of a walker whose torque was measured, and the truth."""
    rig = simulated_rig(2)
    rig.grid = QUICK_GRID
    plan = WalkPlan(per_point=15, timing_points=POINTS)
    walked = walk_directly(rig, "perturbed", plan=plan)
    truth = rig.truth(
        "perturbed",
        worn=True,
        stretches=[Stretch(0, 0.0, walked.end_s)],
        pulses=walked.pulses,
        shapes={"": WALKING_PULSE},
    )
    actuator = rig.preset.actuator
    given = walked.channels
    velocity = given["motor_velocity"]
    friction = actuator.coulomb_friction + actuator.gear_friction * np.abs(given["current"])
    torque = (
        actuator.gear_ratio * actuator.torque_constant * given["current"]
        - friction * np.tanh(velocity / actuator.sign_velocity_rad_s)
        - actuator.rotor_inertia * np.gradient(velocity, walked.time_s)
    )
    table = {"t": walked.time_s, "angle": given["angle"], "torque": torque}
    table |= {"command": given["command"], "contact": given["contact"]}
    return pd.DataFrame(table).round(5), truth


def walking_study(
    folder, walk, *, joint="hip", positive="abduction", side="joint", turned=(), own=""
):
    """Write the walk as a device with its own signs would have recorded it."""
    table, truth = walk
    folder.mkdir()
    table.assign(**{name: -table[name] for name in turned}).to_csv(
        folder / "w.csv", index=False, float_format="%.5f"
    )
    head = AS_RECORDED.format(
        joint=joint,
        positive=positive,
        side=side,
        own=f', positive = "{own}"' if own else "",
        lag_s=truth["instruments"]["angle_lag_s"],
    )
    entry = 'participant = "S"\ncondition = "perturbed"\nfile = "w.csv"'
    return written(folder, head, {"S": "mass_kg = 70.0"}, [entry])


def by_cell(analysis) -> pd.DataFrame:
    """Return the estimates by timing point and parameter."""
    return analysis.to_frame().set_index(["timing_point", "parameter"])


def test_an_abduction_device_at_the_hip_finds_the_joint_whatever_its_own_directions(
    jointz, walk, tmp_path
):
    signed = ("angle", "torque", "command")
    turned = walking_study(tmp_path / "turned", walk, turned=signed, own="adduction")
    pushed = walking_study(tmp_path / "pushed", walk, side="device", turned=("torque",))

    assert jointz("analyze", turned, "--out", tmp_path / "r", *QUICK).code == 0

    hip = pd.read_csv(tmp_path / "r" / "estimates.csv").set_index(["timing_point", "parameter"])
    pd.testing.assert_frame_equal(
        by_cell(analyze(pushed, resamples=50))[["value", "ci_low", "ci_high"]].astype(float),
        hip[["value", "ci_low", "ci_high"]],
        rtol=1e-6,
    )
    held = [
        row["ci_low"] <= truth[name] <= row["ci_high"]
        for point, truth in walk[1]["timing_points"].items()
        for name in PARAMETERS
        if (row := hip.loc[(point, name)])["status"] == "ok"
    ]
    assert len(held) >= 6
    assert sum(held) >= len(held) - 1
    assert re.search(r"\bknee\b", words_of(tmp_path / "r" / "report.html")) is None
    # Of an abducted leg nobody knows how it hangs.
    details = pd.read_csv(tmp_path / "r" / "details.csv")
    assert details["stiffness_gravity_corrected"].isna().all()


def test_a_device_with_its_sign_wrong_is_found_out(walk, tmp_path):
    study = walking_study(tmp_path / "s", walk, side="device")

    assert set(by_cell(analyze(study, resamples=2))["status"]) == {"failed:opposite_sign"}


# --- one participant -----------------------------------------------------------------------------


def test_one_participant_has_intervals_of_its_own_and_none_over_people(jointz, walk, tmp_path):
    study = walking_study(tmp_path / "s", walk, joint="knee", positive="flexion")

    assert jointz("analyze", study, "--out", tmp_path / "r", *QUICK).code == 0

    own = pd.read_csv(tmp_path / "r" / "estimates.csv").query("status == 'ok'")
    assert own[["ci_low", "ci_high"]].notna().all(axis=None)
    over_people = pd.read_csv(tmp_path / "r" / "population.csv")
    assert set(over_people["status"]) == {"failed:too_few_participants"}
    assert over_people[["value", "ci_low", "ci_high", "sd"]].isna().all(axis=None)
    details = pd.read_csv(tmp_path / "r" / "details.csv")
    assert details["stiffness_gravity_corrected"].notna().any()


# --- motion capture and inverse dynamics, no device ----------------------------------------------

QUASI = 150.0  # N*m/rad, of a joint whose moment follows its angle
MOCAP_HEAD = """jointz = 1
joint = "knee"
kind = "walking"
positive = "flexion"
torque_acts_on = "{side}"
channels.time = {{ column = "t", unit = "s" }}
channels.angle = {{ column = "knee_deg", unit = "deg" }}
channels.torque = {{ column = "moment_Nm", unit = "N*m" }}
channels.ground_reaction_force = {{ column = "fz_N", unit = "N" }}
"""


def mocap(folder, *, side):
    """Write 50 s of motion capture at 100 Hz, the internal flexion moment of each knee."""
    folder.mkdir()
    rng = np.random.default_rng(11)
    recordings = []
    for leg, scale in (("left", 1.0), ("right", 0.8)):
        strikes = np.cumsum(np.append(0.4, rng.normal(1.1, 0.02, 45)))
        time = np.arange(round(100 * (strikes[-1] + 0.3))) / 100.0
        phase = np.interp(time, strikes, np.arange(strikes.size)) * 2 * np.pi
        size = np.interp(time, strikes, rng.normal(1.0, 0.03, strikes.size))
        angle = 0.45 - 0.35 * size * np.cos(phase) - 0.15 * np.sin(2 * phase)
        moment = -scale * QUASI * (angle - 0.2) + rng.normal(0.0, 2.0, time.size)
        force = np.where((phase / (2 * np.pi)) % 1.0 < 0.62, 700.0, 0.0) * (time > strikes[0])
        table = {"t": time, "knee_deg": np.degrees(angle), "moment_Nm": moment, "fz_N": force}
        pd.DataFrame(table).round(4).to_csv(folder / f"{leg}.csv", index=False)
        recordings.append(
            f'participant = "M"\ncondition = "no_device"\nside = "{leg}"\nfile = "{leg}.csv"'
        )
    return written(folder, MOCAP_HEAD.format(side=side), {"M": "mass_kg = 80.0"}, recordings)


def test_motion_capture_without_a_device_gives_quasi_stiffness_only(jointz, tmp_path):
    study = mocap(tmp_path / "s", side="device")

    outcome = jointz("analyze", study, "--out", tmp_path / "r", *QUICK, "--tables")

    assert outcome.code == 1
    table = pd.read_csv(tmp_path / "r" / "quasi_stiffness.csv")
    slopes = table.query("measure == 'slope'").set_index(["side", "timing_point"])
    assert len(slopes) == 2 * len(TIMING_POINTS)
    for (leg, _), row in slopes.iterrows():
        truth = QUASI * (1.0 if leg == "left" else 0.8)
        if row["angle_range_rad"] > 0.15:
            assert row["value"] == pytest.approx(truth, rel=0.05)
        assert row["ci_low"] < row["value"] < row["ci_high"]
        assert row["n_strides"] >= 40
    held = [
        row["ci_low"] <= QUASI * (1.0 if leg == "left" else 0.8) <= row["ci_high"]
        for (leg, _), row in slopes.iterrows()
    ]
    assert sum(held) >= 10  # of 12, at 95 %
    assert not pd.read_csv(tmp_path / "r" / "estimates.csv")["value"].notna().any()
    printed = pd.read_csv(tmp_path / "r" / "tables" / "quasi_stiffness.csv")
    assert len(printed) == 2 * len(TIMING_POINTS)
    assert not (tmp_path / "r" / "tables" / "estimates.csv").exists()


def test_an_internal_moment_taken_for_an_external_one_turns_the_quasi_stiffness(tmp_path):
    found = analyze(mocap(tmp_path / "s", side="joint"))

    table = pd.DataFrame(found.statistics["quasi_stiffness"])
    assert (table.query("measure == 'slope'")["value"] < -100.0).all()


def test_without_a_moment_strides_are_all_there_is(tmp_path):
    study = mocap(tmp_path / "s", side="device")
    file = study / "study.toml"
    lines = [line for line in file.read_text().splitlines() if "moment_Nm" not in line]
    file.write_text("\n".join(lines) + "\n")

    found = analyze(study)

    assert not found.statistics.get("quasi_stiffness")
    assert len(found.strides) > 80
