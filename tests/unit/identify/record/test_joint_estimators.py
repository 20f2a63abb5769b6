"""The estimators of K, B, J against closed forms and an independent simulation."""

import numpy as np
import pytest
from scipy.signal import StateSpace, butter, lsim, sosfiltfilt

from jointz.core.errors import EstimationError
from jointz.identify.record.joint import identify_joint
from jointz.results.series.joint_fit import JointFit

ESTIMATORS = ("least_squares", "bounded_least_squares", "admittance", "instrumental_variable")
TRUTH = {"stiffness": 60.0, "damping": 1.0, "inertia": 0.03}

Channels = dict[str, np.ndarray]


def multisine(
    K: float, B: float, J: float, *, rate_hz: float, duration_s: float = 20.0
) -> Channels:
    """Angle of 40 sines below 20 Hz, with the torque of its analytic derivatives."""
    rng = np.random.default_rng(7)
    t = np.arange(int(duration_s * rate_hz)) / rate_hz
    w = 2 * np.pi * np.linspace(0.1, 20.0, 40)[:, None]
    phase = rng.uniform(0, 2 * np.pi, 40)[:, None]
    amplitude = 0.05 / (1 + (w / 20.0) ** 2)
    angle = np.sum(amplitude * np.sin(w * t + phase), axis=0)
    velocity = np.sum(amplitude * w * np.cos(w * t + phase), axis=0)
    acceleration = -np.sum(amplitude * w**2 * np.sin(w * t + phase), axis=0)
    torque = K * angle + B * velocity + J * acceleration
    return {"angle": angle + 0.3, "torque": torque - 2.0, "command": torque}


def band_noise(
    n: int, rate_hz: float, cutoff_hz: float, rms: float, rng: np.random.Generator
) -> np.ndarray:
    sections = butter(3, cutoff_hz, fs=rate_hz, output="sos")
    x = sosfiltfilt(sections, rng.standard_normal(n + 8000))[4000:-4000]
    return x * (rms / x.std())


def torque_perturbed(
    seed: int,
    *,
    duration_s: float = 60.0,
    rate_hz: float = 500.0,
    command_nm: float = 5.0,
    inside_nm: float = 1.0,
    device: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Channels:
    """Joint and device as one state space, stepped at four times the rate."""
    K, B, J = TRUTH.values()
    Kd, Bd, Jd = device
    rng = np.random.default_rng(seed)
    fine_hz = 4 * rate_hz
    n = int(duration_s * fine_hz)
    command = band_noise(n, fine_hz, 10.0, command_nm, rng)
    inside = band_noise(n, fine_hz, 2.0, inside_nm, rng)
    A = [[0.0, 1.0], [-(K + Kd) / (J + Jd), -(B + Bd) / (J + Jd)]]
    system = StateSpace(A, [[0.0], [1.0 / (J + Jd)]], np.eye(2), np.zeros((2, 1)))
    _, state, _ = lsim(system, command - inside, np.arange(n) / fine_hz)
    angle, velocity = state.T
    acceleration = (command - inside - (K + Kd) * angle - (B + Bd) * velocity) / (J + Jd)
    torque = command - Kd * angle - Bd * velocity - Jd * acceleration
    return {"angle": angle[::4], "torque": torque[::4], "command": command[::4]}


def beside_device(seed: int, stiffness: float, *, inside_nm: float = 1.0) -> Channels:
    """Four minutes of joint and device as one, each frequency by itself: no simulation error."""
    n, rate_hz = 120_000, 500.0
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / rate_hz)
    rng = np.random.default_rng(seed)

    def noise(cutoff_hz: float, rms: float) -> np.ndarray:
        spectrum = np.fft.rfft(rng.standard_normal(n))
        spectrum[np.abs(s) > 2 * np.pi * cutoff_hz] = 0.0
        spectrum[0] = 0.0
        return spectrum * (rms / np.fft.irfft(spectrum, n).std())

    def impedance(K: float, B: float, J: float) -> np.ndarray:
        return K + B * s + J * s**2

    command, inside = noise(20.0, 20.0), noise(2.0, inside_nm)
    device = impedance(stiffness, 0.05, 0.002)
    angle = (command - inside) / (impedance(*TRUTH.values()) + device)
    spectra = {"angle": angle, "torque": command - device * angle, "command": command}
    return {name: np.fft.irfft(spectrum, n) for name, spectrum in spectra.items()}


def fits_beside_device(seeds: range, stiffness: float) -> list[JointFit]:
    return [identify_joint(beside_device(seed, stiffness), rate_hz=500.0) for seed in seeds]


def errors_pct(fit: JointFit) -> np.ndarray:
    return np.array([100 * (fit.parameter(name).value / x - 1) for name, x in TRUTH.items()])


def covers(fit: JointFit) -> list[bool]:
    parameters = [fit.parameter(name) for name in TRUTH]
    return [p.ci_low <= x <= p.ci_high for p, x in zip(parameters, TRUTH.values(), strict=True)]


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("rate_hz", [500.0, 1000.0])
@pytest.mark.parametrize(
    ("K", "B", "J"),
    [(800.0, 3.0, 0.4), (20.0, 0.5, 0.3), (10.0, 0.3, 0.002)],
    ids=["stiff-heavy", "soft-heavy", "soft-light"],
)
def test_known_parameters_come_back_to_a_thousandth(
    estimator: str, rate_hz: float, K: float, B: float, J: float
) -> None:
    data = multisine(K, B, J, rate_hz=rate_hz)
    fit = identify_joint(data, rate_hz=rate_hz, estimator=estimator)
    found = [p.value for p in fit.parameters]
    assert fit.status == "ok"
    np.testing.assert_allclose(found, [K, B, J], rtol=1e-3)
    assert fit.vaf_pct == pytest.approx(100.0, abs=0.01)


