"""What jointz inspect proposes for every real recording: at most three edits, or why it cannot."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.unit.inspection.answers import answered

from jointz.analysis.analyze import analyze
from jointz.core.errors import DataError
from jointz.inspection.inspect_file import inspect_file
from jointz.io.recordings import read_recording
from jointz.io.study_reader import open_study

pytestmark = pytest.mark.real_data

MOST_EDITS = 3
TABLES = (".csv", ".csv.gz", ".txt", ".mat")
ANGLE = re.compile(r"\[channels\.angle\]\ncolumn = \"\?\".*\n# unit.*\n")
TORQUE = re.compile(r"\[channels\.torque\]\ncolumn = \"\?\".*\n# unit.*\n")


@dataclass(frozen=True)
class Case:
    """What a proposal takes (channel=column), edits that it needs, whether it cannot be run."""

    taken: tuple[str, ...] = ()
    edits: tuple[tuple[str | re.Pattern[str], str], ...] = ()
    cannot: bool = False


ACTUATOR = ("time=loop_time", "command=motor_torque_command", "torque=adc_measured_torque",
            "current=motor_measured_current", "motor_velocity=motor_measured_speed")  # fmt: skip
STIFF = ("time=time_s", "angle=position_rad", "torque=torque_Nm")
MOORE = ("time=time", "angle=RightKneeFlexionAngle", "torque=RightKneeFlexionMoment",
         "ground_reaction_force=RightGRF_y")  # fmt: skip
UNNAMED = ("time=1", "command=2", "torque=3", "current=5", "motor_velocity=6")
OF_MATRIX = (
    (re.compile(r'sample_rate_hz = "\?".*'), "sample_rate_hz = 100.0"),
    (ANGLE, '[channels.angle]\ncolumn = "refresults.2"\n'),
    (TORQUE, '[channels.torque]\ncolumn = "refresults.8"\n'),
)
TOOLKIT, BENCH = "gaitanalysistoolkit", "tmotor_bench"
#: What is no recording of a joint has no edit that would make it one.
CASES = {
    "reklab_ankle/z_df.csv.gz": Case(STIFF),
    "reklab_ankle/z_df3.csv.gz": Case(STIFF),
    "reklab_ankle/z_pf.csv.gz": Case(STIFF),
    "reklab_ankle/tv_pilot_PT1_UT2.csv.gz": Case(
        ("angle=position_perturbation_rad", "torque=torque_response_Nm")
    ),
    "moore2015_walk/UnpertPre_data.csv": Case(MOORE),
    "moore2015_walk/UnpertPre__event.csv": Case(cannot=True),
    "moore2015_walk/SubjectInfo.csv": Case(cannot=True),
    f"{TOOLKIT}/example_vertical_grf.csv": Case(("time=1", "ground_reaction_force=2"), cannot=True),
    f"{TOOLKIT}/treadmill-speed.csv": Case(("time=1",), cannot=True),
    f"{TOOLKIT}/rawdata.txt": Case(
        ("time=% TimeStamp", "ground_reaction_force=FP2.ForY"), cannot=True
    ),
    f"{TOOLKIT}/refresults.mat": Case(edits=OF_MATRIX),
    "winter_normal/winter_normal_tidy.csv": Case(
        ("angle=knee_angle_deg", "torque=knee_moment_Nm_per_kg"), cannot=True
    ),
    "dissertation/knee_impedance_60.csv": Case(cannot=True),
    f"{BENCH}/SysID/system_id_test_1/log_adc_and_motor.csv": Case(ACTUATOR, cannot=True),
    f"{BENCH}/torque_vary_with_angle/synchronized_trial_8/test-opposing-motor.csv": Case(
        ACTUATOR, cannot=True
    ),
    f"{BENCH}/torque_vary_with_angle/synchronized_trial_8/log_mitry_dephy.csv": Case(
        ("time=1",), cannot=True
    ),
    f"{BENCH}/current_fixed/fixing_current_limit_issue/current_comp_test_6.csv": Case(
        ACTUATOR, cannot=True
    ),
    f"{BENCH}/no_torque_tests/pre-calibration/log_adc_and_motor_no_torque_3.csv": Case(
        ACTUATOR, cannot=True
    ),
    f"{BENCH}/sys_ID_final/trial8.csv": Case(UNNAMED, cannot=True),
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
    # Its torque is that of the ankle on a stiff motor.
    side = "device" if name.startswith("reklab") else "joint"
    (folder / "study.toml").write_text(answered(text, torque_acts_on=side))
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

    taken = {f"{c.channel}={c.column}" for c in found.channels if c.channel}
    assert set(case.taken) <= taken
    assert len(case.edits) <= MOST_EDITS
    assert bool(found.obstacles) is (case.cannot or bool(case.edits))
    assert all(why in found.toml for why in found.obstacles)
    if case.cannot:
        with pytest.raises(DataError):
            open_study(tmp_path)
        return
    study = open_study(tmp_path)
    (recording,) = read_recording(study, study.spec.recordings[0])
    assert {"angle", "torque"} <= set(recording)


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
    assert 'torque_acts_on = "?"' in found.toml
