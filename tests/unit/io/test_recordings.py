"""Reading recordings: into SI, the study's direction, and one condition each."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError, UnitError
from jointz.core.recording import history_of
from jointz.io.recordings import read_pulse_table, read_recording
from jointz.io.study_reader import open_study

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


def add_channel(study, name: str, *lines: str) -> None:
    """Add a channel to the study's text, in the column of its name."""
    table = "\n".join([f"[channels.{name}]", f'column = "{name}"', *lines, ""])
    study.edit("[[participants]]", table + "[[participants]]")


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


def refused(study, error: type[DataError] = DataError, number: int = 0) -> DataError:
    with pytest.raises(error) as caught:
        study.read(number)
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
    assert units == {
        "time": "s",
        "angle": "rad",
        "torque": "N*m",
        "command": "N*m",
        "contact": "1",
        "ankle_position": "rad",
    }
    attributes = {k: v for k, v in recording.attrs.items() if k not in ("sha256", "history")}
    assert attributes == {
        "participant": "S01",
        "condition": "unperturbed",
        "file": "S01_enp.csv",
        "session": "",
        "trial": "",
        "side": "",
        "joint": "knee",
        "positive": "flexion",
        "contact_kind": "contact",
        "first_row": 2,
    }


def test_session_side_and_kind_of_contact_are_kept(study):
    study.edit('condition = "unperturbed"', 'condition = "NPC"\nsession = 3\nside = "left"')
    study.edit('kind = "contact"', 'kind = "voltage"')

    (recording,) = study.read()

    kept = [recording.attrs[k] for k in ("condition", "session", "side", "contact_kind")]
    assert kept == ["unperturbed", "3", "left", "voltage"]


def test_a_contact_without_a_kind_is_a_switch(study):
    study.edit('kind = "contact"\n', "")

    assert study.read()[0].attrs["contact_kind"] == "contact"


def test_a_study_without_contact_has_no_kind_of_contact(study):
    study.edit("[channels.contact]                           # optional: footswitch\n", "")
    study.edit('column = "footswitch"\nkind = "contact"\n', "")

    (recording,) = study.read()

    assert recording.attrs["contact_kind"] == ""
    assert "contact" not in recording


def test_the_history_names_file_units_and_what_was_turned(study):
    study.edit('torque_acts_on = "joint"', 'torque_acts_on = "device"')

    (recording,) = study.read()

    (step,) = history_of(recording)
    assert step == {
        "step": "read",
        "file": "S01_enp.csv",
        "sha256": recording.attrs["sha256"],
        "units": {
            "time": "s",
            "angle": "deg",
            "torque": "N*m",
            "command": "N*m",
            "contact": "1",
            "ankle_position": "rad",
        },
        "turned": ["torque"],
    }


def test_the_history_tells_only_of_channels_that_were_read(study):
    study.edit('condition = "unperturbed"', 'condition = "no_device"')
    study.edit('torque_acts_on = "joint"', 'torque_acts_on = "device"')

    (step,) = history_of(study.read()[0])

    assert list(step["units"]) == ["time", "angle", "contact"]
    assert step["turned"] == []


# --- units and signs -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("deg", DEG), ("rad", 1.0), ("mrad", 1e-3), ("°", DEG), ("degrees", DEG)],
)
def test_an_angle_is_taken_to_radians(study, unit, factor):
    study.table("S01_enp.csv", lambda t: t.assign(knee_angle_deg=t["knee_angle_deg"] / 10))
    study.edit('unit = "deg"', f'unit = "{unit}"')

    (recording,) = study.read()

    expected = columns_of(study)["knee_angle_deg"] * factor
    np.testing.assert_allclose(recording["angle"], expected, rtol=1e-15)


@pytest.mark.parametrize("own", ["", 'unit = "rad"\n'])
def test_a_channel_without_a_unit_is_in_si(study, own):
    study.table("S01_enp.csv", lambda t: t.assign(knee_angle_deg=t["knee_angle_deg"] / 10))
    study.edit('unit = "deg"\n', own)

    angle = study.read()[0]["angle"]

    np.testing.assert_array_equal(angle, columns_of(study)["knee_angle_deg"])
    assert angle.attrs["units"] == "rad"


