import numpy as np
import pytest
from scipy import signal

from jointz.core.errors import DataError, EstimationError
from jointz.identify.bandwidth import identify_bandwidth

RATE = 1000.0


def make_loop(
    bandwidth_hz: float, *, order: int = 2, seed: int = 0, noise: float = 0.5, n: int = 30_000
) -> dict[str, np.ndarray]:
    """10 N*m RMS of noise below 40 Hz through a Butterworth loop, and sensor noise."""
    rng = np.random.default_rng(seed)
    command = signal.sosfilt(signal.butter(3, 40, fs=RATE, output="sos"), rng.standard_normal(n))
    command *= 10.0 / command.std()
    loop = signal.butter(order, bandwidth_hz, fs=RATE, output="sos")
    torque = signal.sosfilt(loop, command) + noise * rng.standard_normal(n)
    return {"command": command, "torque": torque}


def true_bandwidth_hz(bandwidth_hz: float, order: int) -> float:
    """Where the loop itself has lost 3 dB: half the power is 3.01 dB."""
    f, response = signal.sosfreqz(
        signal.butter(order, bandwidth_hz, fs=RATE, output="sos"),
        np.linspace(1, 50, 20_001),
        fs=RATE,
    )
    return float(np.interp(3.0, -20 * np.log10(np.abs(response)), f))


@pytest.mark.parametrize("method", ["welch", "blackman_tukey"])
@pytest.mark.parametrize(
    ("bandwidth_hz", "order"), [(3.0, 1), (10.0, 1), (10.0, 2), (17.2, 2), (26.8, 2)]
)
def test_the_bandwidth_of_a_known_loop_is_found(method, bandwidth_hz, order):
    true = true_bandwidth_hz(bandwidth_hz, order)
    fits = [
        identify_bandwidth(
            **make_loop(bandwidth_hz, order=order, seed=seed), rate_hz=RATE, method=method
        )
        for seed in range(8)
    ]

    assert np.mean([f.bandwidth_hz for f in fits]) == pytest.approx(true, rel=0.015)
    assert all(f.resolution_hz < 0.15 * true for f in fits)
    assert all(f.coherence > 0.95 for f in fits)
    assert fits[0].reference_gain == pytest.approx(1.0, abs=0.03)


def test_the_interval_holds_the_truth():
    true = true_bandwidth_hz(10.0, 2)
    held = []
    for seed in range(40):
        fit = identify_bandwidth(**make_loop(10.0, seed=seed, noise=3.0), rate_hz=RATE)
        held.append(fit.ci_low_hz < true < fit.ci_high_hz)

    assert np.mean(held) >= 0.85


def test_30_lags_are_refused_where_the_default_reads_right():
    """SCIENCE 3, trap 13: at 1 kHz they read 10 Hz as about 27 Hz, below what they resolve."""
    record = make_loop(10.0, order=1)

    with pytest.raises(EstimationError, match=r"reads 2[678]\.?\d* Hz, not above.* 33\.3 Hz") as e:
        identify_bandwidth(**record, rate_hz=RATE, method="blackman_tukey", window_s=0.03)

    assert e.value.code == "below_resolution"
    fit = identify_bandwidth(**record, rate_hz=RATE, method="blackman_tukey")
    assert fit.bandwidth_hz == pytest.approx(10.0, rel=0.02)
    assert fit.window_s > 1.0
    assert fit.settings["window"] == "chosen from the record"


def test_a_window_of_one_s_own_gives_its_resolution():
    record = make_loop(17.2)

    fit = identify_bandwidth(**record, rate_hz=RATE, window_s=0.5)

    assert fit.resolution_hz == pytest.approx(3.0)
    assert fit.settings["window"] == "given"
    assert any("times the resolution" in w for w in fit.warnings)


def test_the_loss_may_be_another():
    fit = identify_bandwidth(**make_loop(10.0, order=1), rate_hz=RATE, drop_db=6.0)

    assert fit.bandwidth_hz == pytest.approx(10.0 * np.sqrt(10**0.6 - 1.0), rel=0.02)


def test_the_gain_of_the_sensor_does_not_matter():
    record = make_loop(10.0)
    plain = identify_bandwidth(**record, rate_hz=RATE)

    scaled = identify_bandwidth(
        command=record["command"], torque=-7.0 * record["torque"] + 3.0, rate_hz=RATE
    )

    assert scaled.bandwidth_hz == pytest.approx(plain.bandwidth_hz)
    assert scaled.reference_gain == pytest.approx(7.0 * plain.reference_gain)


def test_command_uncorrelated_with_torque_is_refused():
    for seed in range(10):
        record = make_loop(10.0, seed=seed) | {"torque": make_loop(10.0, seed=50 + seed)["torque"]}
        with pytest.raises(EstimationError, match="command uncorrelated with torque") as caught:
            identify_bandwidth(**record, rate_hz=RATE)
        assert caught.value.code == "not_coherent"


@pytest.mark.parametrize("cut_hz", [40.0, None])
def test_a_bandwidth_above_the_excited_band_or_half_the_rate_is_refused(cut_hz):
    rng = np.random.default_rng(0)
    command = make_loop(10.0)["command"] if cut_hz else rng.standard_normal(20_000)

    with pytest.raises(EstimationError, match="does not fall by 3 dB inside the") as caught:
        identify_bandwidth(
            command=command, torque=command + 0.1 * rng.standard_normal(command.size), rate_hz=RATE
        )

    assert caught.value.code == "above_band"


def test_noise_at_the_crossing_is_noted():
    record = make_loop(10.0, noise=20.0)

    fit = identify_bandwidth(**record, rate_hz=RATE)

    assert any("coherence at the bandwidth" in w for w in fit.warnings)


@pytest.mark.parametrize(
    ("name", "code"), [("command", "constant_command"), ("torque", "constant_torque")]
)
def test_constant_signals_end_in_a_code(name, code):
    with pytest.raises(EstimationError, match=f"the {name} is constant") as caught:
        identify_bandwidth(**(make_loop(10.0) | {name: np.ones(30_000)}), rate_hz=RATE)

    assert caught.value.code == code


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"window_s": 100.0}, "expected a window of 4 to"),
        ({"window_s": 15.0}, "averages of this record, at least 4"),
        ({"method": "ar"}, "expected one of welch, blackman_tukey"),
        ({"drop_db": 0.0}, "drop_db: expected > 0"),
        ({"ci_level": 0.0}, "0 < ci_level < 1"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        identify_bandwidth(**make_loop(10.0), rate_hz=RATE, **settings)


def test_a_record_without_a_command_is_refused():
    with pytest.raises(DataError, match="identify_bandwidth: no channel 'command'"):
        identify_bandwidth(torque=np.ones(10), rate_hz=RATE)
