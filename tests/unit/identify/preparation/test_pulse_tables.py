"""Every pulse of a table finds one recording of its file, or the table is refused."""

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.study_pulses import share_table
from jointz.core.errors import DataError
from jointz.core.recording import build_recording


def run(start_s, *, condition="perturbed"):
    """Ten seconds of a file."""
    time = start_s + np.arange(1001) / 100.0
    return build_recording(time, {"angle": time}, file="walk.csv", condition=condition)


def shared(onsets, *recordings):
    shares = share_table(pd.DataFrame({"onset_s": np.array(onsets, dtype=float)}), recordings)
    return [None if share is None else share["onset_s"].tolist() for share in shares]


def test_the_only_perturbed_recording_takes_the_whole_table():
    plain = run(0.0, condition="unperturbed")
    assert shared([1.0, 99.0], plain, run(0.0)) == [None, [1.0, 99.0]]


def test_every_pulse_goes_to_one_recording_also_where_it_lies_outside_all():
    recordings = [run(20.0), run(40.0, condition="unperturbed"), run(60.0)]
    onsets = [1.0, 20.0, 30.0, 45.0, 60.0, 99.0]
    assert shared(onsets, *recordings) == [[1.0, 20.0, 30.0, 45.0], None, [60.0, 99.0]]


def test_recordings_in_another_order_than_their_clock_take_the_same_pulses():
    assert shared([25.0, 61.0], run(60.0), run(20.0)) == [[61.0], [25.0]]


@pytest.mark.parametrize("second_s", [0.0, 9.0, 10.0])
def test_time_that_starts_again_in_a_perturbed_trial_is_refused(second_s):
    with pytest.raises(DataError, match=r"walk.csv: time"):
        shared([1.0], run(0.0), run(second_s))


def test_a_table_whose_onsets_all_lie_outside_is_refused():
    assert shared([], run(0.0)) == [[]]
    with pytest.raises(DataError, match=r"0 to 10 s, 20 to 30 s"):
        shared([11.0, 99.0], run(0.0), run(20.0))
    with pytest.raises(DataError, match=r"walk.csv: all 1 onsets"):
        shared([1.0], run(0.0, condition="unperturbed"))