@pytest.mark.parametrize("channel", ["angle", "torque", "command"])
def test_a_channel_positive_the_other_way_is_turned(study, channel):
    (straight,) = study.read()
    study.edit(f"[channels.{channel}]", f'[channels.{channel}]\npositive = "extension"')

    (turned,) = study.read()

    np.testing.assert_array_equal(turned[channel], -straight[channel])
    for other in set(straight.data_vars) - {channel}:
        np.testing.assert_array_equal(turned[other], straight[other])


def test_a_channel_positive_as_the_study_is_not_turned(study):
    (straight,) = study.read()
    study.edit("[channels.angle]", '[channels.angle]\npositive = "flexion"')

    xr.testing.assert_identical(study.read()[0], straight)


def test_the_direction_of_the_study_turns_nothing_by_itself(study):
    (flexion,) = study.read()
    study.edit('positive = "flexion"', 'positive = "extension"')

    (extension,) = study.read()

    assert extension.attrs["positive"] == "extension"
    xr.testing.assert_equal(extension, flexion)


def test_a_channel_is_turned_into_the_direction_of_the_study(study):
    (straight,) = study.read()
    study.edit('positive = "flexion"', 'positive = "extension"')
    study.edit("[channels.angle]", '[channels.angle]\npositive = "flexion"')

    (turned,) = study.read()

    np.testing.assert_array_equal(turned["angle"], -straight["angle"])
    np.testing.assert_array_equal(turned["torque"], straight["torque"])


def test_torque_on_the_device_is_turned_and_nothing_else(study):
    add_channel(study, "sensor_torque", 'unit = "Nm"')
    study.table("S01_enp.csv", lambda t: t.assign(sensor_torque=t["torque_nm"] + 1.0))
    study.table("S01_ewp.csv", lambda t: t.assign(sensor_torque=0.0))
    (joint,) = study.read()
    study.edit('torque_acts_on = "joint"', 'torque_acts_on = "device"')

    (device,) = study.read()

    for channel in ("torque", "sensor_torque"):
        np.testing.assert_array_equal(device[channel], -joint[channel])
    for channel in ("angle", "command", "contact"):
        np.testing.assert_array_equal(device[channel], joint[channel])


def test_torque_on_the_device_and_positive_the_other_way_is_as_it_is(study):
    (straight,) = study.read()
    study.edit('torque_acts_on = "joint"', 'torque_acts_on = "device"')
    study.edit("[channels.torque]", '[channels.torque]\npositive = "extension"')

    (twice,) = study.read()

    np.testing.assert_array_equal(twice["torque"], straight["torque"])
    assert history_of(twice)[0]["turned"] == []


MOTOR = ("current", "motor_angle", "motor_velocity", "motor_acceleration")


def motor_study(study, *, current: str = "", velocity: str = "") -> None:
    for k, name in enumerate(MOTOR):
        own = {"current": current, "motor_velocity": velocity}.get(name, "")
        add_channel(study, name, *([f'positive = "{own}"'] if own else []))
        for file in ("S01_enp.csv", "S01_ewp.csv"):
            study.table(file, lambda t, n=name, k=k: t.assign(**{n: 0.01 * (t.index + k)}))


@pytest.mark.parametrize(
    ("current", "velocity", "signs"),
    [
        ("", "", (1, 1, 1, 1)),
        ("flexion", "", (1, 1, 1, 1)),
        ("extension", "", (-1, -1, -1, -1)),
        ("extension", "flexion", (-1, -1, 1, -1)),
        ("", "extension", (1, 1, -1, 1)),
    ],
)
def test_channels_of_the_motor_turn_with_its_current(study, current, velocity, signs):
    motor_study(study, current=current, velocity=velocity)

    (recording,) = study.read()

    table = columns_of(study)
    for name, sign in zip(MOTOR, signs, strict=True):
        np.testing.assert_array_equal(recording[name], sign * table[name], err_msg=name)
    np.testing.assert_array_equal(recording["torque"], table["torque_nm"])


def test_torque_on_the_device_does_not_turn_the_motor(study):
    motor_study(study)
    study.edit('torque_acts_on = "joint"', 'torque_acts_on = "device"')

    (recording,) = study.read()

    np.testing.assert_array_equal(recording["current"], columns_of(study)["current"])


