"""The benchmark of the limit of displacement: one person, one pulse at each timing point."""

import pytest
from benchmarks.displacement_limit import protocol_of, session_of, summary

LIMIT_RAD = 0.2


@pytest.mark.parametrize(
    "preset", ["nominal", pytest.param("anthropometric", marks=pytest.mark.slow)]
)
def test_pulses_on_a_leg_half_as_stiff_are_cut(preset):
    found = session_of(protocol_of(1), preset, 0, [LIMIT_RAD], seed=1)[LIMIT_RAD]
    assert "6 beyond it without the limit" in summary(LIMIT_RAD, found)
    assert "cut 6, of these false 0; beyond the limit and not cut 0" in summary(LIMIT_RAD, found)
    assert all(pulse.peak < pulse.peak_without_limit for pulse in found)
    # Where one stride is unlike the mean, the prediction is off: docs/safety.md says how far.
    assert sorted(pulse.at_cut for pulse in found)[-2] < LIMIT_RAD
