"""Notes about channels that another clock sampled."""

import numpy as np

from jointz.core.recording import build_recording
from jointz.identify.preparation.channel_clocks import clock_notes


def test_levels_are_not_said_to_be_interpolated():
    step = {"step": "joined", "channels": ["angle", "trigger"], "sampled_hz": 50.0}
    time = np.arange(0.0, 1.0, 1e-3)
    recording = build_recording(time, {"torque": time}, file="S01.mat", history=(step,))
    levels, signals = clock_notes([recording])
    assert "trigger: sampled at 50 Hz" in levels
    assert "up to 20 ms late" in levels
    assert "angle: sampled at 50 Hz" in signals
    assert "trigger" not in signals
