"""``jointz identify actuator`` and ``bandwidth``."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import butter, lfilter


@pytest.fixture
def bench(tmp_path, actuator_table):
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(actuator_table))
    path = tmp_path / "bench.csv"
    table = actuator_table[["t", "i", "w"]].assign(tau=-(actuator_table["torque"] + noise))
    table.to_csv(path, index=False)
    return path


COLUMNS = ("--current", "i", "--velocity", "w", "--torque", "tau:Nm", "--gear-ratio", 9)
TURNED = ("--torque-sign", "-1")


def test_json_holds_the_parameters_of_design_and_the_error(jointz, bench):
    figure = bench.with_name("fit.svg")
    outcome = jointz("identify", "actuator", bench, *COLUMNS, *TURNED, "--json", "--figure", figure)

    assert outcome.code == 0
    assert figure.stat().st_size > 1000
    found = outcome.json
    assert found["model"] == "friction"
    assert found["rms_error_nm"] == pytest.approx(0.1, rel=0.05)
    constant = found["parameters"]["torque_constant"]
    assert constant["value"] == pytest.approx(0.1, rel=0.01)
    assert constant["unit"] == "N*m/A"
    assert constant["ci"][0] < constant["value"] < constant["ci"][1]
    inertia = found["parameters"]["rotor_inertia"]
    assert (inertia["value"], inertia["status"]) == (None, "undecided")
    assert found["columns"]["torque"] == {"column": "tau", "unit": "Nm"}
    assert "series" not in found


def test_inertia_and_smooth_sign_are_read_with_their_units(jointz, bench):
    options = ("--time", "t", "--rotor-inertia", "92:kg*cm^2", "--smooth-velocity", "6:deg/s")
    found = jointz("identify", "actuator", bench, *COLUMNS, *TURNED, *options, "--json").json
    assert found["parameters"]["rotor_inertia"]["value"] == pytest.approx(0.0092)
    assert found["settings"]["smooth_velocity_rad_s"] == pytest.approx(np.deg2rad(6))


@pytest.mark.parametrize(
    ("more", "word"),
    [
        (("--gear-ratio", 0), "gear_ratio"),
        (("--rotor-inertia", "heavy"), "--rotor-inertia"),
        (("--velocity", "w:N*m"), "velocity w:N*m"),
        (("--time", "t", "--rate", 500), "not both"),
        (("--figure", "fit.txt"), "--figure"),
    ],
)
def test_what_cannot_be_used_exits_2(jointz, bench, more, word):
    outcome = jointz("identify", "actuator", bench, *COLUMNS, *more)
    assert outcome.code == 2
    assert word in outcome.err


REAL = (
    *("--current", "motor_measured_current", "--velocity", "motor_measured_speed"),
    *("--torque", "adc_measured_torque", "--gear-ratio", 9, "--torque-sign", "-1"),
)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("file", "where"),
    [
        ("no_torque_tests/pre-calibration/log_adc_and_motor_no_torque_3.csv", ("torque", "row 2")),
        (
            "current_fixed/fixing_current_limit_issue/current_comp_test_6.csv",
            ("motor_measured_current", "row 40"),
        ),
        ("sys_ID_final/trial8.csv", ("row 2", "column 7")),
        ("torque_vary_with_angle/synchronized_trial_8/log_mitry_dephy.csv", ("row 1",)),
    ],
)
def test_each_broken_log_exits_2_with_row_and_column(jointz, real_data, file, where):
    outcome = jointz("identify", "actuator", real_data / "tmotor_bench" / file, *REAL)

    assert (outcome.code, outcome.out) == (2, "")
    assert all(place in outcome.err for place in where)


# --- bandwidth -----------------------------------------------------------------------------------


@pytest.fixture
def loop(tmp_path):
    command = 10.0 * np.random.default_rng(0).standard_normal(30_000)
    b, a = butter(1, 10.0, fs=1000.0)
    path = tmp_path / "loop.csv"
    pd.DataFrame({"cmd": command, "tau": lfilter(b, a, command)}).to_csv(path, index=False)
    return path


LOOP = ("--command", "cmd:Nm", "--torque", "tau:Nm", "--rate", 1000)


def test_the_bandwidth_comes_with_interval_and_resolution(jointz, loop, tmp_path):
    figure = tmp_path / "loop.png"
    outcome = jointz("identify", "bandwidth", loop, *LOOP, "--json", "--figure", figure)

    assert outcome.code == 0
    found = outcome.json
    assert found["model"] == "bandwidth"
    assert found["status"] == "ok"
    assert found["bandwidth_hz"] == pytest.approx(10.0, abs=0.3)
    estimate = found["parameters"]["bandwidth_hz"]
    assert estimate["ci"][0] < estimate["value"] < estimate["ci"][1]
    assert 0.0 < found["resolution_hz"] < found["bandwidth_hz"]
    assert figure.stat().st_size > 1000


# --- what a user may get wrong -------------------------------------------------------------------


def test_a_constant_command_beside_a_reference_names_the_reference(jointz, loop):
    table = pd.read_csv(loop)
    table.assign(reference=table["cmd"], cmd=0.0).to_csv(loop, index=False)

    outcome = jointz("identify", "bandwidth", loop, *LOOP)

    assert outcome.code == 1
    assert "--command reference" in outcome.err
    table.assign(cmd=0.0).to_csv(loop, index=False)
    assert "reference" not in jointz("identify", "bandwidth", loop, *LOOP).err


@pytest.mark.parametrize(
    ("text", "option"),
    [
        ("0.1,2,3\n2,1,5\n", "--no-header"),
        ("i;w;tau\n1;2;3\n", "--delimiter"),
        ('i,w,tau\n1,2,"3,5"\n2,1,4\n', "--decimal"),
        ("i,w,tau,tau\n1,2,3,4\n2,1,5,4\n", "--no-header"),
    ],
)
def test_messages_about_the_layout_name_the_option(jointz, tmp_path, text, option):
    path = tmp_path / "bench.csv"
    path.write_text(text)

    outcome = jointz("identify", "actuator", path, *COLUMNS)

    assert outcome.code == 2
    assert option in outcome.err


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--drop-db", "nan", "--drop-db"),
        ("--window-s", "-1", "window_s"),
        ("--delimiter", "", "--delimiter"),
    ],
)
def test_options_that_make_no_sense_exit_2_with_their_name(jointz, loop, option, value, message):
    outcome = jointz("identify", "bandwidth", loop, *LOOP, option, value)

    assert outcome.code == 2
    assert message in outcome.err
    assert "pydantic" not in outcome.err


def test_a_folder_is_no_recording_and_a_constant_current_has_its_code(jointz, bench, tmp_path):
    folder = jointz("identify", "actuator", tmp_path, *COLUMNS)
    pd.read_csv(bench).assign(i=2.0).to_csv(bench, index=False)
    constant = jointz("identify", "actuator", bench, *COLUMNS, "--json")

    assert folder.code == 2
    assert constant.code == 1
    assert constant.json["status"] == "failed:constant_current"