def test_torque_inside_the_joint_biases_the_regression_but_not_the_admittance() -> None:
    data = torque_perturbed(1)
    regression = identify_joint(data, rate_hz=500.0, estimator="least_squares")
    admittance = identify_joint({name: data[name] for name in ("angle", "torque")}, rate_hz=500.0)
    assert admittance.estimator == "admittance"
    assert identify_joint(data, rate_hz=500.0).estimator == "instrumental_variable"
    assert np.abs(errors_pct(admittance)).max() < 2.0
    stiffness = regression.parameter("stiffness")
    assert (stiffness.unbounded or stiffness.value) < 0.96 * TRUTH["stiffness"]
    assert regression.vaf_pct > 95.0  # and nothing in the VAF shows it


def test_the_regression_is_right_where_the_angle_was_perturbed() -> None:
    data = multisine(*TRUTH.values(), rate_hz=500.0, duration_s=60.0)
    inside = band_noise(30_000, 500.0, 2.0, 0.5, np.random.default_rng(3))
    data["torque"] = data["torque"] + inside
    fit = identify_joint(data, rate_hz=500.0, input="angle")
    assert fit.estimator == "least_squares"
    assert all(covers(fit))
    assert not fit.warnings


@pytest.mark.parametrize("stiffness", [0.4, 60.0, 1000.0])
def test_the_commanded_torque_as_instrument_is_right_beside_a_device(stiffness: float) -> None:
    device = (stiffness, 0.3, 0.01)
    command_nm = 5.0 * (1.0 + stiffness / 60.0)
    data = torque_perturbed(2, device=device, command_nm=command_nm, inside_nm=0.5)
    fit = identify_joint(data, rate_hz=500.0, estimator="instrumental_variable")
    assert np.abs(errors_pct(fit)).max() < 2.0
    assert all(covers(fit))


def test_the_sign_and_a_moderate_gain_of_the_command_do_not_matter() -> None:
    data = beside_device(1, 100.0)
    scaled = data | {"command": -0.7 * data["command"]}
    found, same = (identify_joint(d, rate_hz=500.0).to_frame()["value"] for d in (scaled, data))
    np.testing.assert_allclose(found, same, rtol=1e-3)


def test_a_torque_far_above_its_command_is_refused() -> None:
    data = beside_device(1, 100.0)
    with pytest.raises(EstimationError) as refused:
        identify_joint(data | {"command": 1e-3 * data["command"]}, rate_hz=500.0)
    assert refused.value.code == "torque_unlike_command"


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [0.4, 20.0, 100.0, 1000.0])
def test_over_forty_records_one_percent_and_honest_intervals_beside_any_device(
    stiffness: float,
) -> None:
    fits = fits_beside_device(range(100, 140), stiffness)
    errors = np.array([errors_pct(fit) for fit in fits])
    assert np.abs(errors.mean(axis=0)).max() < 1.0
    # 33 of 40 is the 0.1 % point of the binomial at 0.95.
    assert (np.sum([covers(fit) for fit in fits], axis=0) >= 33).all()


def test_a_command_that_has_nothing_to_do_with_the_record_decides_nothing() -> None:
    data = torque_perturbed(3)
    data["command"] = torque_perturbed(4)["command"]
    fit = identify_joint(data, rate_hz=500.0, estimator="instrumental_variable")
    assert fit.status == "undecided"
    assert [p.value for p in fit.parameters] == [None, None, None]


def test_a_parameter_at_its_bound_is_exactly_zero_with_a_one_sided_interval() -> None:
    data = multisine(50.0, -0.5, 0.02, rate_hz=500.0)
    data["torque"] = data["torque"] + band_noise(10_000, 500.0, 2.0, 0.1, np.random.default_rng(5))
    fit = identify_joint(data, rate_hz=500.0, input="angle", estimator="bounded_least_squares")
    damping = fit.parameter("damping")
    assert fit.status == damping.status == "at_bound"
    assert damping.value == 0.0
    assert damping.ci_low == 0.0 < damping.ci_high
    assert damping.unbounded == pytest.approx(-0.5, abs=0.02)
    assert fit.parameter("stiffness").status == "ok"
    assert fit.parameter("stiffness").value == pytest.approx(50.0, abs=1.0)


def coverage(seeds: range, estimator: str) -> np.ndarray:
    fits = [
        identify_joint(
            torque_perturbed(seed, duration_s=20.0, rate_hz=150.0),
            rate_hz=150.0,
            estimator=estimator,
        )
        for seed in seeds
    ]
    # The check of the residual refuses one sound record in a hundred.
    accepted = [fit for fit in fits if fit.status == "ok"]
    assert len(accepted) >= 0.97 * len(fits)
    return np.sum([covers(fit) for fit in accepted], axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["admittance", "instrumental_variable"])
def test_intervals_hold_the_truth_in_nineteen_of_twenty_records(estimator: str) -> None:
    # 180 of 200 is the 0.2 % point of the binomial at 0.95. No upper limit: damping, whose
    # band holds no muscle here, comes out at 0.98 to 0.99, a little too wide.
    assert (coverage(range(1000, 1200), estimator) >= 180).all()
