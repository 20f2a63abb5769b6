"""Heel strikes and strides of real treadmill walking with holes in its time stamps.

Moore, Hnat, van den Bogert (2015), PeerJ 3:e918; and a vertical force of perturbed
walking from the GaitAnalysisToolKit's tests.
"""

import numpy as np
import pandas as pd
import pytest

from jointz.core.recording import build_recording
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.phase import gait_phase
from jointz.gait.strides import find_strides
from jointz.gait.timestamps import find_gaps, is_uniform, rate_hz, resample_stretch, stretches

pytestmark = pytest.mark.real_data


def recording_of(path, column):
    table = pd.read_csv(path)
    force = table[column].to_numpy()
    return build_recording(table["time"].to_numpy(), {"ground_reaction_force": force})


@pytest.fixture(scope="module")
def right(real_data):
    return recording_of(real_data / "moore2015_walk" / "UnpertPre_data.csv", "RightGRF_y")


@pytest.fixture(scope="module")
def events(real_data):
    return pd.read_csv(real_data / "moore2015_walk" / "UnpertPre__event.csv")


def test_the_time_stamps_have_15_gaps_of_up_to_137_ms(right):
    time = right["time"].to_numpy()
    gaps = find_gaps(time)
    assert gaps.shape == (15, 2)
    assert np.diff(gaps).max() == pytest.approx(0.137, abs=0.0005)
    assert rate_hz(time) == pytest.approx(100.0, abs=0.01)
    assert len(stretches(time, np.ones(time.size, dtype=bool))) == 16


def test_the_jittered_stamps_become_uniform_inside_each_stretch(right):
    time = right["time"].to_numpy()
    force = right["ground_reaction_force"].to_numpy()
    assert not is_uniform(time)
    for part in stretches(time, np.isfinite(force)):
        grid, values = resample_stretch(time[part], force[part], step_s=0.01)
        np.testing.assert_allclose(np.diff(grid), 0.01, rtol=0.02)
        assert grid[0] == time[part][0]
        assert grid[-1] <= time[part][-1] + 1e-9
        assert values.min() >= force[part].min()
        assert values.max() <= force[part].max()


@pytest.mark.parametrize(("side", "count"), [("Right", 43), ("Left", 44)])
def test_every_strike_is_within_20_ms_of_the_published_event(real_data, events, side, count):
    path = real_data / "moore2015_walk" / "UnpertPre_data.csv"
    found = find_heel_strikes(recording_of(path, f"{side}GRF_y"))
    published = events[f"{side[0].lower()}hs"].dropna().to_numpy()
    assert found.time_s.size == published.size == count
    np.testing.assert_allclose(found.time_s, published, rtol=0, atol=0.020)


def test_left_heel_strikes_fall_in_the_middle_of_the_right_gait_cycle(right, events):
    strides = find_strides(find_heel_strikes(right).time_s, find_gaps(right["time"].to_numpy()))
    assert strides.touches_gap.sum() == 13
    phase = gait_phase(events["lhs"].to_numpy(), strides)
    known = np.array([code == "" for code in phase.code])
    assert known.sum() == 40  # all but those before the fourth right heel strike
    assert np.all(np.abs(phase.pct[known] - 50.0) < 5.0)


def test_perturbed_walking_loses_its_spurious_crossings(real_data):
    path = real_data / "gaitanalysistoolkit" / "example_vertical_grf.csv"
    time, force = np.loadtxt(path, delimiter=",").T
    assert np.count_nonzero((force[:-1] < 20.0) & (force[1:] >= 20.0)) == 49
    found = find_heel_strikes(build_recording(time, {"ground_reaction_force": force}))
    strides = find_strides(found.time_s, find_gaps(time))
    assert found.time_s.size == 46
    assert strides.accepted.sum() == 45
    assert strides.duration_s.min() > 1.1
    assert strides.duration_s.max() < 1.3
