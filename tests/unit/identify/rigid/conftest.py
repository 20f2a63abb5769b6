"""Average responses of known joints, made by another integrator."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from jointz.identify.rigid.response_model import CellResponse

PERIOD_S, N, STEP_S = 0.002, 56, 0.0005
TIME_S = np.arange(N) * PERIOD_S


@pytest.fixture(scope="session")
def noisy_responses(walkers) -> Callable[..., list[CellResponse]]:
    """Return a maker of noisy average responses, one a joint, behind a sensor that is late."""
    fine = np.arange(1200) * STEP_S

    @lru_cache
    def late_answer(joint, lag_s):
        motion = walkers.respond(joint, lambda t: 17.0 * float(walkers.pulse(t)))
        # 2 ms late and behind a first-order lag.
        keep = np.exp(-STEP_S / (lag_s - 0.002))
        shown = np.zeros_like(motion)
        for i in range(1, 400):
            middle = 0.5 * (motion[i] + motion[i - 1])
            shown[i] = keep * shown[i - 1] + (1.0 - keep) * middle
        return np.interp(TIME_S - 0.002, fine, shown, left=0.0)

    def make(*joints, sd_rad=1e-3, seed=0, lag_s=0.008):
        rng = np.random.default_rng(seed)
        smooth = np.exp(-0.5 * ((TIME_S[:, None] - TIME_S) / 0.03) ** 2)
        covariance = sd_rad**2 * (0.05 * np.eye(N) + smooth)
        torque = np.stack([17.0 * walkers.pulse(TIME_S), np.zeros(N)])
        made = []
        for k, joint in enumerate(joints):
            noise = np.linalg.cholesky(covariance) @ rng.standard_normal(N)
            angle = late_answer(joint, lag_s) + noise
            phase = 0.2 + 0.3 * k
            made.append(CellResponse(str(k), angle, torque, covariance, PERIOD_S, phase, 1.1))
        return made

    return make
