import numpy as np
import pandas as pd
import pytest
import xarray as xr

from jointz.core.errors import DataError
from jointz.identify.series.joint_record import check_choice, gather_record

TIME = np.arange(100) / 100.0
CHANNELS = {"angle": np.sin(TIME), "torque": np.cos(TIME), "time": TIME}
NOTHING = dict.fromkeys(CHANNELS)


def gather(recording=None, rate_hz=None, **arrays):
    return gather_record(recording, NOTHING | arrays, rate_hz=rate_hz, where="here")


@pytest.mark.parametrize(
    "make",
    [
        dict,
        pd.DataFrame,
        lambda c: xr.Dataset(
            {n: ("time", v) for n, v in c.items() if n != "time"}, coords={"time": c["time"]}
        ),
    ],
)
def test_any_kind_of_recording_is_read(make):
    record = gather(make(CHANNELS))

    assert record.rate_hz == pytest.approx(100.0)
    assert record.channels.keys() == {"angle", "torque"}
    assert record.channels["angle"] == pytest.approx(CHANNELS["angle"])


def test_arrays_with_a_rate_are_read():
    record = gather(angle=CHANNELS["angle"], torque=CHANNELS["torque"], rate_hz=50.0)

    assert record.time[-1] == pytest.approx(99 / 50.0)


def test_jittered_stamps_end_on_a_uniform_grid():
    time = TIME + np.random.default_rng(0).uniform(-3e-3, 3e-3, TIME.size)

    record = gather(CHANNELS | {"time": time, "angle": 2.0 * time})

    assert np.ptp(np.diff(record.time)) < 1e-12
    assert record.channels["angle"] == pytest.approx(2.0 * record.time)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": np.zeros(50)}, "equally long.*different rates"),
        ({"angle": np.where(TIME[7] == TIME, np.nan, 0.0)}, "without a number, the first in row 8"),
        ({"time": TIME[::-1]}, "row 2: time does not increase"),
        ({"time": TIME + (TIME > 0.5)}, "row 51: a gap of 1.01 s"),
        ({"time": np.where(TIME < 0.5, TIME, 2 * TIME - 0.5)}, "sampling rate changes.*50 to 100"),
    ],
)
def test_a_record_that_cannot_be_trusted_is_refused(change, message):
    with pytest.raises(DataError, match=message):
        gather(CHANNELS | change)


def test_all_problems_are_told_at_once():
    with pytest.raises(DataError, match=r"^here: no channel 'torque'.*without a number"):
        gather({"angle": [0.0, np.nan, 1.0], "time": [0.0, 1.0, 2.0]})


def test_the_rate_must_be_known_once():
    arrays = {n: CHANNELS[n] for n in ("angle", "torque")}
    with pytest.raises(DataError, match="got no time and rate_hz None"):
        gather(arrays)
    with pytest.raises(DataError, match="got both"):
        gather(CHANNELS, rate_hz=100.0)
    with pytest.raises(ValueError, match="a recording and angle"):
        gather(CHANNELS, angle=TIME)


def test_a_choice_lists_what_may_be_chosen():
    with pytest.raises(ValueError, match="input: expected one of torque, angle; got 'force'"):
        check_choice("input", "force", ("torque", "angle"))
