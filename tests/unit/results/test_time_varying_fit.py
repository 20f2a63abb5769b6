import dataclasses

import numpy as np

from jointz.results.series.time_varying_fit import ParameterCurve, PhaseResponses, TimeVaryingFit


def curve(name: str, size: float) -> ParameterCurve:
    return ParameterCurve(
        name=name,
        value=(size, 2.0 * size, None),
        ci_low=(0.9 * size, 1.9 * size, None),
        ci_high=(1.1 * size, 2.1 * size, None),
        status=("ok", "ok", "undecided"),
        raw=(size, 2.0 * size, -size),
    )


def make_fit() -> TimeVaryingFit:
    return TimeVaryingFit(
        estimator="instrumental_variable",
        input="torque",
        gait_pct=(10.0, 50.0, 90.0),
        parameters=(curve("stiffness", 50.0), curve("damping", 1.0), curve("inertia", 0.05)),
        response_of="admittance",
        responses=PhaseResponses((0.0, 0.01), ((0.0, 1.0), (0.0, 2.0), ()), ((0.1, 0.1),) * 3),
        vaf_pct=(80.0, 81.0, None),
        second_order_vaf_pct=(90.0, 91.0, None),
        status="undecided",
        n_used=100,
        n_excluded=3,
        excluded={"edge_of_record": 2, "missing_strike": 1},
        stride_s=1.25,
        segment_s=0.1,
        cutoff_hz=20.0,
        rate_hz=500.0,
        ci_level=0.95,
        ci_method="percentiles of 1000 resamples of the strides",
        settings={"seed": 0},
        warnings=("damping is undecided",),
    )


def test_the_table_has_a_row_a_parameter_and_phase():
    table = make_fit().to_frame()

    assert len(table) == 9
    row = table[(table.parameter == "stiffness") & (table.gait_pct == 50.0)].iloc[0]
    assert (row.value, row.ci_low, row.ci_high) == (100.0, 95.0, 105.0)
    assert (row.unit, row.status, row.n_used) == ("N*m/rad", "ok", 100)


def test_an_undecided_phase_has_no_number_in_the_table():
    table = make_fit().to_frame().query("gait_pct == 90.0")

    assert table[["value", "ci_low", "ci_high"]].isna().all(axis=None)
    assert set(table.status) == {"undecided"}


def test_the_text_tells_range_resolution_and_what_was_left_out():
    text = make_fit().summary()

    assert "50 (at 10 %) to 100 N*m/rad (at 50 %)" in text
    assert "resolution of 8 % of the cycle" in text
    assert "2 edge_of_record, 1 missing_strike" in text
    assert "decided at 2 of 3 phases" in text


def test_the_text_of_a_fit_without_any_decision_has_no_range():
    nothing = (None, None, None)
    none = ParameterCurve("stiffness", nothing, nothing, nothing, ("undecided",) * 3, nothing)
    fit = dataclasses.replace(make_fit(), parameters=(none, *make_fit().parameters[1:]))

    assert "stiffness  decided at 0 of 3 phases" in fit.summary()
    assert fit.plot().get_ylabel() == "stiffness (N*m/rad)"


def test_the_figure_shows_stiffness_and_damping_with_bands_over_the_cycle():
    ax = make_fit().plot()

    left, right = ax.figure.axes
    assert left is ax
    for axes in (left, right):
        assert len(axes.collections) == 2
        assert np.array(axes.lines[0].get_xdata()).tolist() == [10.0, 50.0, 90.0]
    assert left.get_ylabel() == "stiffness (N*m/rad)"
    assert right.get_ylabel() == "damping (N*m*s/rad)"
    assert left.get_xlabel() == "gait cycle (%)"


def test_a_phase_without_neighbours_keeps_its_interval_in_the_figure():
    fit = make_fit()
    lonely = dataclasses.replace(
        fit.parameters[0],
        value=(50.0, None, None),
        ci_low=(45.0, None, None),
        ci_high=(55.0, None, None),
    )
    ax = dataclasses.replace(fit, parameters=(lonely, *fit.parameters[1:])).plot()

    (segment,) = ax.collections[1].get_segments()
    assert segment.tolist() == [[10.0, 45.0], [10.0, 55.0]]
