import dataclasses

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
