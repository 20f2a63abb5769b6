"""References: cycles, bounds, the fastest frequency."""

import pytest
from pydantic import TypeAdapter, ValidationError

from jointz.core.protocols.reference_signal_models import Reference


def reference(kind, **fields):
    return TypeAdapter(Reference).validate_python({"kind": kind, **fields})


@pytest.mark.parametrize(
    ("frequencies_hz", "cycle_s"),
    [((1.4, 2.0), 5.0), ((0.1, 5.0), 10.0), ((0.8,), 1.25), ((1.4, 2.8), 1 / 1.4), ((3, 2), 1.0)],
)
def test_a_sum_of_sines_repeats_after_the_shortest_time_all_terms_share(frequencies_hz, cycle_s):
    terms = [{"amplitude": 2.0, "frequency_hz": f} for f in frequencies_hz]

    made = reference("sum_of_sines", terms=terms, offset=40.0)

    assert made.cycle_s == pytest.approx(cycle_s, rel=1e-12)
    assert made.bounds == (40.0 - 2.0 * len(terms), 40.0 + 2.0 * len(terms))


SWEEPS = [
    {"amplitude": [5, 3], "frequency_hz": [10.1, 1.1], "duration_s": 10},
    {"amplitude": [0, 0], "frequency_hz": [1, 2], "duration_s": 5},
]
SINE = reference("sine", amplitude=5, frequency_hz=0.8, offset=32)
NOISE = reference("noise", sd=10.0, cutoff_hz=40.0, order=3, offset=1.0)
STEPS = reference("steps", levels=[-5, 0, 4], hold_s=2.0)
TRAJECTORY = reference("trajectory", samples=[0.1, 0.3, 0.2, 0.0], duration_s=1.1)


@pytest.mark.parametrize(
    ("made", "cycle_s", "bounds", "fastest_hz", "runs_out"),
    [
        (SINE, 1.25, (27, 37), 0.8, False),
        (NOISE, None, (-29, 31), 40.0, False),
        (STEPS, 6.0, (-5, 4), 0.0, True),
        (TRAJECTORY, 1.1, (0.0, 0.3), 0.0, False),
        (reference("chirps", sweeps=SWEEPS), 15.0, (-5, 5), 10.1, True),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_a_reference_knows_its_cycle_bounds_and_fastest_frequency(
    made, cycle_s, bounds, fastest_hz, runs_out
):
    assert made.cycle_s == (cycle_s if cycle_s is None else pytest.approx(cycle_s))
    assert made.bounds == pytest.approx(bounds)
    assert made.fastest_hz == fastest_hz
    assert made.runs_out is runs_out


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("sine", {"amplitude": 0.0, "frequency_hz": 1.0}),
        ("sine", {"amplitude": 1.0, "frequency_hz": -1.0}),
        ("sine", {"amplitude": 1.0, "frequency_hz": float("inf")}),
        ("noise", {"sd": 1.0, "cutoff_hz": 20.0, "order": 0}),
        ("noise", {"sd": 1.0, "cutoff_hz": 20.0, "order": 2.5}),
        ("sum_of_sines", {"terms": []}),
        ("chirps", {"sweeps": []}),
        ("steps", {"levels": [], "hold_s": 1.0}),
        ("steps", {"levels": [1.0], "hold_s": 0.0}),
        ("trajectory", {"samples": [0.0, 1.0], "duration_s": 1.0}),
        ("trajectory", {"samples": [0.5] * 6, "duration_s": 1.0}),
        ("square", {}),
    ],
)
def test_a_reference_that_cannot_be_is_refused(kind, fields):
    with pytest.raises(ValidationError):
        reference(kind, **fields)
