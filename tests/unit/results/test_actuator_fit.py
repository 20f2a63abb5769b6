"""The result of a torque model: doors, regimes of speed, what it prints."""

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
        series=ActuatorSeries(
            position=tuple(float(k) for k in range(60)),
            measured=velocity,
            modelled=tuple(0.9 * v for v in velocity),
            velocity=velocity,
            in_seconds=False,
        ),
    )


def test_the_figure_colours_every_sample_by_its_regime_of_speed(fit):
    from matplotlib.figure import Figure

    axes = fit.plot(Figure().subplots())
    upper, lower = axes.child_axes
    measured, *regimes = upper.lines
    assert measured.get_label() == "measured"
    assert len(regimes) == 6
    assert sum(line.get_xdata().size for line in regimes) == 60
    assert len({line.get_color() for line in regimes}) == 6
    assert [line.get_label() for line in regimes][:2] == ["below -3.3", "-3.3 to -1.7"]
    residual = np.concatenate([line.get_ydata() for line in lower.lines[:-1]])
    np.testing.assert_allclose(np.sort(residual), 0.1 * np.linspace(-5, 5, 60), atol=1e-12)
