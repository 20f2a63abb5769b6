"""What jointz inspect proposes for every real recording: at most three edits, or why it cannot."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from jointz.analysis.analyze import analyze
from jointz.core.errors import DataError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

pytestmark = pytest.mark.real_data

MOST_EDITS = 3
TABLES = (".csv", ".csv.gz", ".txt", ".mat")
ANGLE = re.compile(r"# \[channels\.angle\].*\n# column.*\n# unit.*\n")
TORQUE = re.compile(r"# \[channels\.torque\].*\n# column.*\n# unit.*\n")


@dataclass(frozen=True)
class Case:
    """What a proposal needs: edits to run, or what it says where it cannot."""

    edits: tuple[tuple[str | re.Pattern[str], str], ...] = ()
    cannot: tuple[str, ...] = ()
    advice: str = ""
    taken: tuple[str, ...] = ()  # channel=column


ACTUATOR = ("time=loop_time", "command=motor_torque_command", "torque=adc_measured_torque",
            "current=motor_measured_current", "motor_velocity=motor_measured_speed")  # fmt: skip
NO_ANGLE = ("no column holds the joint's angle (it is a log of the actuator only)",)
STIFF = ("time=time_s", "angle=position_rad", "torque=torque_Nm")

CASES = {
    "reklab_ankle/z_df.csv.gz": Case(taken=STIFF),
    "reklab_ankle/z_df3.csv.gz": Case(taken=STIFF),
    "reklab_ankle/z_pf.csv.gz": Case(taken=STIFF),
    "reklab_ankle/tv_pilot_PT1_UT2.csv.gz": Case(
        taken=("angle=position_perturbation_rad", "torque=torque_response_Nm")
    ),
    "moore2015_walk/UnpertPre_data.csv": Case(
        taken=(
            "angle=RightKneeFlexionAngle",
            "torque=RightKneeFlexionMoment",
            "ground_reaction_force=RightGRF_y",
            "time=time",
        )
    ),
    "moore2015_walk/UnpertPre__event.csv": Case(
        cannot=("times of events",), advice="perturbations"
    ),
    "moore2015_walk/SubjectInfo.csv": Case(cannot=("one row about a person",), advice="mass_kg"),
    "gaitanalysistoolkit/example_vertical_grf.csv": Case(
        cannot=("no column holds the joint's angle", "no column holds a torque"),
        taken=("time=1", "ground_reaction_force=2"),
    ),
    "gaitanalysistoolkit/treadmill-speed.csv": Case(
        cannot=("no column holds the joint's angle",), taken=("time=1",)
    ),
    "gaitanalysistoolkit/rawdata.txt": Case(
        cannot=("inverse kinematics",), taken=("time=% TimeStamp", "ground_reaction_force=FP2.ForY")
    ),
    "gaitanalysistoolkit/refresults.mat": Case(
        edits=(
            ("# sample_rate_hz = 1000.0", "sample_rate_hz = 100.0"),
            (ANGLE, '[channels.angle]\ncolumn = "refresults.2"\n'),
            (TORQUE, '[channels.torque]\ncolumn = "refresults.8"\n'),
        ),
        cannot=("its columns have no names",),
    ),
    "winter_normal/winter_normal_tidy.csv": Case(
        cannot=("one mean over the cycle, 51 points",),
        advice="quasi_stiffness",
        taken=("angle=knee_angle_deg", "torque=knee_moment_Nm_per_kg"),
    ),
    "dissertation/knee_impedance_60.csv": Case(
        cannot=("table of estimates",), advice="jointz compare"
    ),
    "tmotor_bench/SysID/system_id_test_1/log_adc_and_motor.csv": Case(
        cannot=NO_ANGLE, advice="identify actuator", taken=ACTUATOR
    ),
    "tmotor_bench/torque_vary_with_angle/synchronized_trial_8/test-opposing-motor.csv": Case(
        cannot=NO_ANGLE, advice="identify actuator", taken=ACTUATOR
    ),
    "tmotor_bench/torque_vary_with_angle/synchronized_trial_8/log_mitry_dephy.csv": Case(
        cannot=("its columns have no names",), taken=("time=1",)
    ),
    "tmotor_bench/current_fixed/fixing_current_limit_issue/current_comp_test_6.csv": Case(
        cannot=(*NO_ANGLE, "-5.382e+04 is no possible reading"), taken=ACTUATOR
    ),
    "tmotor_bench/no_torque_tests/pre-calibration/log_adc_and_motor_no_torque_3.csv": Case(
        cannot=(*NO_ANGLE, "-2.742e+16 is no possible reading"), taken=ACTUATOR
    ),
    "tmotor_bench/sys_ID_final/trial8.csv": Case(
        cannot=NO_ANGLE,
        advice="identify actuator",
        taken=("time=1", "command=2", "torque=3", "current=5", "motor_velocity=6"),
    ),
}


def proposed(real_data: Path, name: str, folder: Path):
    """Inspect a file and write its proposal, with the edits of its case, beside a copy."""
    source = real_data / name
    found = inspect_file(source)
    shutil.copy(source, folder / source.name)
    text = found.toml
    for old, new in CASES[name].edits:
        changed = old.sub(new, text) if isinstance(old, re.Pattern) else text.replace(old, new)
        assert changed != text
        text = changed
    (folder / "study.toml").write_text(text)
    return found


@pytest.fixture(params=CASES)
def name(request: pytest.FixtureRequest, real_data: Path) -> str:
    if not (real_data / request.param).is_file():
        pytest.skip(f"absent: {request.param}")
    return request.param


def test_every_recording_has_a_case(real_data):
    there = {
        str(path.relative_to(real_data))
        for path in real_data.rglob("*")
        if path.name.endswith(TABLES) and not path.name.startswith("LICENSE")
    }

    assert there - set(CASES) == set()


def test_a_proposal_runs_after_few_edits_or_says_why_it_cannot(name, real_data, tmp_path):
    case = CASES[name]

    found = proposed(real_data, name, tmp_path)

    assert len(case.edits) <= MOST_EDITS
    said = " ".join(found.obstacles)
    assert [reason for reason in case.cannot if reason not in said] == []
    assert all(f"# Cannot be analysed as it is: {why}" in found.toml for why in found.obstacles)
    if case.cannot and not case.edits:
        assert case.advice in " ".join(found.advice)
        with pytest.raises(DataError):
            open_study(tmp_path)
        return
    assert bool(found.obstacles) is bool(case.edits)
    study = open_study(tmp_path)
    (recording,) = read_recording(study, study.spec.recordings[0])
    assert {"angle", "torque"} <= set(recording)


def test_columns_are_taken_for_what_they_are(name, real_data):
    found = inspect_file(real_data / name)

    taken = {f"{c.channel}={c.column}" for c in found.channels if c.channel}

    assert set(CASES[name].taken) - taken == set()


def test_the_proposal_for_pulses_on_a_moving_ankle_gives_its_stiffness(real_data, tmp_path):
    proposed(real_data, "reklab_ankle/tv_pilot_PT1_UT2.csv.gz", tmp_path)

    (cell,) = analyze(open_study(tmp_path), resamples=20, method="dissertation").cells

    # 17 to 96 N*m/rad over the range of the ankle; all pulses together lie between.
    assert 17.0 < cell.parameter("stiffness").value < 96.0
    assert cell.parameter("inertia").value == pytest.approx(0.018, abs=0.003)
    assert cell.n_used > 300


def test_the_proposal_for_a_stationary_ankle_gives_its_stiffness(real_data, tmp_path):
    found = proposed(real_data, "reklab_ankle/z_df.csv.gz", tmp_path)

    (cell,) = analyze(open_study(tmp_path), resamples=20, method="dissertation").cells

    assert cell.parameter("stiffness").value == pytest.approx(104.0, abs=6.0)
    assert 'torque_acts_on = "device"  # guess: the torque opposes the angle' in found.toml


def test_the_gaps_of_real_walking_are_told(real_data):
    found = inspect_file(real_data / "moore2015_walk" / "UnpertPre_data.csv")

    (clock,) = found.clocks
    assert len(clock.gaps) == 15
    assert "the longest 137 ms at 30.6787 s" in found.summary()
    assert found.channel("angle").unit_is == "guessed"
    assert found.channel("angle").unit == "rad"
