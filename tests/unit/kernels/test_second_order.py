"""The recursion of a second-order joint and its errors-in-variables likelihood."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from jointz.kernels.series.second_order import PulseSignals, maximise_likelihood
from jointz.kernels.series.second_order_recursion import transfer_coefficients

STEP = 1 / 900
LOADS = {
    "light": (168.0, 0.163, 0.0364),
    "heavy": (273.0, 0.0, 0.07),
    "overdamped": (20.0, 5.0, 0.05),
}


def reference_coefficients(K: float, B: float, J: float) -> np.ndarray:
    num, den, _ = cont2discrete(([1.0], [J, B, K]), STEP, method="foh")
    return np.array([den[1], den[2], *np.ravel(num)])


@pytest.mark.parametrize("load", LOADS)
def test_the_recursion_is_the_first_order_hold_of_scipy(load):
    np.testing.assert_allclose(
        transfer_coefficients(*LOADS[load], STEP), reference_coefficients(*LOADS[load]), rtol=1e-9
    )


def response(load: str, n: int, lag: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Angle of the load under a pulse, and the torque as a late sensor has it."""
    t = STEP * np.arange(-40, n + 40)

    def pulse(t):
        return 7.0 * np.interp(t, [0, 0.075, 0.175, 0.25], [0, 1, 1, 0])

    c = transfer_coefficients(*LOADS[load], STEP)
    _, angle = dlsim((c[2:], [1.0, c[0], c[1]], STEP), pulse(t))
    return np.ravel(angle)[40 : 40 + n], pulse(t - lag)


@pytest.mark.parametrize("at_rest", [True, False])
@pytest.mark.parametrize("lag", [0.0, -3 * STEP, 2 * STEP])
def test_clean_records_give_the_load_and_the_lag_back(lag, at_rest):
    angle, torque = response("light", 226, lag)
    offset = 0.0 if at_rest else 3.0
    record = PulseSignals(angle, torque + offset, 40, STEP, at_rest)

    fit = maximise_likelihood(
        record,
        np.array([150.0, 0.3, 0.03, 0.001, 0.0]),
        noise_sd=(1e-5, 1e-3),
        lag_prior=None,
    )

    assert fit.converged
    np.testing.assert_allclose(fit.values[:3], LOADS["light"], rtol=1e-6)
    assert fit.values[3] == pytest.approx(lag, abs=1e-8)
    assert fit.values[4] == pytest.approx(offset, abs=1e-6)


def test_a_load_too_fast_for_the_clock_is_not_fitted():
    record = PulseSignals(*response("light", 100), 40, STEP, True)

    fit = maximise_likelihood(
        record, np.array([1e9, 0.0, 1e-6, 0.0, 0.0]), noise_sd=(1e-5, 0.05), lag_prior=None
    )

    assert not fit.converged
    assert fit.chi_square == np.inf


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": np.array([1.0, 0.0, -1.0, 0.0, 0.0])}, "> 0"),
        ({"noise_sd": (0.0, 0.0)}, "noise"),
        ({"record": PulseSignals(np.zeros(5), np.zeros(20), 5, STEP, True)}, "10 samples"),
    ],
)
def test_arguments_without_sense_are_refused(changes, message):
    arguments = {
        "record": PulseSignals(*response("light", 50), 40, STEP, True),
        "start": np.array([100.0, 0.0, 0.05, 0.0, 0.0]),
        "noise_sd": (1e-5, 0.1),
        "lag_prior": None,
    }
    with pytest.raises(ValueError, match=message):
        maximise_likelihood(**(arguments | changes))