def test_channels_of_the_motor_without_a_current_have_their_own_direction(study):
    add_channel(study, "motor_velocity", 'unit = "rpm"')
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        study.table(file, lambda t: t.assign(motor_velocity=3.0 + t.index))

    (recording,) = study.read()

    expected = columns_of(study)["motor_velocity"] * 2 * np.pi / 60
    np.testing.assert_allclose(recording["motor_velocity"], expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("unit", "si_unit", "factor", "offset"),
    [("mV", "V", 1e-3, 0.0), ("degC", "K", 1.0, 273.15), ("%", "1", 1e-2, 0.0)],
)
def test_a_channel_of_the_users_own_is_kept_in_si(study, unit, si_unit, factor, offset):
    add_channel(study, "mine", f'unit = "{unit}"')
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        study.table(file, lambda t: t.assign(mine=t.index * 1.5))

    mine = study.read()[0]["mine"]

    np.testing.assert_allclose(mine, columns_of(study)["mine"] * factor + offset, rtol=1e-15)
    assert mine.attrs["units"] == si_unit


def test_an_offset_of_a_unit_is_turned_with_its_channel(study):
    add_channel(study, "mine", 'unit = "degC"', 'positive = "extension"')
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        study.table(file, lambda t: t.assign(mine=20.0))

    np.testing.assert_allclose(study.read()[0]["mine"], -293.15, rtol=1e-15)


def test_an_angle_of_more_than_a_turn_is_most_likely_in_degrees(study):
    study.edit('unit = "deg"', 'unit = "rad"')

    error = refused(study)

    span = np.ptp(columns_of(study)["knee_angle_deg"]) / DEG
    assert str(error) == (
        f"S01_enp.csv: the joint's angle spans {span:.0f} deg, more than a full turn. Is its unit "
        "right in study.toml (deg declared as rad?)"
    )
    assert (error.path, error.channel) == ("S01_enp.csv", "angle")


@pytest.mark.parametrize(("span_deg", "accepted"), [(359.9, True), (360.1, False)])
def test_an_angle_may_span_a_turn_and_no_more(study, span_deg, accepted):
    ramp = np.linspace(0.0, span_deg, 50)
    study.table("S01_enp.csv", lambda t: t.assign(knee_angle_deg=ramp))

    if accepted:
        assert np.ptp(study.read()[0]["angle"].to_numpy()) == pytest.approx(span_deg * DEG)
    else:
        assert "more than a full turn" in str(refused(study))


def test_a_position_of_the_users_own_is_no_part_of_a_walkers_angle(study):
    add_channel(study, "position", 'unit = "rad"')
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        study.table(file, lambda t: t.assign(position=1.0 * t.index))

    (recording,) = study.read()

    assert float(recording["position"].max()) == 49.0


def test_two_sides_of_a_bench_may_turn_for_ever_together(study):
    study.edit('kind = "walking"', 'kind = "bench"')
    add_channel(study, "position", 'unit = "deg"')
    turning = 20.0 * np.arange(50.0)
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        study.table(file, lambda t: t.assign(position=turning, knee_angle_deg=turning + 1.0))

    assert np.ptp(study.read()[0]["angle"].to_numpy()) == pytest.approx(980.0 * DEG)


def test_missing_samples_stay_missing(study):
    def spoil(table):
        table.loc[3, "torque_nm"] = np.nan
        table["knee_angle_deg"] = np.nan
        return table

    study.table("S01_enp.csv", spoil)

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
    as_netcdf(study, knee_angle_deg="degrees", torque_nm="mNm", ankle_position="rad")

    (recording,) = study.read()

    np.testing.assert_allclose(recording["angle"], table["knee_angle_deg"] * DEG, rtol=1e-15)
    np.testing.assert_allclose(recording["torque"], table["torque_nm"] * 1e-3, rtol=1e-15)
    assert recording["torque"].attrs["units"] == "N*m"
    told = history_of(recording)[0]["units"]
    assert (told["angle"], told["torque"], told["command"]) == ("degrees", "mNm", "N*m")


def test_a_file_that_states_the_same_unit_in_other_words_agrees(study):
    (plain,) = study.read()
    as_netcdf(study, knee_angle_deg="degree", torque_nm="Nm", time_s="s")

    (stated,) = study.read()

    xr.testing.assert_allclose(stated, plain, rtol=1e-15)


