"""The schema of a recording: what is refused, where, and all of it at once."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError
from jointz.core.recording import (
    build_recording,
    deflection,
    history_of,
    validate_recording,
    with_history,
)

TIME = np.arange(5) / 100.0


def problem(time, first_row: int = 1, **channels) -> str:
    with pytest.raises(DataError) as caught:
        build_recording(time, channels, first_row=first_row, file="a.csv")
    assert str(caught.value).startswith("a.csv: ")
    return str(caught.value).removeprefix("a.csv: ")


def spoiled(change) -> str:
    """Change a good recording and return what is said about it."""
    with pytest.raises(DataError) as caught:
        validate_recording(change(build_recording(TIME, {"angle": TIME})))
    return str(caught.value)


# --- building ------------------------------------------------------------------------------------


def test_channels_get_the_units_of_their_names_or_their_own():
    recording = build_recording(
        [0, 1],
        {name: [1, np.nan] for name in [*CHANNEL_UNITS, "mine"][1:]},
        units={"reference": "N*m"},
    )

    for name, units in list(CHANNEL_UNITS.items())[1:]:
        assert recording[name].attrs["units"] == ("N*m" if name == "reference" else units[0])
        assert recording[name].dtype == recording["time"].dtype == np.float64
        assert np.isnan(recording[name][1])
    assert recording["mine"].attrs["units"] == "1"
    assert recording["time"].attrs["units"] == "s"


def test_attributes_are_there_whether_given_or_not():
    recording = build_recording(TIME, {}, first_row=7, participant="S01", side="left")

    texts = {k: v for k, v in recording.attrs.items() if isinstance(v, str) and v}
    assert texts == {"participant": "S01", "side": "left", "history": "[]"}
    assert recording.attrs["first_row"] == 7
    assert recording.attrs["sha256"] == recording.attrs["trial"] == ""


def test_channels_of_another_length_are_refused_with_their_shapes():
    told = problem(TIME, angle=TIME[:3], torque=np.zeros((5, 2)))

    assert "'angle': (3,), 'torque': (5, 2)" in told


# --- time ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1])
def test_two_samples_are_needed(n):
    with pytest.raises(DataError, match=rf"it has {n} sample\(s\); at least two") as caught:
        build_recording(TIME[:n], {}, file="a.csv")
    assert caught.value.path == "a.csv"


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_time_stamp_that_is_no_number_is_named_by_its_row(bad):
    time = TIME.copy()
    time[[2, 4]] = bad

    assert problem(time, first_row=2).startswith("row 4: ")


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20, unique=True),
    st.integers(min_value=1, max_value=100),
)
def test_time_in_order_is_accepted_and_any_other_order_names_the_first_row(stamps, first_row):
    in_order = np.array(sorted(stamps))
    assert build_recording(in_order, {}).sizes["time"] == len(stamps)
    given_rows = [k for k in range(1, len(stamps)) if stamps[k] <= stamps[k - 1]]
    if given_rows:
        told = problem(np.array(stamps), first_row=first_row)
        assert told.startswith(f"row {first_row + given_rows[0]}: ")


# --- validating a dataset of another origin ------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        lambda r: r.drop_vars("time"),
        lambda r: r.assign_coords(time=np.arange(5).astype("datetime64[ns]")),
        lambda r: r.assign_coords(time=np.arange(5)),
        lambda _: xr.Dataset({"angle": ("row", TIME)}, coords={"time": ("row", TIME)}),
    ],
    ids=["none", "dates", "whole numbers", "of another dimension"],
)
def test_time_must_be_a_coordinate_of_seconds_as_floats(change):
    assert "coordinate 'time'" in spoiled(change)


def test_all_problems_stand_in_one_message():
    def spoil(recording):
        recording = recording.assign_coords(time=TIME[::-1]).assign_attrs(file="b.nc", first_row=3)
        recording["angle"].attrs["units"] = "deg"
        recording["torque"] = ("time", np.arange(5))
        recording["reference"] = ("time", TIME, {"units": "s"})
        recording["mine"] = (("time", "axis"), np.zeros((5, 3)))
        return recording

    told = spoiled(spoil)
    assert told.startswith("b.nc: row 4: ")
    assert re.findall("channel '([a-z]+)'", told) == [
        "angle", "torque", "torque", "reference", "mine",
    ]  # fmt: skip


# --- history -------------------------------------------------------------------------------------


def test_a_step_is_added_and_the_recording_left_alone():
    recording = build_recording(TIME, {"angle": TIME}, history=({"step": "read"},))

    changed = with_history(recording, "filter", cutoff_hz=20.0, order=4)

    assert history_of(recording) == [{"step": "read"}]
    assert history_of(changed) == [
        {"step": "read"},
        {"step": "filter", "cutoff_hz": 20.0, "order": 4},
    ]
    assert isinstance(json.loads(changed.attrs["history"]), list)
    xr.testing.assert_equal(changed, recording)
    assert history_of(xr.Dataset()) == []


def test_the_far_side_of_a_bench_is_a_position_that_is_an_angle():
    channels = {"angle": TIME, "position": 2.0 * TIME}

    def bent(channels, **units):
        return deflection(build_recording(TIME, channels, units=units))

    np.testing.assert_array_equal(bent(channels, position="rad"), -TIME)
    np.testing.assert_array_equal(bent(channels, position="m"), TIME)
    np.testing.assert_array_equal(bent({"angle": TIME}), TIME)
