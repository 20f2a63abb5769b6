"""The plan of a condition: balanced wherever it is broken off, and made by its seed alone."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointz.core.protocols.protocol_models import PerturbationPlan
from jointz.core.protocols.pulse_models import DoubletPulse, PulseSpec
from jointz.rig.experiment.plan import make_plan

POINTS = {"LRE": 7.0, "MST": 21.5, "TST": 40.5, "PSW": 56.0, "ISW": 68.5, "MSW": 81.0}


def pulse(direction="positive"):
    return PulseSpec(amplitude_nm=17.0, duration_s=0.25, hold_s=0.25, direction=direction)


def perturbations(**changes):
    usual = {"timing_points": POINTS, "count_per_point": 50, "gap_strides": (3, 7)}
    return PerturbationPlan(**{**usual, **changes})


def plan_of(*, seed=1, direction="positive", **changes):
    return make_plan(perturbations(**changes), (pulse(direction),), np.random.default_rng(seed))


def rounds_of(plan):
    size = len(POINTS)
    return [plan[i : i + size] for i in range(0, len(plan), size)]


def test_a_balanced_plan_is_balanced_after_every_round():
    for one in rounds_of(plan_of()):
        assert sorted(p.timing_point for p in one) == sorted(POINTS)


def test_a_random_plan_is_not_balanced_in_rounds():
    sizes = {len({p.timing_point for p in one}) for one in rounds_of(plan_of(order="random"))}
    assert min(sizes) < len(POINTS)


def test_points_with_fewer_pulses_are_spread_evenly_over_the_rounds():
    counts = {"LRE": 10, "MST": 20, "TST": 30, "PSW": 40, "ISW": 50, "MSW": 60}

    plan = plan_of(direction="both", count_per_point=counts)

    assert Counter(p.timing_point for p in plan) == counts
    signs = Counter((p.timing_point, p.amplitude_nm > 0.0) for p in plan)
    assert all(signs[name, True] == n // 2 for name, n in counts.items())
    first = Counter(p.timing_point for p in plan[: len(plan) // 2])
    assert all(abs(first[name] - n / 2) <= 1.0 for name, n in counts.items())


def test_gaps_cover_their_range_evenly():
    gaps = Counter(p.gap_strides for p in plan_of())
    assert sorted(gaps) == [3, 4, 5, 6, 7]
    # 300 draws of five values: an SD of 6.9 about 60.
    assert all(abs(count - 60) < 4 * 6.9 for count in gaps.values())


def test_the_shortest_and_the_longest_gap_may_be_one():
    assert {p.gap_strides for p in plan_of(gap_strides=(4, 4))} == {4}
    assert {p.gap_strides for p in plan_of(gap_strides=None)} == {1}


def test_a_seed_makes_one_plan_and_another_seed_another():
    assert plan_of(seed=5) == plan_of(seed=5)
    assert plan_of(seed=5) != plan_of(seed=6)


def test_both_directions_are_balanced_at_every_point_after_every_pair_of_rounds():
    rounds = rounds_of(plan_of(direction="both"))
    for first, second in zip(rounds[::2], rounds[1::2], strict=True):
        pairs = Counter((p.timing_point, p.amplitude_nm) for p in (*first, *second))
        assert set(pairs.values()) == {1}
        assert len(pairs) == 2 * len(POINTS)


def test_nobody_can_tell_the_direction_of_the_next_pulse_from_those_before():
    plan = plan_of(direction="both", count_per_point=400)
    signs = np.sign([p.amplitude_nm for p in plan])
    # 2399 pairs of neighbours: were they independent, the SD of the correlation would be 0.02.
    assert abs(np.mean(signs[1:] * signs[:-1])) < 0.1
    mixed = [len({p.amplitude_nm for p in one}) for one in rounds_of(plan)]
    assert np.mean(mixed) > 1.9


@pytest.mark.parametrize(("share", "shams"), [(0.2, 10), (0.5, 40), (0.0, 0)])
def test_shams_come_on_top_and_are_their_share_of_all_pulses(share, shams):
    plan = plan_of(sham_share=share, count_per_point=40)
    by_point = Counter(p.timing_point for p in plan if p.sham)
    assert by_point == (dict.fromkeys(POINTS, shams) if shams else {})
    assert sum(not p.sham for p in plan) == 40 * len(POINTS)
    assert len(plan) == perturbations(sham_share=share, count_per_point=40).total
    assert {p.amplitude_nm for p in plan if p.sham} <= {0.0}


def test_shams_lie_at_random_places_between_the_others():
    plan = plan_of(sham_share=0.3)
    places = [number for number, one in enumerate(rounds_of(plan)) if one[0].sham]
    assert len(set(np.diff(places))) > 1
    for one in rounds_of(plan):
        assert sorted(p.timing_point for p in one) == sorted(POINTS)


@given(
    count=st.integers(1, 12),
    points=st.integers(1, 6),
    direction=st.sampled_from(["positive", "negative", "both"]),
    order=st.sampled_from(["balanced", "random", "sequential"]),
    fewest=st.integers(1, 6),
    more=st.integers(0, 5),
    seed=st.integers(0, 2**32),
)
def test_whatever_is_asked_for_is_what_is_planned(
    count, points, direction, order, fewest, more, seed
):
    some = dict(list(POINTS.items())[:points])
    plan = plan_of(
        seed=seed,
        direction=direction,
        timing_points=some,
        count_per_point=count,
        gap_strides=(fewest, fewest + more),
        order=order,
    )
    assert Counter(p.timing_point for p in plan) == dict.fromkeys(some, count)
    assert [p.number for p in plan] == list(range(1, len(plan) + 1))
    assert all(p.gait_pct == POINTS[p.timing_point] for p in plan)
    assert all(fewest <= p.gap_strides <= fewest + more for p in plan)
    for name in some:
        signs = [p.amplitude_nm for p in plan if p.timing_point == name]
        balance = abs(sum(signs)) / 17.0
        assert balance == (count % 2 if direction == "both" else count)


# --- several shapes ------------------------------------------------------------------------------

DOUBLETS = tuple(
    DoubletPulse(
        name=name,
        kind="doublet",
        amplitudes_nm=(7.0, 12.0),
        durations_s=durations,
        direction="both",
    )
    for name, durations in (("short", (0.04, 0.022)), ("long", (0.092, 0.05)))
)


def mixed(*, seed=1, **changes):
    rng = np.random.default_rng(seed)
    return make_plan(perturbations(**{"count_per_point": 48, **changes}), DOUBLETS, rng)


@pytest.mark.parametrize("order", ["balanced", "random", "sequential", "cyclic"])
def test_every_timing_point_gets_every_shape_size_and_sign_equally_often(order):
    counts = Counter((p.timing_point, p.shape, p.amplitude_nm) for p in mixed(order=order))
    assert len(counts) == 6 * 2 * 2 * 2
    assert set(counts.values()) == {6}


def test_shapes_are_balanced_after_as_many_rounds_as_there_are_and_in_no_foreseen_order():
    rounds = rounds_of(mixed())
    orders = set()
    for begin in range(0, len(rounds), 8):
        for point in POINTS:
            own = [p for one in rounds[begin : begin + 8] for p in one if p.timing_point == point]
            orders.add(tuple((p.shape, p.amplitude_nm) for p in own))
            assert len({(p.shape, p.amplitude_nm) for p in own}) == 8
    assert len(orders) > 30  # of 36 blocks


def test_catch_trials_are_spread_among_the_shapes():
    plan = mixed(sham_share=0.2)
    shams = Counter(p.timing_point for p in plan if p.sham)
    assert shams == dict.fromkeys(POINTS, 12)
    assert sum(not p.sham for p in plan) == 6 * 48
