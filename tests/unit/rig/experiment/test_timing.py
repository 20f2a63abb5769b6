"""The timing report, against ticks whose lateness is known."""

import numpy as np
import pytest

from jointz.core.session_log import WALKING, Flag
from jointz.rig.experiment.timing import timing_report

PERIOD = 2_000_000


def ticks(slots, late_ns=0, *, busy_us=10.0, first=7, parts=1):
    """Return records of ticks in given slots that begin late."""
    slots = np.asarray(slots)
    records = np.zeros(slots.size * parts, WALKING.dtype)
    records["slot"] = np.repeat(slots, parts)
    records["host_time_ns"] = np.repeat((slots + first) * PERIOD + late_ns, parts)
    records["busy_us"] = np.repeat(np.broadcast_to(busy_us, slots.shape), parts)
    records["part"] = np.tile(np.arange(parts), slots.size)
    return records


def test_lateness_is_counted_from_the_slot():
    late_us = np.arange(1001.0)
    report = timing_report(ticks(range(1001), (late_us * 1000).astype(int)), PERIOD)
    assert report["lateness_us"] == pytest.approx(
        {"p50": 500.0, "p99": 990.0, "p99_9": 999.0, "max": 1000.0}
    )
    assert report["period_error_us"]["max"] == pytest.approx(1.0)


def test_skipped_slots_are_counted_and_are_no_error_of_the_period():
    slots = [0, 1, 2, 5, 6, 9, 10]
    report = timing_report(ticks(slots), PERIOD)
    assert (report["ticks"], report["missed_slots"]) == (7, 4)
    assert report["period_error_us"]["max"] == 0.0
    assert report["mean_rate_hz"] == pytest.approx(6 / 10 * 500.0)


def test_the_records_of_a_tick_count_once():
    assert timing_report(ticks(range(50), parts=3), PERIOD) == timing_report(
        ticks(range(50)), PERIOD
    )


def test_work_of_the_tick_before_the_first_is_left_out():
    busy = np.full(100, 12.0)
    busy[0] = 1e6
    assert timing_report(ticks(range(100), busy_us=busy), PERIOD)["busy_us"]["max"] == 12.0


@pytest.mark.parametrize("count", [0, 1])
def test_a_loop_of_less_than_two_ticks_has_no_timing(count):
    report = timing_report(ticks(range(count)), PERIOD)
    assert report == {"ticks": count, "missed_slots": 0, "clamped_ticks": 0}


def test_ticks_whose_torque_was_cut_are_counted():
    records = ticks(range(10))
    records["flags"][[0, 1, 4, 5]] = Flag.CLAMPED  # in the first two nothing was asked for
    records["requested_torque"][1] = np.nan  # nor is there a request without a velocity
    records["requested_torque"][[4, 5, 8]] = 2.0
    records["sent_torque"][4] = 1.0
    assert timing_report(records, PERIOD)["clamped_ticks"] == 2
