"""The angle without the pulse: known after a few strides, and right where strides repeat."""

from math import cos, pi, sin
from types import SimpleNamespace

import pytest

from jointz.core.protocols.protocol_models import GaitSpec
from jointz.rig.experiment.gait.phase_predictor import StridePhase
from jointz.rig.experiment.gait.unperturbed_angle import UnperturbedAngle

MS = 1_000_000
PERIOD = 2 * MS
STRIDE = 1_100 * MS
W = 2.0 * pi / 1.1  # of the cycle, rad/s


def knee(time_ns, *, late_ns=0):
    """Return angle and velocity of a knee that swings once a stride."""
    at = W * (time_ns - late_ns) * 1e-9
    return 0.5 + 0.5 * sin(at), 0.5 * W * cos(at)


class Walk:
    """Strides of one length, tick by tick."""

    def __init__(self):
        self.strides = StridePhase(GaitSpec(speed_m_s=1.2))
        self.unperturbed = UnperturbedAngle(PERIOD)
        self.now = 0
        self.knee = knee

    def until(self, time_ns, *, pulse=False, extra=0.0, retracted_at=None):
        while self.now + PERIOD <= time_ns:
            self.now += PERIOD
            accepted = self.now % STRIDE == 0 and self.strides.strike(self.now)
            retracted = self.now == retracted_at
            if retracted:
                self.strides.retract()
            angle, velocity = self.knee(self.now)
            self.unperturbed.learn(
                self.now,
                self.strides,
                (angle + extra, velocity),
                accepted=accepted,
                retracted=retracted,
                pulse=pulse,
            )
        return self

    def displacement(self, *, extra=0.0, late_ns=0, ticks=125):
        """Return the displacements of a pulse from now on."""
        found = []
        for tick in range(ticks):
            at = self.now + tick * PERIOD
            angle, velocity = knee(at, late_ns=late_ns)
            if tick == 0:
                self.unperturbed.begin(at, self.strides, (angle, velocity))
            else:
                self.unperturbed.follow(at, (angle + extra, velocity + 10.0 * extra))
            found.append((self.unperturbed.displacement, self.unperturbed.rate))
        return found


def test_nothing_is_known_before_three_whole_strides():
    walk = Walk().until(4 * STRIDE - PERIOD)
    assert not walk.unperturbed.known  # the first strike ends no stride
    assert walk.until(4 * STRIDE).unperturbed.known


@pytest.mark.parametrize("phase", [0.07, 0.405, 0.81])
def test_a_knee_that_repeats_itself_is_not_displaced_even_over_a_heel_strike(phase):
    walk = Walk().until(6 * STRIDE).until(6 * STRIDE + round(phase * STRIDE))
    found = walk.displacement()
    assert found[0][0] == 0.0
    assert max(abs(x) for x, _ in found) < 0.002
    assert max(abs(rate) for _, rate in found) < 0.02


def test_a_phase_that_rounding_puts_before_the_heel_strike_is_one_of_the_cycle():
    walk = Walk().until(6 * STRIDE)
    strides = SimpleNamespace(mean_ns=STRIDE, phase_pct=lambda _: -1e-16)
    walk.unperturbed.begin(walk.now, strides, knee(walk.now))
    assert walk.unperturbed.displacement == 0.0


def test_what_a_pulse_adds_is_the_displacement():
    walk = Walk().until(6 * STRIDE + 200 * MS)
    found = walk.displacement(extra=0.15)
    assert found[0][0] == 0.0
    assert found[50] == (pytest.approx(0.15, abs=0.002), pytest.approx(1.5, abs=0.02))


@pytest.mark.parametrize("late_ms", [-40, 40])
def test_a_stride_that_is_early_or_late_in_its_cycle_is_followed(late_ms):
    walk = Walk().until(6 * STRIDE)
    walk.knee = lambda time_ns: knee(time_ns, late_ns=late_ms * MS)
    walk.until(6 * STRIDE + 400 * MS)
    # Without a fit of the time it would be 0.5 rad * 2 pi * 40 / 1100, turned round: 0.1 rad.
    found = walk.displacement(late_ns=late_ms * MS)
    assert max(abs(x) for x, _ in found) < 0.03


def test_a_stride_with_a_pulse_and_the_one_after_it_are_left_out():
    walk = Walk().until(6 * STRIDE + 100 * MS)
    walk.until(6 * STRIDE + 300 * MS, pulse=True, extra=1.0)
    walk.until(8 * STRIDE - PERIOD, extra=1.0).until(16 * STRIDE)
    assert max(abs(x) for x, _ in walk.displacement()) < 0.002


def test_after_ten_strides_an_old_one_is_forgotten():
    walk = Walk().until(3 * STRIDE, extra=1.0).until(14 * STRIDE + 200 * MS)
    assert max(abs(x) for x, _ in walk.displacement()) < 0.002


def test_a_stride_whose_strike_was_none_is_taken_out_again():
    walk = Walk().until(4 * STRIDE)
    assert walk.unperturbed.known
    walk.until(4 * STRIDE + 60 * MS, retracted_at=4 * STRIDE + 60 * MS)
    assert not walk.unperturbed.known
    # Nor is the stride in which that was found, and the one after it.
    walk.until(6 * STRIDE)
    assert not walk.unperturbed.known
    assert walk.until(7 * STRIDE).unperturbed.known


def test_a_stride_with_an_angle_that_is_no_number_is_left_out():
    walk = Walk().until(3 * STRIDE + 100 * MS)
    walk.until(3 * STRIDE + 120 * MS, extra=float("nan")).until(4 * STRIDE)
    assert not walk.unperturbed.known