def test_a_file_and_a_study_that_disagree_on_a_unit_are_refused(study):
    as_netcdf(study, knee_angle_deg="rad")

    error = refused(study, UnitError)

    assert str(error) == (
        "S01_enp.nc, channel 'angle': the file says 'rad', study.toml says 'deg'. "
        "Correct one of them."
    )
    assert error.channel == "angle"


def test_a_file_and_a_study_that_disagree_on_a_quantity_are_refused(study):
    as_netcdf(study, torque_nm="deg")

    assert str(refused(study, UnitError)) == (
        "S01_enp.nc, channel 'torque': 'deg' measures angle, expected a torque such as N*m, Nm "
        "or lbf*in. Correct the unit."
    )


def test_a_unit_of_the_file_that_does_not_fit_its_channel_is_refused(study):
    study.edit('column = "torque_nm"\nunit = "N*m"', 'column = "torque_nm"')
    as_netcdf(study, torque_nm="furlong")

    message = str(refused(study, UnitError))

    assert message.startswith("S01_enp.nc, channel 'torque': 'furlong' is not a unit")


def test_the_unit_that_a_file_gives_its_contact_is_ignored(study):
    as_netcdf(study, footswitch="bananas")

    np.testing.assert_array_equal(study.read()[0]["contact"], columns_of(study)["footswitch"])


def test_a_channel_of_the_users_own_takes_the_unit_of_the_file(study):
    study.edit('column = "ankle_position"\nunit = "rad"', 'column = "ankle_position"')
    study.edit(', unit = "rad" }', " }")
    table = columns_of(study)
    as_netcdf(study, ankle_position="mm")

    mine = study.read()[0]["ankle_position"]

    np.testing.assert_allclose(mine, table["ankle_position"] * 1e-3, rtol=1e-15)
    assert mine.attrs["units"] == "m"


# --- conditions, trials and cycles in columns ----------------------------------------------------


def test_one_file_of_several_conditions_gives_a_recording_a_run(study):
    one_recording(study, CONDITIONS)
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=[0] * 20 + [1] * 20 + [0] * 10))

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
    [
        ("unperturbed", "unperturbed"),
        ("enp", "unperturbed"),
        ("E-NPC", "unperturbed"),
        ("Perturbed", "perturbed"),
        ("ewp", "perturbed"),
        ("E-apc", "perturbed"),
        (" NWC ", "no_device"),
        ("No_Device", "no_device"),
    ],
)
def test_values_that_name_conditions_need_no_mapping(study, alias, condition):
    one_recording(study, '[channels.condition]\ncolumn = "perturbed"\n')
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=alias))

    (recording,) = study.read()

    assert recording.attrs["condition"] == condition


def test_numbers_of_conditions_may_be_written_as_floats(study):
    one_recording(study, CONDITIONS)
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=[0.0] * 25 + [1.0] * 25))

    assert [p.attrs["condition"] for p in study.read()] == ["unperturbed", "perturbed"]


@pytest.mark.parametrize("value", ["2", "rest"])
def test_a_condition_that_is_not_named_is_refused(study, value):
    one_recording(study, CONDITIONS)
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=["0"] * 25 + [value] * 25))

    error = refused(study)

    assert str(error) == (
        f"S01_enp.csv: column 'perturbed' holds '{value}', which channels.condition.values does "
        "not name (it names 0, 1). Name it there, or correct the file."
    )
    assert (error.path, error.channel) == ("S01_enp.csv", "condition")


def test_a_missing_condition_is_refused(study):
    one_recording(study, '[channels.condition]\ncolumn = "perturbed"\n')
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=["enp"] * 49 + [""]))

    assert "holds '', which channels.condition.values does not name (it names none)" in str(
        refused(study)
    )


def test_the_condition_of_the_recording_stands_over_the_column(study):
    one_recording(study, CONDITIONS, condition="APC")

    (recording,) = study.read()  # the file has no such column

    assert recording.attrs["condition"] == "perturbed"


