"""The evidence of the made profiles is reproduced by simulation."""

import numpy as np
import pytest
from tests.unit.control.free_deviations import (
    Box,
    growth,
    growth_by_solve_ivp,
    largest_growth,
)
from tests.unit.control.made_cycles import made_cycles, safe_cycles, unsafe_cycles

SEARCHED = (1, 12, 17)  # a knee, steps of stiffness, a spring
CYCLES = {cycle.name: cycle for cycle in made_cycles()}
CHOSEN = [made[at].name for made in (unsafe_cycles(), safe_cycles()) for at in SEARCHED]


def at_worst_load(cycle):
    load = np.array([[cycle.worst.inertia], [cycle.worst.spring], [cycle.worst.stride_s]])
    return growth(cycle.stiffness, cycle.damping, load)[0]


def test_there_are_20_unsafe_and_20_safe_profiles_of_positive_stiffness_and_damping():
    assert len(CYCLES) == 40
    assert sum(cycle.unsafe for cycle in unsafe_cycles()) == 20
    assert sum(cycle.unsafe for cycle in safe_cycles()) == 0
    for cycle in CYCLES.values():
        assert cycle.stiffness.shape == cycle.damping.shape == (100,)
        assert min(cycle.stiffness.min(), cycle.damping.min()) > 0.0
        assert not 0.97 < cycle.growth < 1.03


@pytest.mark.parametrize("name", CYCLES)
def test_free_deviations_of_the_worst_load_grow_as_stored(name):
    cycle = CYCLES[name]
    assert at_worst_load(cycle) == pytest.approx(cycle.growth, abs=5e-4)


@pytest.mark.parametrize("name", CHOSEN)
def test_a_search_of_all_loads_finds_the_stored_growth(name):
    cycle = CYCLES[name]
    _, factor = largest_growth(cycle, counts=(5, 500, 3), steps=4)
    assert factor == pytest.approx(cycle.growth, abs=0.01)


def test_another_integrator_gives_the_stored_growth():
    cycle = CYCLES[CHOSEN[0]]
    factor = growth_by_solve_ivp(cycle.stiffness, cycle.damping, cycle.worst)
    assert factor == pytest.approx(cycle.growth, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "box"),
    [
        ("only with a spring", Box(spring=(0.0, 0.5))),
        ("only with the heaviest load in short strides", Box(inertia=(0.2, 0.72))),
        ("only with the heaviest load in short strides", Box(stride=(0.9, 1.2))),
        ("only with the lightest load in long strides", Box(inertia=(0.3, 0.8))),
        ("only with the lightest load in long strides", Box(stride=(0.8, 1.1))),
    ],
)
def test_profiles_that_only_some_loads_excite_are_safe_with_all_others(name, box):
    _, factor = largest_growth(CYCLES[name], box, counts=(5, 500, 3), steps=4)
    assert factor < 0.9
