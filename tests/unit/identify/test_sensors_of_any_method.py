"""Sensors that contradict the angle, for every method, and a dead goniometer."""

from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture(scope="module")
def walked(walkers):
    walker = walkers.Walker()
    return walker, walkers.walk(walker)


def with_sensors(given, *, of_angle):
    time, angle = given.recording["time"].to_numpy(), given.recording["angle"].to_numpy()
    noise = np.random.default_rng(3).standard_normal((2, time.size))
    encoder = angle + 1e-3 * noise[0]
    sensors = {
        "angle": of_angle * angle,
        "joint_encoder": encoder,
        "shank_velocity": np.gradient(encoder, time),
        "thigh_velocity": 1e-3 * noise[1],
    }
    channels = {name: ("time", values) for name, values in sensors.items()}
    return replace(given, recording=given.recording.assign(channels))


def statuses(result):
    return {p.status for cells in result.cells.values() for c in cells for p in c.parameters}


def test_an_angle_that_its_sensors_contradict_gives_no_value(walkers, walked):
    walker, given = walked
    method = ("least_squares",)
    right = walkers.analyze(walker, with_sensors(given, of_angle=1.0), methods=method)
    assert "ok" in statuses(right)
    wrong = walkers.analyze(walker, with_sensors(given, of_angle=0.6), methods=method)
    assert statuses(wrong) == {"failed:sensors_disagree"}


def test_a_goniometer_without_motion_beside_sensors_is_refused(walkers, walked):
    walker, given = walked
    result = walkers.analyze(walker, with_sensors(given, of_angle=0.0))
    assert "ok" not in statuses(result)
