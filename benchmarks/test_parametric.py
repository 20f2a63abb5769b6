"""Time of one fit of K, B and J: of a minute of a joint, of a reflex, of a cell of pulses.

How near they come is asserted in tests/unit/identify. With ``--benchmark-disable`` each runs once.
"""

import numpy as np
import pytest
from benchmarks.figures import Figures, at_most
from scipy.signal import StateSpace, butter, lsim, sosfiltfilt

from jointz.core.study import CalibrationSpec
from jointz.identify.estimators import METHODS
from jointz.identify.preparation.baselines import pre_pulse
from jointz.identify.preparation.cell_data import CellData, FitSettings, Windows
from jointz.identify.series.joint import identify_joint
from jointz.kernels.derivatives import derivative
from jointz.kernels.filtering import lowpass_zero_phase

RATE_HZ = 1000.0
K, B, J = 80.0, 1.2, 0.03
BUDGET_S = {"joint": 1.0, "cell": 1.0 / 6.0}
CUTOFF_HZ = 20.0
LEAD, WINDOW, BEFORE, AFTER, N_PULSES = 20, 100, 400, 500, 50
OF_CELLS = ("pilot", "least_squares", "instrumental_variable")


def within(benchmark, what: str, budget: str, figures: Figures, *, quick: bool) -> None:
    if not benchmark.enabled:
        return
    median_s, asked_s = benchmark.stats["median"], BUDGET_S[budget]
    figures.alone(f"{what}, median", 1e3 * median_s, "ms", asked=at_most(1e3 * asked_s))
    assert quick or median_s < asked_s


@pytest.fixture(scope="module")
def minute() -> dict[str, np.ndarray]:
    """A minute of a joint whose angle is perturbed below 25 Hz, with noise."""
    rng = np.random.default_rng(8)
    band = butter(4, 25.0, fs=RATE_HZ, output="sos")
    angle = sosfiltfilt(band, rng.standard_normal(60_000))
    angle *= 0.02 / angle.std()
    velocity = derivative(angle, rate_hz=RATE_HZ)
    torque = K * angle + B * velocity + J * derivative(velocity, rate_hz=RATE_HZ)
    return {"angle": angle, "torque": torque + 0.1 * rng.standard_normal(angle.size)}


@pytest.mark.parametrize("model", ["kbj", "reflex"])
def test_time_of_a_minute(benchmark, minute, model, quick, figures):
    settings = {"model": model, "input": "angle", "rate_hz": RATE_HZ}

    fit = benchmark(identify_joint, **minute, **settings)

    assert fit.parameter("stiffness").value == pytest.approx(K, rel=0.05)
    within(benchmark, f"{model} model of a minute at 1 kHz", "joint", figures, quick=quick)


@pytest.fixture(scope="module")
def cell() -> CellData:
    """Pulses of 17 N*m on the joint, with noise of 3 mrad and 0.1 N*m."""
    rng = np.random.default_rng(0)
    t = np.arange(BEFORE + AFTER) / RATE_HZ
    command = 17.0 * np.interp(t - BEFORE / RATE_HZ, [0.0, 0.02, 0.2, 0.22], [0.0, 1.0, 1.0, 0.0])
    plant = StateSpace([[0.0, 1.0], [-K / J, -B / J]], [[0.0], [1.0 / J]], [[1.0, 0.0]], [[0.0]])
    _, motion, _ = lsim(plant, command, t)
    angle = motion + 3e-3 * rng.standard_normal((N_PULSES, t.size))
    torque = command + 0.1 * rng.standard_normal(angle.shape)
    smooth, effort = (
        lowpass_zero_phase(x, cutoff_hz=CUTOFF_HZ, rate_hz=RATE_HZ) for x in (angle, torque)
    )
    velocity = derivative(smooth, rate_hz=RATE_HZ)
    acceleration = derivative(velocity, rate_hz=RATE_HZ)
    filtered = np.stack([smooth, velocity, acceleration, effort], axis=1)
    raw = np.stack([smooth, angle, torque, np.broadcast_to(command, angle.shape)], axis=1)
    return CellData(windows(filtered, 0), windows(raw, LEAD))


def windows(signals: np.ndarray, lead: int) -> Windows:
    cut = signals[:, :, BEFORE - lead : BEFORE + WINDOW + lead]
    nothing = pre_pulse(np.zeros((N_PULSES, 4, 50)), n_samples=cut.shape[2])
    return Windows(cut, np.ones(N_PULSES), nothing, lead)


@pytest.mark.parametrize("name", OF_CELLS)
def test_time_of_a_cell(benchmark, cell, name, quick, figures):
    settings = FitSettings(
        n_resamples=1000,
        seed=0,
        rate_hz=RATE_HZ,
        as_published=False,
        calibration=CalibrationSpec(),
        cutoff_hz=CUTOFF_HZ,
        wants_per_mass=False,
    )

    fit = benchmark(METHODS[name].fit, cell, settings)

    assert fit.parameters[0].value == pytest.approx(K, rel=0.2)
    what = f"{name.replace('_', ' ')}, {N_PULSES} pulses, 1,000 resamples"
    within(benchmark, what, "cell", figures, quick=quick)
