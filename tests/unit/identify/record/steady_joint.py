"""Exact steady motion of a joint, for tests of the models of one record."""

import numpy as np

RATE = 500.0
KBJ = np.array([80.0, 1.2, 0.03])


def make_record(
    perturbed: str = "torque",
    *,
    kbj: np.ndarray = KBJ,
    seed: int = 0,
    n: int = 15_000,
    muscle: float = 0.0,
    noise: tuple[float, float] = (1e-3, 0.1),
) -> dict[str, np.ndarray]:
    """Return a sum of sines with sensor noise of angle (rad) and torque (N*m).

    ``perturbed`` is a flat spectrum to 20 Hz; ``muscle`` N*m RMS below 2 Hz act inside the joint,
    beside the measured torque.
    """
    rng = np.random.default_rng(seed)
    s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / RATE)
    joint = kbj @ np.stack([np.ones_like(s), s, s**2])

    def band(below_hz: float, rms: float) -> np.ndarray:
        x = np.fft.rfft(rng.standard_normal(n)) * (np.abs(s) < 2 * np.pi * below_hz)
        return x * (rms / np.fft.irfft(x, n).std())

    inside = band(2.0, muscle) if muscle else 0.0
    if perturbed == "torque":
        torque = band(20.0, 4.0)
        angle = (torque + inside) / joint
    else:
        angle = band(20.0, 0.03)
        torque = joint * angle - inside
    cut = slice(n // 10, -n // 10)  # no whole period: the ends are as they come
    angle, torque = (np.fft.irfft(z, n)[cut] for z in (angle, torque))
    return {
        "angle": angle + noise[0] * rng.standard_normal(angle.size),
        "torque": torque + noise[1] * rng.standard_normal(angle.size),
    }
