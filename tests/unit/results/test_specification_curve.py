"""Estimates under every set of choices: sorted, told, drawn."""

from jointz.results.specification_curve import SpecificationCurve, SpecificationEstimate


def estimate(value, *, window_s=0.1, cutoff_hz=None, status="ok", parameter="stiffness"):
    stands = status != "undecided"
    return SpecificationEstimate(
        timing_point="LRE",
        parameter=parameter,
        method="rigid" if cutoff_hz is None else "dissertation",
        baseline="predicted",
        window_s=window_s,
        cutoff_hz=cutoff_hz,
        inertia_model="pooled",
        value=value if stands else None,
        ci_low=value - 1.0 if stands else None,
        ci_high=value + 1.0 if stands else None,
        status=status,
    )


CURVE = SpecificationCurve(
    "S01",
    (
        estimate(60.0),
        estimate(40.0, window_s=0.06),
        estimate(0.0, window_s=0.04, status="undecided"),
        estimate(90.0, cutoff_hz=20.0),
    ),
    {"windows_s": [0.04, 0.06, 0.1]},
)


def test_estimates_are_sorted_and_undecided_ones_left_out():
    assert [e.value for e in CURVE.of("stiffness", "LRE")] == [40.0, 60.0, 90.0]
    assert CURVE.of("damping", "LRE") == ()


def test_the_figure_has_estimates_above_and_their_choices_below():
    axes = CURVE.plot()
    below = axes.child_axes[0]
    rows = {
        label.get_text(): line.get_xdata().tolist()
        for label, line in zip(below.get_yticklabels(), below.lines, strict=True)
    }

    assert rows["window 60 ms"] == [0]
    assert rows["rigid"] == [0, 1]
    assert rows["cut-off 20 Hz"] == [2]
    assert rows["inertia pooled"] == [0, 1, 2]
    assert axes.lines[-1].get_ydata().tolist() == [40.0, 60.0, 90.0]
    axes.figure.clf()
