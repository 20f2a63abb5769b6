"""Sensors of the laboratory: what they write of the true motion, and their calibration."""

from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.signal import bilinear, lfilter

from . import gait
from . import leg as lg
from .person import Person

RATE_HZ = 500
DEC = 2  # steps between samples of the simulation that the sensors see
_CALIBRATION_SD = {
    "angle_lag_s": 0.0007, "torque_lag_s": 0.0003, "joint_encoder_lag_s": 0.0003,
    "shank_velocity_lag_s": 0.0005, "thigh_velocity_lag_s": 0.0005, "angle_gain": 0.015,
    "torque_gain": 0.01, "joint_encoder_gain": 0.003, "shank_velocity_gain": 0.005,
    "thigh_velocity_gain": 0.005,
}  # fmt: skip


def _mounted(signal: np.ndarray, hz: float, damping: float) -> np.ndarray:
    """Return the motion of a mass on soft skin whose base moves like the bone."""
    omega, rate = 2 * np.pi * hz, 1 / (lg.DT * DEC)
    b, a = bilinear([2 * damping * omega, omega**2], [1, 2 * damping * omega, omega**2], rate)
    return signal[0] + lfilter(b, a, signal - signal[0])


def _sample(signal: np.ndarray, lag: float, n: int) -> np.ndarray:
    at = np.arange(n) / RATE_HZ - lag
    return np.interp(at, np.arange(len(signal)) * lg.DT * DEC, signal)


def record(
    person: Person, out: np.ndarray, command: np.ndarray, strikes: np.ndarray,
    rng: np.random.Generator,
) -> pd.DataFrame:  # fmt: skip
    """Return the recording of a run (every `DEC`-th step in `out`)."""
    s, n = person.sensors, int(len(out) * lg.DT * DEC * RATE_HZ)
    time = np.arange(n) / RATE_HZ
    deg = np.degrees(out[:, : lg.O_ANKLE])
    drift = 0.3 * lfilter([0.01], [1, -np.exp(-1 / 20 / RATE_HZ)], rng.standard_normal(n))
    knee = _mounted(deg[:, lg.O_KNEE], s["angle_mount_hz"], s["angle_mount_damping"])
    thigh_v = -deg[:, lg.O_HIP_V]
    shank = _mounted(deg[:, lg.O_KNEE_V] + thigh_v, s["shank_mount_hz"], s["shank_mount_damping"])
    thigh = _mounted(thigh_v, s["thigh_mount_hz"], s["thigh_mount_damping"])

    def read(signal: np.ndarray, name: str, noise: float) -> np.ndarray:
        value = s[f"{name}_gain"] * _sample(signal, s[f"{name}_lag_s"], n)
        return value + noise * rng.standard_normal(n)

    contact = np.zeros(n, dtype=int)
    for start, end in pairwise(strikes):
        on = start + rng.normal(0.004, 0.003)
        off = start + gait.TOE_OFF * (end - start) + rng.normal(0.0, 0.01)
        contact[(time >= on) & (time < off)] = 1 if on < time[-1] else 0
    encoder = read(deg[:, lg.O_ARM], "joint_encoder", 0.0)
    return pd.DataFrame({
        "time_s": time.round(4),
        "knee_angle_deg": (read(knee, "angle", s["angle_noise_deg"]) + drift).round(3),
        "torque_nm": read(out[:, lg.O_MOTOR], "torque", s["torque_noise_nm"]).round(3),
        "command_nm": command[:: round(1 / RATE_HZ / lg.DT)][:n],
        "footswitch": contact,
        "encoder_deg": (encoder / 0.022).round() * 0.022,
        "shank_gyro_deg_s": read(shank, "shank_velocity", s["gyroscope_noise_deg_s"]).round(2),
        "thigh_gyro_deg_s": read(thigh, "thigh_velocity", s["gyroscope_noise_deg_s"]).round(2),
    })  # fmt: skip


def calibration(person: Person, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """Return value and SD of what the laboratory measured of each instrument's errors."""
    entries = {
        key: (person.sensors[key] + sd * rng.standard_normal(), sd)
        for key, sd in _CALIBRATION_SD.items()
    }
    inertia = person.device[2]
    entries["intrinsic_inertia"] = (inertia * (1 + 0.05 * rng.standard_normal()), 0.05 * inertia)
    return entries
