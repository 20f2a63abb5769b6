import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.gait.strides import find_strides

NO_GAPS = np.empty((0, 2))


def strikes(*durations):
    return np.cumsum([0.0, *durations])


@pytest.mark.parametrize("n", [0, 1])
def test_fewer_than_two_strikes_make_no_stride(n):
    found = find_strides(np.arange(float(n)), np.array([[0.1, 0.2]]))
    assert found.start_s.size == found.strike_s.size == found.accepted.size == 0
    assert found.code == ()


def test_a_missing_strike_makes_one_long_stride_and_says_how_long():
    found = find_strides(strikes(*[1.1] * 6, 2.2, *[1.1] * 6), NO_GAPS)
    assert found.code[6] == "missing_strike"
    assert found.detail[6] == "2.0 x 1.10 s"
    assert found.accepted.sum() == 12


def test_a_spurious_strike_makes_two_short_strides():
    found = find_strides(strikes(*[1.1] * 6, 0.5, 0.6, *[1.1] * 6), NO_GAPS)
    assert found.code[6:8] == ("spurious_strike", "spurious_strike")
    assert found.detail[6] == "0.45 x 1.10 s"
    assert found.accepted.sum() == 12


@pytest.mark.parametrize(("ratio", "accepted"), [(0.74, False), (0.76, True), (1.32, True)])
def test_the_band_is_three_quarters_to_four_thirds(ratio, accepted):
    assert find_strides(strikes(*[1.0] * 5, ratio, 1.0), NO_GAPS).accepted[5] == accepted


def test_bad_strides_at_the_start_do_not_seed_the_band():
    found = find_strides(strikes(0.4, 2.2, 0.6, *[1.1] * 9), NO_GAPS)
    assert list(found.accepted) == [False] * 3 + [True] * 9


def test_the_band_restarts_after_five_agreeing_strides_of_a_new_cadence():
    found = find_strides(strikes(*[1.0] * 12, *[1.5] * 10), NO_GAPS)
    assert list(found.accepted) == [True] * 12 + [False] * 5 + [True] * 5


def test_five_rejected_strides_that_disagree_do_not_restart_the_band():
    found = find_strides(strikes(*[1.0] * 9, 0.3, 2.5, 0.4, 3.0, 0.2, *[1.0] * 9), NO_GAPS)
    assert found.accepted[14:].all()


def test_the_band_follows_a_slow_change_of_cadence():
    durations = np.concatenate([np.linspace(1.2, 1.8, 40), np.linspace(1.8, 0.8, 60)])
    assert durations[-1] < 0.75 * np.median(durations)
    assert find_strides(strikes(*durations), NO_GAPS).accepted.all()


def test_a_long_gap_rejects_its_stride_and_does_not_move_the_band():
    gaps = np.array([[6.2, 6.6]])
    found = find_strides(strikes(*[1.0] * 6, 1.3, *[1.0] * 6), gaps)
    assert found.code[6] == "gap"
    assert found.detail[6] == "gap of 0.400 s"
    assert found.touches_gap.sum() == 1
    assert found.accepted.sum() == 12


def test_a_short_gap_is_reported_and_leaves_the_stride_accepted():
    found = find_strides(strikes(*[1.0] * 6), np.array([[2.2, 2.34]]))
    assert found.accepted.all()
    assert list(found.touches_gap) == [False, False, True, False, False, False]
    assert found.detail[2] == "gap of 0.140 s"


@pytest.mark.parametrize(
    ("start_s", "touched"), [(0.9, [True, True, False]), (1.0, [False, True, False])]
)
def test_a_gap_over_a_strike_touches_both_strides_and_one_that_ends_at_it_only_its_own(
    start_s, touched
):
    found = find_strides(strikes(1.0, 1.0, 1.0), np.array([[start_s, 1.1]]))
    assert found.touches_gap.tolist() == touched


def test_a_strike_lost_in_a_short_gap_is_missing_and_the_gap_is_named():
    found = find_strides(strikes(*[1.0] * 6, 2.0, *[1.0] * 6), np.array([[6.98, 7.02]]))
    assert found.code[6] == "missing_strike"
    assert found.detail[6] == "2.0 x 1.00 s; gap of 0.040 s"


def test_strikes_out_of_order_are_refused():
    with pytest.raises(DataError, match=r"must increase, got 1 s after 2 s"):
        find_strides(np.array([0.0, 2.0, 1.0]), NO_GAPS)