def test_time_may_restart_at_each_trial(study):
    one_recording(study, TRIALS, condition="perturbed")
    half = np.arange(25) / 1000.0
    study.table(
        "S01_enp.csv", lambda t: t.assign(time_s=np.tile(half, 2), trial=[1] * 25 + [2] * 25)
    )

    first, second = study.read()

    assert [first.attrs["trial"], second.attrs["trial"]] == ["1", "2"]
    np.testing.assert_array_equal(first["time"], half)
    np.testing.assert_array_equal(second["time"], half)
    np.testing.assert_array_equal(second["torque"], columns_of(study)["torque_nm"][25:])


def test_time_that_restarts_within_a_trial_is_refused_at_its_row(study):
    one_recording(study, TRIALS, condition="perturbed")
    time = np.tile(np.arange(25) / 1000.0, 2)
    study.table("S01_enp.csv", lambda t: t.assign(time_s=time, trial=[1] * 20 + [2] * 30))

    assert str(refused(study)) == (
        "S01_enp.csv: row 27: time goes back (0 s after 0.024 s; 1 such row(s)). Time must "
        "increase; sort the file, or separate trials with [channels.trial]."
    )


def test_trials_may_be_given_names(study):
    named = TRIALS + 'values = { "1" = "slow" }\n'
    one_recording(study, named, condition="perturbed")
    study.table("S01_enp.csv", lambda t: t.assign(trial=[1] * 25 + [2] * 25))

    assert [p.attrs["trial"] for p in study.read()] == ["slow", "2"]


def test_conditions_and_trials_together_cut_at_every_change_of_either(study):
    one_recording(study, CONDITIONS + TRIALS)
    study.table(
        "S01_enp.csv",
        lambda t: t.assign(
            perturbed=[0] * 20 + [1] * 30, trial=["a"] * 10 + ["b"] * 25 + ["a"] * 15
        ),
    )

    pieces = study.read()

    assert [(p.attrs["condition"], p.attrs["trial"], p.sizes["time"]) for p in pieces] == [
        ("unperturbed", "a", 10),
        ("unperturbed", "b", 10),
        ("perturbed", "b", 15),
        ("perturbed", "a", 15),
    ]


def test_a_run_of_a_single_sample_is_refused(study):
    one_recording(study, TRIALS, condition="perturbed")
    study.table("S01_enp.csv", lambda t: t.assign(trial=[1] * 49 + [2]))

    assert "it has 1 sample(s); at least two are needed" in str(refused(study))


def test_cycles_are_counted_and_do_not_cut(study):
    one_recording(study, '[channels.cycle]\ncolumn = "stride"\n', condition="perturbed")
    study.table("S01_enp.csv", lambda t: t.assign(stride=["x"] * 10 + ["y"] * 30 + ["x"] * 10))

    (recording,) = study.read()

    np.testing.assert_array_equal(recording["cycle"], [0] * 10 + [1] * 30 + [0] * 10)


# --- time ----------------------------------------------------------------------------------------


def without_time(study) -> None:
    start = study.text.index("[channels.time]")
    study.text = study.text[:start] + study.text[study.text.index("[channels.angle]") :]


def test_a_sample_rate_stands_for_a_time_column(study):
    without_time(study)
    study.edit("sample_rate_hz = 1000.0", "sample_rate_hz = 500.0")

    (recording,) = study.read()

    np.testing.assert_array_equal(recording["time"], np.arange(50) / 500.0)


def test_without_a_time_column_all_pieces_of_a_file_share_its_clock(study):
    """The onsets of a pulse table would belong to every piece if each began at zero."""
    one_recording(study, CONDITIONS)
    without_time(study)
    study.table("S01_enp.csv", lambda t: t.assign(perturbed=[0] * 20 + [1] * 30))

    first, second = study.read()

    np.testing.assert_array_equal(first["time"], np.arange(20) / 1000.0)
    np.testing.assert_array_equal(second["time"], np.arange(20, 50) / 1000.0)


def test_a_time_column_at_another_rate_than_declared_is_refused(study):
    study.edit('unit = "s"', 'unit = "ms"')

    error = refused(study)

    assert str(error) == (
        "S01_enp.csv: the time column runs at 1e+06 Hz, sample_rate_hz says 1000. Correct the "
        "unit of time, or remove sample_rate_hz."
    )
    assert (error.path, error.channel) == ("S01_enp.csv", "time")


