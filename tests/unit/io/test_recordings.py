"""Reading recordings: into SI, the study's direction, and one condition each."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError, UnitError
from jointz.core.recording import history_of
from jointz.io.recordings import read_pulse_table

DEG = np.pi / 180.0
CONDITIONS = """\
[channels.condition]
column = "perturbed"
values = { "0" = "unperturbed", "1" = "EWP" }
"""
TRIALS = """\
[channels.trial]
column = "trial"
"""
ON_DEVICE = ('torque_acts_on = "joint"', 'torque_acts_on = "device"')
OTHER_STUDY = ('positive = "flexion"', 'positive = "extension"')


def one_recording(study, channels: str, condition: str | None = None) -> None:
    """Leave the first recording only, with more channels and a condition or none."""
    head = study.text[: study.text.index("[[recordings]]")]
    entry = '[[recordings]]\nparticipant = "S01"\nfile = "S01_enp.csv"\n'
    if condition:
        entry += f'condition = "{condition}"\n'
    study.text = head.replace("[[participants]]", channels + "[[participants]]") + entry
    study.text += '[perturbations]\nsource = "command"\n'


def columns_of(study, file: str = "S01_enp.csv") -> pd.DataFrame:
    return pd.read_csv(study.root / file)


def with_columns(study, **columns) -> None:
    """Put columns into the file of the first recording."""
    study.table("S01_enp.csv", lambda t: t.assign(**columns))


def refused(study, error: type[DataError] = DataError) -> DataError:
    with pytest.raises(error) as caught:
        study.read()
    return caught.value


# --- what a recording holds ----------------------------------------------------------------------


def test_a_recording_is_in_si_and_says_where_it_comes_from(study):
    (recording,) = study.read()

    table = columns_of(study)
    np.testing.assert_array_equal(recording["time"], table["time_s"])
    np.testing.assert_allclose(recording["angle"], table["knee_angle_deg"] * DEG, rtol=1e-15)
    np.testing.assert_array_equal(recording["torque"], table["torque_nm"])
    np.testing.assert_array_equal(recording["command"], table["commanded_torque_nm"])
    np.testing.assert_array_equal(recording["contact"], table["footswitch"])
    units = {name: recording[name].attrs["units"] for name in recording.variables}
    si = {"time": "s", "angle": "rad", "torque": "N*m", "command": "N*m", "contact": "1"}
    assert units == si | {"ankle_position": "rad"}
    attributes = {k: v for k, v in recording.attrs.items() if k not in ("sha256", "history")}
    assert attributes == {
        "participant": "S01", "condition": "unperturbed", "file": "S01_enp.csv", "session": "",
        "trial": "", "side": "", "joint": "knee", "positive": "flexion",
        "contact_kind": "contact", "trigger_threshold": "", "first_row": 2,
    }  # fmt: skip


def test_the_unit_in_a_columns_name_holds_and_must_agree(study):
    degrees = study.read()[0]["angle"]
    for file in study.root.glob("*.csv"):
        file.write_text(file.read_text().replace("knee_angle_deg", "knee (deg)", 1))
    study.edit('column = "knee_angle_deg"\nunit = "deg"', 'column = "knee (deg)"')
    np.testing.assert_array_equal(study.read()[0]["angle"], degrees)
    study.edit('column = "knee (deg)"', 'column = "knee (deg)"\nunit = "rad"')
    with pytest.raises(UnitError, match=r"'deg', .* 'rad'"):
        study.read()


@pytest.mark.parametrize("unit", ["mV", "V", "counts"])
def test_a_trigger_keeps_the_numbers_of_the_file_and_its_threshold(study, unit):
    study.channel("trigger", f'unit = "{unit}"', "threshold = 0.5", column="footswitch")

    (recording,) = study.read()

    np.testing.assert_array_equal(recording["trigger"], columns_of(study)["footswitch"])
    assert recording.attrs["trigger_threshold"] == "0.5"


@pytest.mark.parametrize(("line", "kind"), [('kind = "voltage"\n', "voltage"), ("", "contact")])
def test_session_side_and_kind_of_contact_are_kept(study, line, kind):
    study.edit('condition = "unperturbed"', 'condition = "NPC"\nsession = 3\nside = "left"')
    study.edit('kind = "contact"\n', line)

    (recording,) = study.read()

    kept = [recording.attrs[k] for k in ("condition", "session", "side", "contact_kind")]
    assert kept == ["unperturbed", "3", "left", kind]


# --- units and signs -----------------------------------------------------------------------------


@pytest.mark.parametrize(("line", "factor"), [('unit = "mrad"\n', 1e-3), ("", np.deg2rad(1.0))])
def test_the_end_of_a_name_states_the_unit_unless_another_is_given(study, line, factor):
    with_columns(study, knee_angle_deg=0.1 * np.arange(50))
    study.edit('unit = "deg"\n', line)

    angle = study.read()[0]["angle"]

    np.testing.assert_allclose(angle, columns_of(study)["knee_angle_deg"] * factor, rtol=1e-15)
    assert angle.attrs["units"] == "rad"


def positive(channel: str, direction: str) -> tuple[str, str]:
    return f"[channels.{channel}]", f'[channels.{channel}]\npositive = "{direction}"'


@pytest.mark.parametrize(
    ("edits", "turned"),
    [
        ([positive("angle", "extension")], ["angle"]),
        ([positive("torque", "extension")], ["torque"]),
        ([positive("command", "extension")], ["command"]),
        ([positive("angle", "flexion")], []),
        ([OTHER_STUDY], []),
        ([OTHER_STUDY, positive("angle", "flexion")], ["angle"]),
        ([ON_DEVICE], ["torque", "sensor_torque"]),
        ([ON_DEVICE, positive("torque", "extension")], ["sensor_torque"]),
    ],
)
def test_channels_turn_by_their_direction_and_torques_by_the_side_of_the_device(
    study, edits, turned
):
    study.channel("sensor_torque", 'unit = "Nm"')
    study.tables(lambda t: t.assign(sensor_torque=t["torque_nm"] + 1.0))
    (straight,) = study.read()
    for edit in edits:
        study.edit(*edit)

    (recording,) = study.read()

    for name in straight.data_vars:
        sign = -1 if name in turned else 1
        np.testing.assert_array_equal(recording[name], sign * straight[name], err_msg=name)
    assert history_of(recording)[0]["turned"] == turned
    assert recording.attrs["positive"] == ("extension" if OTHER_STUDY in edits else "flexion")


@pytest.mark.parametrize(
    ("lines", "condition", "sign"),
    [
        ((), "unperturbed", 1),
        (('positive = "flexion"',), "unperturbed", 1),
        (('positive = "extension"',), "unperturbed", -1),
        (('positive = "extension"',), "no_device", -1),
    ],
)
def test_an_internal_moment_turns_by_its_own_direction_alone_and_needs_no_device(
    study, lines, condition, sign
):
    study.channel("joint_moment", 'unit = "Nm"', *lines)
    study.tables(lambda t: t.assign(joint_moment=t["torque_nm"] + 2.0))
    study.edit('condition = "unperturbed"', f'condition = "{condition}"').edit(*ON_DEVICE)

    moment = study.read()[0]["joint_moment"]

    np.testing.assert_array_equal(moment, sign * columns_of(study)["joint_moment"])
    assert moment.attrs["units"] == "N*m"


MOTOR = ("current", "motor_angle", "motor_velocity", "motor_acceleration")


@pytest.mark.parametrize(
    ("current", "velocity", "signs"),
    [
        ("", "", (1, 1, 1, 1)),
        ("extension", "", (-1, -1, -1, -1)),
        ("extension", "flexion", (-1, -1, 1, -1)),
        ("", "extension", (1, 1, -1, 1)),
    ],
)
def test_channels_of_the_motor_turn_with_its_current_alone(study, current, velocity, signs):
    for name in MOTOR:
        own = {"current": current, "motor_velocity": velocity}.get(name, "")
        study.channel(name, *([f'positive = "{own}"'] if own else []))
    study.tables(lambda t: t.assign(**{n: 0.01 * (t.index + k) for k, n in enumerate(MOTOR)}))
    study.edit(*ON_DEVICE)

    (recording,) = study.read()

    table = columns_of(study)
    for name, sign in zip(MOTOR, signs, strict=True):
        np.testing.assert_array_equal(recording[name], sign * table[name], err_msg=name)
    np.testing.assert_array_equal(recording["torque"], -table["torque_nm"])


@pytest.mark.parametrize(("lines", "sign"), [((), 1), (('positive = "extension"',), -1)])
def test_a_channel_of_the_users_own_is_kept_in_si_and_turned_with_its_offset(study, lines, sign):
    study.channel("mine", 'unit = "degC"', *lines)
    study.tables(lambda t: t.assign(mine=20.0 + t.index))

    mine = study.read()[0]["mine"]

    np.testing.assert_allclose(mine, sign * (293.15 + np.arange(50)), rtol=1e-15)
    assert mine.attrs["units"] == "K"


def test_an_angle_may_span_a_turn_and_no_more(study):
    with_columns(study, knee_angle_deg=np.linspace(0.0, 359.9, 50))
    assert np.ptp(study.read()[0]["angle"].to_numpy()) == pytest.approx(359.9 * DEG)

    with_columns(study, knee_angle_deg=np.linspace(0.0, 360.1, 50))
    error = refused(study)

    assert (error.path, error.channel) == ("S01_enp.csv", "angle")


def test_a_position_of_the_users_own_is_no_part_of_a_walkers_angle(study):
    study.channel("position", 'unit = "rad"')
    study.tables(lambda t: t.assign(position=1.0 * t.index))

    assert float(study.read()[0]["position"].max()) == 49.0


def test_two_sides_of_a_bench_may_turn_for_ever_together(study):
    study.edit('kind = "walking"', 'kind = "bench"').channel("position", 'unit = "deg"')
    turning = 20.0 * np.arange(50.0)
    study.tables(lambda t: t.assign(position=turning, knee_angle_deg=turning + 1.0))

    assert np.ptp(study.read()[0]["angle"].to_numpy()) == pytest.approx(980.0 * DEG)


def test_missing_samples_stay_missing(study):
    torque = np.where(np.arange(50) == 3, np.nan, 1.0)
    with_columns(study, torque_nm=torque, knee_angle_deg=np.nan)

    (recording,) = study.read()

    assert np.flatnonzero(np.isnan(recording["torque"])).tolist() == [3]
    assert np.isnan(recording["angle"]).all()


# --- units that a file states itself -------------------------------------------------------------


def as_netcdf(study, **units: str) -> None:
    """Turn the files of the study to netCDF; variables carry the units given."""
    for stem in ("S01_enp", "S01_ewp"):
        table = columns_of(study, f"{stem}.csv").set_index("time_s")
        dataset = xr.Dataset.from_dataframe(table)
        for name, unit in units.items():
            dataset[name].attrs["units"] = unit
        dataset.to_netcdf(study.root / f"{stem}.nc", engine="h5netcdf")
        study.edit(f'"{stem}.csv"', f'"{stem}.nc"')


def test_the_unit_of_the_file_is_used_where_the_study_gives_none(study):
    table = columns_of(study)
    study.edit('column = "knee_angle_deg"\nunit = "deg"', 'column = "knee_angle_deg"')
    study.edit('column = "torque_nm"\nunit = "N*m"', 'column = "torque_nm"')
    study.edit('column = "ankle_position"\nunit = "rad"', 'column = "ankle_position"')
    study.edit(', unit = "rad" }', " }")
    as_netcdf(study, knee_angle_deg="degrees", torque_nm="mNm", ankle_position="mm")

    (recording,) = study.read()

    np.testing.assert_allclose(recording["angle"], table["knee_angle_deg"] * DEG, rtol=1e-15)
    np.testing.assert_allclose(recording["torque"], table["torque_nm"] * 1e-3, rtol=1e-15)
    mine = recording["ankle_position"]
    np.testing.assert_allclose(mine, table["ankle_position"] * 1e-3, rtol=1e-15)
    assert (recording["torque"].attrs["units"], mine.attrs["units"]) == ("N*m", "m")
    units = history_of(recording)[0]["units"]
    assert (units["angle"], units["torque"], units["command"]) == ("degrees", "mNm", "N*m")


def test_a_file_that_states_the_same_units_in_other_words_agrees(study):
    (plain,) = study.read()
    as_netcdf(study, knee_angle_deg="degree", torque_nm="Nm", time_s="s", footswitch="bananas")

    xr.testing.assert_allclose(study.read()[0], plain, rtol=1e-15)


@pytest.mark.parametrize(
    ("column", "unit", "channel"),
    [
        ("knee_angle_deg", "rad", "angle"),
        ("torque_nm", "deg", "torque"),
        ("torque_nm", "furlong", "torque"),
    ],
)
def test_a_file_and_a_study_that_disagree_on_a_unit_are_refused(study, column, unit, channel):
    as_netcdf(study, **{column: unit})

    assert str(refused(study, UnitError)).startswith(f"S01_enp.nc, channel '{channel}': ")


# --- conditions, trials and cycles in columns ----------------------------------------------------


def test_one_file_of_several_conditions_gives_a_recording_a_run(study):
    one_recording(study, CONDITIONS)
    with_columns(study, perturbed=[0.0] * 20 + [1.0] * 20 + [0.0] * 10)

    pieces = study.read()

    assert [p.attrs["condition"] for p in pieces] == ["unperturbed", "perturbed", "unperturbed"]
    assert [p.sizes["time"] for p in pieces] == [20, 20, 10]
    assert [p.attrs["first_row"] for p in pieces] == [2, 22, 42]
    assert len({p.attrs["sha256"] for p in pieces}) == 1
    together = xr.concat(pieces, dim="time", combine_attrs="drop")
    np.testing.assert_array_equal(together["time"], columns_of(study)["time_s"])
    np.testing.assert_array_equal(together["torque"], columns_of(study)["torque_nm"])
    assert "condition" not in together


@pytest.mark.parametrize(
    ("alias", "condition"),
    [("E-NPC", "unperturbed"), ("Perturbed", "perturbed"), (" NWC ", "no_device")],
)
def test_values_that_name_conditions_need_no_mapping(study, alias, condition):
    one_recording(study, '[channels.condition]\ncolumn = "perturbed"\n')
    with_columns(study, perturbed=alias)

    assert study.read()[0].attrs["condition"] == condition


@pytest.mark.parametrize("value", ["2", ""])
def test_a_condition_that_is_not_named_is_refused(study, value):
    one_recording(study, CONDITIONS)
    with_columns(study, perturbed=[*["0"] * 49, value])

    error = refused(study)

    assert (error.path, error.channel) == ("S01_enp.csv", "condition")


def test_the_condition_of_the_recording_stands_over_the_column(study):
    one_recording(study, CONDITIONS, condition="APC")

    (recording,) = study.read()  # the file has no such column

    assert recording.attrs["condition"] == "perturbed"


def test_time_may_restart_at_each_trial_and_not_within(study):
    one_recording(study, TRIALS + 'values = { "1" = "slow" }\n', condition="perturbed")
    half = np.arange(25) / 1000.0
    with_columns(study, time_s=np.tile(half, 2), trial=[1] * 25 + [2] * 25)

    first, second = study.read()

    assert [first.attrs["trial"], second.attrs["trial"]] == ["slow", "2"]
    np.testing.assert_array_equal(first["time"], half)
    np.testing.assert_array_equal(second["time"], half)
    np.testing.assert_array_equal(second["torque"], columns_of(study)["torque_nm"][25:])
    with_columns(study, trial=[1] * 20 + [2] * 30)
    assert str(refused(study)).startswith("S01_enp.csv: row 27: ")


def test_conditions_and_trials_together_cut_at_every_change_of_either(study):
    one_recording(study, CONDITIONS + TRIALS)
    trial = ["a"] * 10 + ["b"] * 25 + ["a"] * 15
    with_columns(study, perturbed=[0] * 20 + [1] * 30, trial=trial)

    pieces = study.read()

    assert [(p.attrs["condition"], p.attrs["trial"], p.sizes["time"]) for p in pieces] == [
        ("unperturbed", "a", 10),
        ("unperturbed", "b", 10),
        ("perturbed", "b", 15),
        ("perturbed", "a", 15),
    ]


def test_a_run_of_a_single_sample_is_refused(study):
    one_recording(study, TRIALS, condition="perturbed")
    with_columns(study, trial=[1] * 49 + [2])

    assert refused(study).path == "S01_enp.csv"


def test_cycles_are_counted_and_do_not_cut(study):
    one_recording(study, '[channels.cycle]\ncolumn = "stride"\n', condition="perturbed")
    with_columns(study, stride=["x"] * 10 + ["y"] * 30 + ["x"] * 10)

    (recording,) = study.read()

    np.testing.assert_array_equal(recording["cycle"], [0] * 10 + [1] * 30 + [0] * 10)


# --- time ----------------------------------------------------------------------------------------


def without_time(study) -> None:
    start = study.text.index("[channels.time]")
    study.text = study.text[:start] + study.text[study.text.index("[channels.angle]") :]


def test_a_sample_rate_stands_for_a_time_column_and_all_pieces_share_its_clock(study):
    """The onsets of a pulse table would belong to every piece if each began at zero."""
    one_recording(study, CONDITIONS)
    without_time(study)
    study.edit("sample_rate_hz = 1000.0", "sample_rate_hz = 500.0")
    with_columns(study, perturbed=[0] * 20 + [1] * 30)

    first, second = study.read()

    np.testing.assert_array_equal(first["time"], np.arange(20) / 500.0)
    np.testing.assert_array_equal(second["time"], np.arange(20, 50) / 500.0)


@pytest.mark.parametrize(("rate", "accepted"), [(1049.0, True), (951.0, True), (1060.0, False)])
def test_a_rate_may_be_five_percent_off_that_of_the_time_column(study, rate, accepted):
    study.edit("sample_rate_hz = 1000.0", f"sample_rate_hz = {rate}")

    if accepted:
        np.testing.assert_array_equal(study.read()[0]["time"], columns_of(study)["time_s"])
        return
    error = refused(study)
    assert (error.path, error.channel) == ("S01_enp.csv", "time")


def test_gaps_in_time_do_not_change_its_rate(study):
    late = np.arange(50) / 1000.0 + np.where(np.arange(50) > 25, 7.0, 0.0)
    with_columns(study, time_s=late)

    np.testing.assert_array_equal(study.read()[0]["time"], late)


@pytest.mark.parametrize("cell", [np.nan, 0.004, 0.001])
def test_a_bad_time_stamp_is_named_by_its_row(study, cell):
    with_columns(study, time_s=np.where(np.arange(50) == 5, cell, np.arange(50) / 1000.0))

    assert str(refused(study)).startswith("S01_enp.csv: row 7: ")


def test_rows_are_counted_with_those_skipped(study):
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        path = study.root / file
        path.write_text("exported by a program\n\n" + path.read_text())
    study.edit("[files]", "[files]\nskip_rows = 2\n#")

    assert study.read()[0].attrs["first_row"] == 4


# --- no device -----------------------------------------------------------------------------------


def test_a_recording_without_device_has_kinematics_and_contact_only(study):
    study.edit('condition = "unperturbed"', 'condition = "NWC"').edit(*ON_DEVICE)
    device = ["torque_nm", "commanded_torque_nm", "ankle_position"]
    study.table("S01_enp.csv", lambda t: t.drop(columns=device))

    (recording,) = study.read()

    assert recording.attrs["condition"] == "no_device"
    assert set(recording.data_vars) == {"angle", "contact"}
    (step,) = history_of(recording)
    assert (list(step["units"]), step["turned"]) == (["time", "angle", "contact"], [])


def test_columns_count_from_zero_by_one_that_a_recording_does_not_need(study):
    expected = columns_of(study)["knee_angle_deg"] * DEG
    order = ["torque_nm", "time_s", "knee_angle_deg"]
    order += ["commanded_torque_nm", "footswitch", "ankle_position"]
    for number, name in enumerate(order):
        study.edit(f'column = "{name}"', f"column = {number}")
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        columns_of(study, file)[order].to_csv(study.root / file, index=False, header=False)
    study.text += "header = false\n"
    study.edit('condition = "unperturbed"', 'condition = "no_device"')

    np.testing.assert_allclose(study.read()[0]["angle"], expected, rtol=1e-12)


# --- pulse tables --------------------------------------------------------------------------------


def pulse_table(study, content: str | bytes) -> pd.DataFrame:
    opened = study.open()
    raw = content.encode() if isinstance(content, str) else content
    (study.root / "S01_pulses.csv").write_bytes(raw)
    return read_pulse_table(opened, opened.spec.recordings[1])


def refused_table(study, content: str | bytes) -> DataError:
    with pytest.raises(DataError) as caught:
        pulse_table(study, content)
    assert str(caught.value).startswith("S01_pulses.csv")
    assert caught.value.path == str(study.root / "S01_pulses.csv")
    return caught.value


def test_a_recording_without_a_pulse_table_has_none(study):
    opened = study.open()

    assert read_pulse_table(opened, opened.spec.recordings[0]) is None


def test_a_pulse_table_is_read_as_it_stands_without_its_empty_lines(study):
    head = "timing_point,onset_s,amplitude_nm,duration_s"
    table = pulse_table(study, f"{head}\nLRE,0.021,5.0,0.009\n\n , , ,\n MST , 0.5 ,-5,2e-1\n\n")

    assert list(table.columns) == ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    assert table.to_numpy().tolist() == [[0.021, 0.009, 5.0, "LRE"], [0.5, 0.2, -5.0, "MST"]]
    assert [str(dtype) for dtype in table.dtypes.iloc[:3]] == ["float64"] * 3


@pytest.mark.parametrize("suffix", [".gz", ".zip"])
def test_a_packed_pulse_table_is_refused(study, suffix):
    study.edit("S01_pulses.csv", f"S01_pulses.csv{suffix}")
    pd.DataFrame({"onset_s": [0.5]}).to_csv(study.root / f"S01_pulses.csv{suffix}")
    with pytest.raises(DataError, match=rf"csv{suffix}: "):
        pulse_table(study, "")


@pytest.mark.parametrize(
    "content",
    [
        "onset_s\n0.5\n",
        "onset_s,duration_s,amplitude_nm,timing_point\n0.5, ,,  \n",
        "onset_s,timing_point\n0.5\n",
        "\ufeffonset_s,duration_s\r\n0.5,\r\n",
    ],
)
def test_what_a_pulse_table_leaves_out_is_missing(study, content):
    table = pulse_table(study, content)

    assert table["onset_s"].tolist() == [0.5]
    assert table[["duration_s", "amplitude_nm"]].isna().all(axis=None)
    assert table["timing_point"].tolist() == [""]


def test_a_pulse_table_may_be_empty(study):
    table = pulse_table(study, "onset_s,duration_s,timing_point\n")

    assert table.shape == (0, 4)
    assert table["onset_s"].dtype == float


@pytest.mark.parametrize(
    "content",
    [
        *("duration_s,amplitude_nm\n1,1\n", "onset_s,trial\n1,1\n", "onset_s,onset_s\n1,1\n"),
        *("onset_s,timing_point\n0.5,LRE,1\n", "onset_s;duration_s\n0,5;1\n0.5;1\n"),
        *("onset_s\n0.5\n0.7,1\n", ""),
    ],
)
def test_what_is_no_pulse_table_is_refused(study, content):
    refused_table(study, content)


@pytest.mark.parametrize("cell", ["early", "", "nan", "-inf", "1 s", "1,5", "0x10"])
def test_an_onset_that_is_no_number_is_refused(study, cell):
    error = refused_table(study, f'onset_s,timing_point\n0.5,LRE\n"{cell}",LRE\n')

    assert (error.row, error.channel) == (3, "onset_s")


@pytest.mark.parametrize("column", ["duration_s", "amplitude_nm"])
@pytest.mark.parametrize("cell", ["long", "inf"])
def test_text_in_an_optional_column_is_refused_by_its_row_with_empty_lines_counted(
    study, column, cell
):
    error = refused_table(study, f"onset_s,{column}\n0.5,\n\n\n0.7,{cell}\n")

    assert (error.row, error.channel) == (5, column)


def test_a_pulse_table_that_vanished_is_a_data_error(study):
    opened = study.open()
    (study.root / "S01_pulses.csv").unlink()

    with pytest.raises(DataError, match=r"S01_pulses\.csv: "):
        read_pulse_table(opened, opened.spec.recordings[1])


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(content=st.text('onset_s,timing_point\n\r 0.5"-e;', max_size=60))
def test_any_text_is_a_pulse_table_or_a_data_error(study, content):
    try:
        table = pulse_table(study, "onset_s,timing_point\n" + content)
    except DataError:
        return
    assert list(table.columns) == ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    assert np.isfinite(table["onset_s"]).all()
