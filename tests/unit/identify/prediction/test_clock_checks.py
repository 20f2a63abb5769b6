"""An angle whose own clock drifts or starts wrongly has no estimates, and the notes say so."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest


def with_other_clock(given, *, ppm=0.0, late_s=0.0, joined=True):
    """Return a recording whose angle was stamped by a clock that runs otherwise."""
    recording = given.recording
    time = recording["time"].to_numpy()
    shown = np.interp(time, time * (1.0 + 1e-6 * ppm) + late_s, recording["angle"].to_numpy())
    recording = recording.assign(angle=recording["angle"].copy(data=shown))
    step = {"step": "joined", "channels": ["angle"], "sampled_hz": 240.0}
    history = json.dumps([step] if joined else [])
    return replace(given, recording=recording.assign_attrs(history=history))


@pytest.fixture(scope="module")
def walk(walkers):
    walker = walkers.Walker(noise_rad=np.radians(0.1), known_lag_sd_s=None)
    return walker, walkers.walk(walker)


def statuses(result):
    return {p.status for cells in result.cells.values() for c in cells for p in c.parameters}


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (
            {"ppm": 120.0, "late_s": -0.008},
            "failed:clocks_drift",
            r"moves by [12]\d(\.\d)? ms against the torque",
        ),
        ({"late_s": -0.03}, "failed:out_of_step", r"moves 2\d(\.\d)? ms before the torque"),
    ],
)
def test_a_wrong_clock_is_found_by_the_responses(walkers, walk, error, code, told):
    walker, given = walk
    result = walkers.analyze(walker, with_other_clock(given, **error))
    assert "ok" not in statuses(result)
    assert code in statuses(result)
    assert any(re.search(told, note) for note in result.notes)


def test_a_right_clock_is_noted_and_widens_a_calibrated_lag(walkers, walk):
    walker, _ = walk
    known = replace(walker, known_lag_sd_s=0.0001)
    given = walkers.walk(known)
    one, two = (
        walkers.analyze(known, with_other_clock(given, joined=joined)) for joined in (False, True)
    )
    assert not any("another clock" in note for note in one.notes)
    assert any("angle: sampled at 240 Hz by another clock" in note for note in two.notes)
    widths = [
        next(
            p.ci_high - p.ci_low
            for p in result.cells["bayesian"][0].parameters
            if p.name == "damping"
        )
        for result in (one, two)
    ]
    assert widths[1] > 1.02 * widths[0]