@pytest.mark.parametrize(("rate", "accepted"), [(1049.0, True), (951.0, True), (1060.0, False)])
def test_a_rate_may_be_five_percent_off(study, rate, accepted):
    study.edit("sample_rate_hz = 1000.0", f"sample_rate_hz = {rate}")

    if accepted:
        np.testing.assert_array_equal(study.read()[0]["time"], columns_of(study)["time_s"])
    else:
        assert f"runs at 1000 Hz, sample_rate_hz says {rate:g}" in str(refused(study))


def test_gaps_in_time_do_not_change_its_rate(study):
    late = np.arange(50) / 1000.0 + np.where(np.arange(50) > 25, 7.0, 0.0)
    study.table("S01_enp.csv", lambda t: t.assign(time_s=late))

    np.testing.assert_array_equal(study.read()[0]["time"], columns_of(study)["time_s"])


@pytest.mark.parametrize(
    ("cell", "problem"),
    [
        (np.nan, "row 7: the time stamp is not a number. Repair or remove the row."),
        (0.004, "row 7: time repeats (0.004 s after 0.004 s; 1 such row(s))."),
        (0.001, "row 7: time goes back (0.001 s after 0.004 s; 1 such row(s))."),
    ],
)
def test_a_bad_time_stamp_is_named_by_its_row(study, cell, problem):
    def spoil(table):
        table.loc[5, "time_s"] = cell
        return table

    study.table("S01_enp.csv", spoil)

    assert str(refused(study)).startswith(f"S01_enp.csv: {problem}")


def test_a_time_column_without_a_number_is_refused(study):
    study.table("S01_enp.csv", lambda t: t.assign(time_s=np.nan))

    assert "row 2: the time stamp is not a number" in str(refused(study))


def test_rows_are_counted_with_those_skipped(study):
    for file in ("S01_enp.csv", "S01_ewp.csv"):
        path = study.root / file
        path.write_text("exported by a program\n\n" + path.read_text())
    study.edit("[files]", "[files]\nskip_rows = 2\n#")

    assert study.read()[0].attrs["first_row"] == 4


# --- no device -----------------------------------------------------------------------------------


def test_a_recording_without_device_has_kinematics_and_contact_only(study):
    study.edit('condition = "unperturbed"', 'condition = "NWC"')
    device = ["torque_nm", "commanded_torque_nm", "ankle_position"]
    study.table("S01_enp.csv", lambda t: t.drop(columns=device))

    (recording,) = study.read()

    assert recording.attrs["condition"] == "no_device"
    assert set(recording.data_vars) == {"angle", "contact"}


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

    (recording,) = study.read()

    np.testing.assert_allclose(recording["angle"], expected, rtol=1e-12)


# --- properties ----------------------------------------------------------------------------------


def number_columns(columns: int):
    # Within half a turn, and far enough from it that the two ways of rounding agree on it.
    row = st.lists(
        st.floats(-170.0, 170.0, allow_subnormal=False), min_size=columns, max_size=columns
    )
    return st.lists(row, min_size=2, max_size=12)


STUDY = """\
jointz = 1
joint = "knee"
kind = "bench"
sample_rate_hz = 1000.0
participants = [{{ id = "a" }}]
recordings = [{{ participant = "a", condition = "perturbed", file = "a.csv" }}]
[channels]
angle = {{ column = "angle", unit = "{unit}" }}
torque = {{ column = "torque" }}
command = {{ column = "command" }}
"""


def read_columns(folder: Path, columns: dict[str, np.ndarray], unit: str = "deg") -> xr.Dataset:
    (folder / "study.toml").write_text(STUDY.format(unit=unit))
    pd.DataFrame(columns).to_csv(folder / "a.csv", index=False)
    study = open_study(folder)
    (recording,) = read_recording(study, study.spec.recordings[0])
    return recording


def three_columns(rows: list[list[float]]) -> dict[str, np.ndarray]:
    return dict(zip(("angle", "torque", "command"), np.array(rows).T, strict=True))


EXAMPLES = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@EXAMPLES
@given(rows=number_columns(3))
def test_files_in_degrees_and_in_radians_give_equal_recordings(tmp_path, rows):
    columns = three_columns(rows)
    degrees = read_columns(tmp_path, columns)

    radians = read_columns(tmp_path, columns | {"angle": np.deg2rad(columns["angle"])}, "rad")

    xr.testing.assert_allclose(degrees, radians, rtol=1e-12, atol=1e-300)


