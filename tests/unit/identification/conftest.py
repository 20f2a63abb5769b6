"""Records of a knee, an actuator bench and a torque loop, made in closed form."""

import numpy as np
import pandas as pd
import pytest


@pytest.fixture(scope="session")
def knee_table():
    """K 80, B 1.2, J 0.02 under a sum of sines of the angle; SI."""
    t = np.arange(8000) / 500.0
    w = 2 * np.pi * np.linspace(0.3, 9.0, 20)[:, None]
    phase = np.random.default_rng(1).uniform(0, 6.28, 20)[:, None]
    s, c = np.sin(w * t + phase), np.cos(w * t + phase)
    torque = 0.01 * ((80.0 - 0.02 * w**2) * s + 1.2 * w * c).sum(axis=0)
    return pd.DataFrame({"t": t, "angle": 0.01 * s.sum(axis=0), "torque": torque})


@pytest.fixture(scope="session")
def actuator_table():
    """Torque constant 0.1 behind a gear of 9, bias and friction, without inertia; SI."""
    t = np.arange(10_000) / 500.0
    current = 5.0 * np.sign(np.sin(2 * np.pi * 0.31 * t)) + np.sin(2 * np.pi * 0.05 * t)
    omega = 2 * np.pi * 0.77
    velocity, acceleration = 3.0 * np.sin(omega * t), 3.0 * omega * np.cos(omega * t)
    torque = 0.2 + 0.9 * current - (0.38 + 0.09 * np.abs(current)) * np.sign(velocity)
    return pd.DataFrame({"t": t, "i": current, "w": velocity, "a": acceleration, "torque": torque})
