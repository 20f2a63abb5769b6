"""The fit of one time series: its parts, its words and its figure."""

import dataclasses

from jointz.results.estimates import ParameterEstimate
from jointz.results.series.joint_fit import FitSeries, JointFit

FIT = JointFit(
    model="kbj",
    estimator="output_error",
    input="torque",
    parameters=(
        ParameterEstimate("stiffness", 50.0, 48.0, 52.0, "ok"),
        ParameterEstimate("damping", 0.0, 0.0, 0.5, "at_bound"),
        ParameterEstimate("inertia", None, None, None, "undecided"),
    ),
    vaf_pct=98.04,
    vaf_of="angle",
    status="undecided",
    n_samples=1250,
    rate_hz=500.0,
    cutoff_hz=30.0,
    condition_number=4.0,
    covariance=(),
    residual_correlation_time_s=0.05,
    ci_method="sandwich",
    warnings=("the record is short",),
    series=FitSeries((0.0, 0.1), (1.0, 2.0), (1.1, 1.9)),
)


def test_a_notebook_shows_the_title_and_a_small_table_escaped():
    html = dataclasses.replace(FIT, estimator="<b>")._repr_html_()

    assert "&lt;b&gt;" in html
    assert "<td>stiffness</td>" in html
    assert "<b>" not in html