@EXAMPLES
@given(rows=number_columns(3), order=st.permutations(["angle", "torque", "command"]))
def test_the_order_of_columns_is_irrelevant(tmp_path, rows, order):
    columns = three_columns(rows)
    straight = read_columns(tmp_path, columns)

    shuffled = read_columns(tmp_path, {name: columns[name] for name in order})

    xr.testing.assert_equal(shuffled, straight)


@EXAMPLES
@given(
    rows=number_columns(3),
    name=st.text("abcxyz _", min_size=1, max_size=5),
    cell=st.one_of(st.floats(), st.text("abc 1.", max_size=5)),
    first=st.booleans(),
)
def test_columns_nobody_asked_for_are_irrelevant(tmp_path, rows, name, cell, first):
    columns = three_columns(rows)
    straight = read_columns(tmp_path, columns)
    extra = {f"other {name}": np.repeat(np.array([cell], dtype=object), len(rows))}

    more = read_columns(tmp_path, extra | columns if first else columns | extra)

    xr.testing.assert_equal(more, straight)


# --- pulse tables --------------------------------------------------------------------------------


def pulse_table(study, content: str | bytes | None = None) -> pd.DataFrame | None:
    if content is not None:
        raw = content.encode() if isinstance(content, str) else content
        (study.root / "S01_pulses.csv").write_bytes(raw)
    opened = study.open()
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


def test_a_pulse_table_is_read_as_it_stands(study):
    table = pulse_table(
        study,
        "timing_point,onset_s,amplitude_nm,duration_s\nLRE,0.021,5.0,0.009\n MST , 0.5 ,-5,2e-1\n",
    )

    expected = pd.DataFrame(
        {
            "onset_s": [0.021, 0.5],
            "duration_s": [0.009, 0.2],
            "amplitude_nm": [5.0, -5.0],
            "timing_point": ["LRE", "MST"],
        }
    )
    pd.testing.assert_frame_equal(table, expected, check_dtype=False)
    assert [str(dtype) for dtype in table.dtypes.iloc[:3]] == ["float64"] * 3


@pytest.mark.parametrize("suffix", [".gz", ".xz", ".bz2", ".zip"])
def test_a_packed_pulse_table_is_refused(study, suffix):
    study.text = study.text.replace("S01_pulses.csv", f"S01_pulses.csv{suffix}")
    pd.DataFrame({"onset_s": [0.5]}).to_csv(study.root / f"S01_pulses.csv{suffix}")
    with pytest.raises(DataError, match=rf"csv{suffix}: not a readable.* that is not compressed"):
        pulse_table(study)


@pytest.mark.parametrize(
    "content",
    [
        "onset_s\n0.5\n",
        "onset_s,duration_s,amplitude_nm,timing_point\n0.5,,,\n",
        "onset_s,duration_s,amplitude_nm,timing_point\n0.5, , ,  \n",
        "onset_s,timing_point\n0.5\n",
        "onset_s,duration_s\n0.5\n",
        "\ufeffonset_s,duration_s\r\n0.5,\r\n",
    ],
)
def test_what_a_pulse_table_leaves_out_is_missing(study, content):
    table = pulse_table(study, content)

    assert table["onset_s"].tolist() == [0.5]
    assert table[["duration_s", "amplitude_nm"]].isna().all(axis=None)
    assert table["timing_point"].tolist() == [""]


@pytest.mark.parametrize("content", ["onset_s\n", "onset_s,duration_s,timing_point\n"])
def test_a_pulse_table_may_be_empty(study, content):
    table = pulse_table(study, content)

    assert table.shape == (0, 4)
    assert table["onset_s"].dtype == float


def test_empty_lines_in_a_pulse_table_are_no_pulses(study):
    table = pulse_table(study, "onset_s,timing_point\n0.5,LRE\n\n , \n0.7,MST\n\n")

    assert table["onset_s"].tolist() == [0.5, 0.7]
    assert table["timing_point"].tolist() == ["LRE", "MST"]


