"""What a bench trial asks for, tick by tick."""

import numpy as np
import pytest

from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.rig.experiment.bench.bench_plan import bench_course, make_bench_plan

PULSE = PulseSpec(
    amplitude_nm=7.0,
    duration_s=0.25,
    ramp_up_s=0.075,
    hold_s=0.1,
    ramp_down_s=0.075,
    direction="both",
)
SINE = {"kind": "sine", "amplitude": 5.0, "frequency_hz": 1.4, "offset": 32.0}
POINTS = {"loading": 10.0, "stance": 40.0, "toe_off": 60.0, "swing": 90.0}


def condition(**changes):
    plan = {"timing_points": POINTS, "count_per_point": 2, "pause_s": 0.65, "order": "cyclic"}
    content = {
        "name": "A",
        "condition": "perturbed",
        "prompt": "Go.",
        "torque_nm": SINE,
        "perturbations": plan,
    }
    return ConditionSpec.model_validate({**content, **changes})


def course(spec, pulses=(), *, duration_s=12.0, rate_hz=900.0):
    return bench_course(
        spec, pulses, PULSE, duration_s=duration_s, rate_hz=rate_hz, rng=np.random.default_rng(1)
    )


def test_every_point_is_pushed_once_either_way():
    plan = make_bench_plan(condition(), (PULSE,), np.random.default_rng(3))

    assert [p.timing_point for p in plan] == list(POINTS) * 2
    for point in POINTS:
        signs = sorted(p.amplitude_nm for p in plan if p.timing_point == point)
        assert signs == [-7.0, 7.0]
    assert [p.number for p in plan] == list(range(1, 9))


def test_pulses_after_rests_alternate():
    plan = make_bench_plan(
        condition(perturbations={"count": 20, "pause_s": 2.75, "order": "cyclic"}),
        (PULSE,),
        np.random.default_rng(3),
    )

    signs = np.sign([p.amplitude_nm for p in plan])
    assert (signs[1:] == -signs[:-1]).all()
    assert plan[-1].onset_s == pytest.approx(59.75)


def test_a_course_is_led_to_its_reference_and_back():
    spec = condition()
    made = course(spec)
    torque = np.array(made.torque)

    assert (made.first, made.stop, torque.size) == (1800, 1800 + 10_800, 1800 + 10_800 + 900)
    assert torque[0] == 0.0
    assert torque[900:1801] == pytest.approx(32.0)
    time = np.arange(10_800) / 900.0
    assert torque[1800:12_600] == pytest.approx(32.0 + 5.0 * np.sin(2 * np.pi * 1.4 * time))
    assert torque[-1] == pytest.approx(0.0, abs=0.05)
    # As slow as a human eye could follow: no step anywhere.
    assert np.abs(np.diff(torque)).max() < 0.1


def test_pulses_are_trapezoids_that_begin_at_the_nearest_tick():
    spec = condition()
    plan = make_bench_plan(spec, (PULSE,), np.random.default_rng(3))
    made = course(spec, plan)
    command, number = np.array(made.command), np.array(made.pulse)

    for pulse in plan:
        ticks = np.flatnonzero(number == pulse.number)
        assert (ticks[0] - made.first) / 900.0 == pytest.approx(pulse.onset_s, abs=0.5 / 900)
        shape = command[ticks]
        assert ticks.size == 225
        assert shape[68:157] == pytest.approx(pulse.amplitude_nm)
        assert shape.sum() / 900.0 == pytest.approx(pulse.amplitude_nm * 0.175, rel=1e-3)
    assert (command[number == 0] == 0.0).all()


def test_a_velocity_is_followed_as_a_position_and_held_in_the_end():
    steps = {"kind": "steps", "levels": [-5.0, 5.0], "hold_s": 1.0}
    made = course(
        condition(torque_nm=None, perturbations=None, velocity_rad_s=steps),
        duration_s=2.0,
        rate_hz=500.0,
    )
    position = np.array(made.position)[made.first : made.stop]

    assert np.diff(position[:500]) * 500.0 == pytest.approx(-5.0)
    assert np.diff(position[500:]) * 500.0 == pytest.approx(5.0)
    assert set(made.position[made.stop :]) == {position[-1]}
    assert (made.torque_controlled, made.position_controlled) == (False, True)


def test_without_any_reference_the_torque_is_held_at_zero():
    made = course(condition(torque_nm=None, perturbations=None), duration_s=1.0)

    assert not np.any(made.torque)
    assert (made.torque_controlled, made.position_controlled) == (True, False)
