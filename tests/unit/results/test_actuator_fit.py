"""The result of a torque model: doors, regimes of speed, what it prints."""

import dataclasses

import numpy as np
import pytest

from jointz.results.bench.actuator_fit import ActuatorFit, ActuatorSeries
from jointz.results.estimates import ParameterEstimate


@pytest.fixture
def fit():
    velocity = tuple(np.linspace(-5, 5, 60).tolist())
    return ActuatorFit(
        model="friction",
        parameters=(
            ParameterEstimate("bias", -0.58, -0.6, -0.56, "ok", ci_method="sandwich"),
            ParameterEstimate("torque_constant", 0.11, 0.109, 0.111, "ok"),
            ParameterEstimate("coulomb_friction", None, None, None, "undecided", unbounded=0.1),
            ParameterEstimate("gear_friction", 0.09, 0.08, 0.1, "ok"),
            ParameterEstimate(
                "rotor_inertia", 0.0092, None, None, "ok", ci_method="given, not fitted"
            ),
        ),
        rms_error_nm=0.38,
        vaf_pct=98.5,
        status="undecided",
        gear_ratio=9.0,
        torque_sign=-1.0,
        n_samples=60,
        rate_hz=None,
        condition_number=2.0,
        covariance=((1e-4, 0.0), (0.0, 1e-6)),
        fitted=("bias", "torque_constant"),
        ci_method="sandwich",
        settings={"rotor_inertia_given": 0.0092},
        warnings=("coulomb_friction is undecided: the speed does not reverse",),
        series=ActuatorSeries(
            position=tuple(float(k) for k in range(60)),
            measured=velocity,
            modelled=tuple(0.9 * v for v in velocity),
            velocity=velocity,
            in_seconds=False,
        ),
    )


def test_the_summary_says_what_is_undecided_what_was_given_and_why(fit):
    text = fit.summary()
    assert "Torque model friction (3.3): undecided" in text
    assert "60 samples, gear ratio 9" in text
    assert "coulomb_friction undecided" in text
    assert "0.0092 kg*m^2 (given, not fitted)" in text
    assert "Note: coulomb_friction is undecided: the speed does not reverse" in text
    assert "at 500 Hz" in dataclasses.replace(fit, rate_hz=500.0).summary()


def test_the_figure_colours_every_sample_by_its_regime_of_speed(fit):
    from matplotlib.figure import Figure

    axes = fit.plot(Figure().subplots())
    upper, lower = axes.child_axes
    measured, *regimes = upper.lines
    assert measured.get_label() == "measured"
    assert len(regimes) == 6
    assert sum(line.get_xdata().size for line in regimes) == 60
    assert len({line.get_color() for line in regimes}) == 6
    labels = [line.get_label() for line in regimes]
    assert labels == [
        "below -3.3",
        "-3.3 to -1.7",
        "-1.7 to 0",
        "0 to 1.7",
        "1.7 to 3.3",
        "above 3.3",
    ]
    residual = np.concatenate([line.get_ydata() for line in lower.lines[:-1]])
    np.testing.assert_allclose(np.sort(residual), 0.1 * np.linspace(-5, 5, 60), atol=1e-12)
    assert lower.get_xlabel() == "sample"
    assert "0.11" in upper.get_title()


def test_a_constant_torque_constant_without_value_is_named_in_the_figure(fit):
    from matplotlib.figure import Figure

    unknown = tuple(
        dataclasses.replace(p, value=None, status="undecided") if p.name == "torque_constant" else p
        for p in fit.parameters
    )
    axes = dataclasses.replace(fit, parameters=unknown).plot(Figure().subplots())
    assert "torque constant undecided" in axes.child_axes[0].get_title()