COLUMNS = "onset_s, duration_s, amplitude_nm, timing_point"


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("onset,duration_s", "onset, duration_s"),
        ("duration_s,amplitude_nm", "duration_s, amplitude_nm"),
        ("onset_s,trial", "onset_s, trial"),
    ],
)
def test_other_columns_in_a_pulse_table_are_refused(study, header, found):
    error = refused_table(study, f"{header}\n1,2\n")

    assert str(error) == (
        f"S01_pulses.csv: a pulse table has the columns {COLUMNS} (onset_s is required), got "
        f"{found}. Correct the header."
    )


@pytest.mark.parametrize("mark", [";", "\t"])
def test_a_pulse_table_without_commas_is_told_about_them(study, mark):
    error = refused_table(study, f"onset_s{mark}duration_s\n0{mark}1\n")

    assert str(error) == (
        f"S01_pulses.csv: a pulse table has the columns {COLUMNS} (onset_s is required), got "
        f"onset_s{mark}duration_s. Put commas between the columns, and points into numbers: "
        "[files] is not for it."
    )
    error = refused_table(study, f"onset_s{mark}duration_s\n0,5{mark}0,25\n")
    assert str(error) == (
        "S01_pulses.csv, row 2: expected 1 values as in the header, found more. Put commas between "
        "the columns, and points into numbers: [files] is not for it."
    )


def test_a_column_given_twice_is_refused(study):
    assert "got onset_s, onset_s.1." in str(refused_table(study, "onset_s,onset_s\n1,2\n"))


@pytest.mark.parametrize("cell", ["early", "", "nan", "NaN", "inf", "-inf", "1 s", "1,5", "0x10"])
def test_an_onset_that_is_no_number_is_refused(study, cell):
    error = refused_table(study, f'onset_s,timing_point\n0.5,LRE\n"{cell}",LRE\n')

    assert str(error) == (
        f"S01_pulses.csv, row 3, column 'onset_s': expected a number, found '{cell}'. "
        "Correct the cell."
    )
    assert (error.row, error.channel) == (3, "onset_s")


@pytest.mark.parametrize("column", ["duration_s", "amplitude_nm"])
@pytest.mark.parametrize("cell", ["long", "nan", "inf", "5 Nm"])
def test_text_in_an_optional_column_is_refused(study, column, cell):
    error = refused_table(study, f"onset_s,{column}\n0.5,\n0.7,{cell}\n")

    assert f"row 3, column '{column}': expected a number, found '{cell}'" in str(error)


def test_the_row_of_a_bad_cell_counts_empty_lines(study):
    error = refused_table(study, "onset_s,duration_s\n0.5,0.1\n\n\n0.7,long\n")

    assert error.row == 5
    assert "row 5, column 'duration_s'" in str(error)


def test_a_first_row_with_more_cells_than_the_header_is_refused(study):
    assert str(refused_table(study, "onset_s,timing_point\n0.5,LRE,1\n0.7,MST,1\n")) == (
        "S01_pulses.csv, row 2: expected 2 values as in the header, found more. Correct the rows."
    )


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        ("onset_s\n0.5\n0.7,1\n", "Expected 1 fields in line 3, saw 2"),
        ("", "No columns to parse from file"),
        (b"onset_s,timing_point\n0.5,\xff\n", "utf-8"),
    ],
)
def test_a_pulse_table_that_is_no_table_is_refused(study, content, cause):
    message = str(refused_table(study, content))

    assert message.startswith("S01_pulses.csv: not a readable pulse table (")
    assert cause in message
    assert message.endswith("or export it again, as plain text that is not compressed.")


def test_a_pulse_table_that_vanished_is_a_data_error(study):
    opened = study.open()
    (study.root / "S01_pulses.csv").unlink()

    with pytest.raises(DataError, match=r"S01_pulses\.csv: not a readable pulse table"):
        read_pulse_table(opened, opened.spec.recordings[1])


@EXAMPLES
@given(content=st.text('onset_s,timing_point\n\r 0.5"-e;', max_size=60))
def test_any_text_is_a_pulse_table_or_a_data_error(study, content):
    try:
        table = pulse_table(study, "onset_s,timing_point\n" + content)
    except DataError:
        return
    assert list(table.columns) == ["onset_s", "duration_s", "amplitude_nm", "timing_point"]
    assert np.isfinite(table["onset_s"]).all()
