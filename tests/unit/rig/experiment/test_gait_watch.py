"""Phase at every tick out of samples that come when they come."""

from math import isnan, nan

import pytest

from jointz.core.protocols.protocol_models import GaitSpec
from jointz.rig.devices.interface import SensorSample
from jointz.rig.experiment.gait.gait_watch import GaitWatch

GAIT = GaitSpec(speed_m_s=1.2)
MS = 1_000_000
PERIOD = 2 * MS
STRIDE = 1_100 * MS


def on(time_ns):
    """A foot that is on the ground for 60 % of strides that begin at multiples of a stride."""
    return 1.0 if time_ns % STRIDE < 0.6 * STRIDE else 0.0


class Walk:
    """Feeds a watch with samples of a switch, tick by tick."""

    def __init__(self, *levels, sample_ns=PERIOD, clock_ns=0, arrives=lambda _: True):
        self.watch = GaitWatch(GAIT, *levels)
        self.tick = -1
        self.accepted = []
        self.retracted = []
        self._sample_ns, self._clock_ns, self._arrives = sample_ns, clock_ns, arrives
        self._queue = []
        self._next_ns = 0

    def until(self, time_ns, switch=on, knee=lambda _: nan):
        while (self.tick + 1) * PERIOD <= time_ns:
            self.tick += 1
            slot_ns = self.tick * PERIOD
            while self._next_ns <= slot_ns:
                self._queue.append(self._next_ns)
                self._next_ns += self._sample_ns
            times, self._queue = (
                (self._queue, []) if self._arrives(self.tick) else ([], self._queue)
            )
            contact = [SensorSample(t + self._clock_ns, slot_ns, switch(t)) for t in times]
            angle = [SensorSample(t + self._clock_ns, slot_ns, knee(t)) for t in times]
            if self.watch.update(slot_ns, angle, contact):
                self.accepted.append(slot_ns)
            if self.watch.retracted:
                self.retracted.append(slot_ns)
        return self.watch


def test_phase_is_none_until_gait_is_steady_and_then_grows_with_time():
    walk = Walk()
    watch = walk.until(4 * STRIDE - PERIOD)
    assert not watch.steady
    assert isnan(watch.phase_pct)
    assert walk.accepted == [2 * STRIDE, 3 * STRIDE]
    walk.until(5 * STRIDE + 77 * MS)
    assert watch.steady
    assert watch.phase_pct == pytest.approx(100 * 76 / 1100, abs=0.01)  # of the newest tick
    assert watch.strides.strides == 4
    assert watch.last_stride_ns == 5 * STRIDE


@pytest.mark.parametrize("clock_ns", [-5 * 10**9, 0, 1_700_000_000 * 10**9])
def test_devices_need_not_share_the_clock_of_the_host(clock_ns):
    watch = Walk(clock_ns=clock_ns).until(6 * STRIDE + 550 * MS)
    assert watch.phase_pct == pytest.approx(50.0, abs=0.01)
    assert watch.strides.mean_ns == STRIDE


def test_samples_that_come_in_bursts_are_placed_by_their_own_time():
    walk = Walk(sample_ns=MS, arrives=lambda tick: tick % 5 == 4)
    watch = walk.until(7 * STRIDE + 8 * MS)
    # The newest of a burst is taken to be as old as its tick: all strikes are late alike.
    assert watch.strides.mean_ns == pytest.approx(STRIDE, abs=5 * PERIOD)
    assert watch.strides.strides == 6


def test_a_brush_against_the_switch_costs_no_strike():
    walk = Walk()

    def brushed(time):
        return 1.0 if 900 * MS <= time - 6 * STRIDE < 930 * MS else on(time)

    watch = walk.until(7 * STRIDE, brushed)
    assert walk.retracted == [6 * STRIDE + 960 * MS]
    assert walk.accepted[-2:] == [6 * STRIDE + 900 * MS, 7 * STRIDE]
    assert watch.steady
    assert watch.strides.strides == 6
    assert watch.strides.mean_ns == STRIDE


def test_a_footswitch_that_falls_silent_makes_the_phase_none():
    walk = Walk()
    walk.until(6 * STRIDE)
    watch = walk.until(8 * STRIDE, lambda _: 0.0)
    assert not watch.steady
    assert isnan(watch.phase_pct)
    assert watch.last_stride_ns == 6 * STRIDE


def test_a_switch_that_gives_volts_strikes_at_its_calibrated_levels():
    def volts(time_ns):
        return 0.8 + 1.6 * on(time_ns)  # never off for one that is 0 or 1

    blind, told = Walk(), Walk((1.2, 1.9))
    blind.until(5 * STRIDE, switch=volts)
    told.until(5 * STRIDE, switch=volts)
    assert blind.accepted == []
    assert told.accepted == [k * STRIDE for k in (2, 3, 4, 5)]


def test_the_knee_tells_a_phase_of_its_own():
    def knee(time):
        at = (time / STRIDE) % 1
        return 0.1 + max(0.0, 1.0 - abs(at - 0.722) / 0.15)

    watch = Walk().until(6 * STRIDE + 330 * MS, knee=knee)
    assert watch.shadow_phase_pct == pytest.approx(30.0, abs=0.5)
    still = Walk().until(6 * STRIDE + 330 * MS)
    assert isnan(still.shadow_phase_pct)
    assert still.steady
