"""The fit of two paths: its words, its table and its figure."""

import dataclasses

from jointz.results.estimates import ParameterEstimate
from jointz.results.series.reflex_fit import ReflexFit, ReflexPath, ReflexSeries

FIT = ReflexFit(
    model="reflex",
    estimator="parallel_cascade",
    input="angle",
    parameters=(
        ParameterEstimate("stiffness", 70.0, 68.0, 72.0, "ok"),
        ParameterEstimate("damping", 1.0, 0.9, 1.1, "ok"),
        ParameterEstimate("inertia", 0.015, 0.014, 0.016, "ok"),
        ParameterEstimate("reflex_gain", 5.0, 4.0, 6.0, "ok"),
        ParameterEstimate("reflex_delay", None, None, None, "undecided"),
    ),
    vaf_pct=95.04,
    intrinsic_vaf_pct=81.0,
    reflex_vaf_pct=38.0,
    linear_vaf_pct=86.0,
    linear_stiffness=104.2,
    vaf_of="torque",
    status="undecided",
    path=ReflexPath("negative", 0.25, 1.5, 0.75, 0.001),
    n_samples=5900,
    rate_hz=1000.0,
    fit_rate_hz=100.0,
    cutoff_hz=20.0,
    condition_number=6.5,
    covariance=(),
    ci_method="sandwich",
    warnings=("the delay is not told",),
    series=ReflexSeries((0.0, 0.1), (1.0, 2.0), (1.1, 1.9), (1.0, 1.5), (0.1, 0.4)),
)
NOTHING = dataclasses.replace(
    FIT,
    parameters=(
        *FIT.parameters[:3],
        ParameterEstimate("reflex_gain", None, None, None, "undecided"),
        ParameterEstimate("reflex_delay", None, None, None, "undecided"),
    ),
    path=ReflexPath(p_value=0.4),
)


def test_the_summary_tells_both_paths_and_the_model_without_a_reflex():
    assert FIT.to_frame()["unit"].tolist()[3:] == ["N*m*s/rad", "s"]
    assert FIT.summary().splitlines() == [
        "Intrinsic and reflex impedance, angle perturbed: undecided",
        "  59.0 s at 1000 Hz, low-pass 20 Hz, fitted at 100 Hz",
        "  stiffness  70 N*m/rad (95% interval 68 to 72; ok)",
        "  damping    1 N*m*s/rad (95% interval 0.9 to 1.1; ok)",
        "  inertia    0.015 kg*m^2 (95% interval 0.014 to 0.016; ok)",
        "  reflex_gain 5 N*m*s/rad (95% interval 4 to 6; ok)",
        "  reflex_delay undecided",
        "  reflex to negative velocity above 0.25 rad/s, low-pass 1.5 Hz with damping ratio 0.75 "
        "(p 0.001)",
        "  VAF of the torque 95.0 %: intrinsic path 81.0 %, reflex path 38.0 %",
        "  without a reflex path 86.0 % and stiffness 104.2 N*m/rad",
        "  intervals: sandwich",
        "  Note: the delay is not told",
    ]


def test_the_summary_says_where_no_reflex_was_found():
    assert "reflex not found (p 0.4)" in NOTHING.summary()
