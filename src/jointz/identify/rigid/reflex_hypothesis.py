"""Hypotheses that the joint also has a stretch reflex.

In the window of a pulse a reflex resembles late stiffness and less damping, so that pulses of one
direction and size hardly distinguish it from K and B. The joint is not simulated again: its
response to the torque of a reflex is added to the estimated parameters as a linear term.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jointz.identify.rigid.response_model import CellResponse, Posterior, response_to_kick
from jointz.kernels.response_search import K

#: Latencies of reflexes of leg muscles after the stretch.
LATENCIES_S = (0.03, 0.06)
#: Prior sd of reflex stiffness over K, about zero: muscles may also relax.
_GAIN_SD = 0.3
#: Time to the peak of a twitch.
_TWITCH_S = 0.04
#: Least stiffness that scales a reflex, as a share of torque over motion.
_LEAST_SIZE = 0.2


def reflex_shape(
    i: int, response: CellResponse, posterior: Posterior, *, latency_s: float
) -> np.ndarray:
    """Return the change of the angle of a timing point by a reflex as large as K, (n,) rad.

    Velocity of stretch, half-wave rectified, delayed, through a critically damped twitch
    (Kearney, Stein & Parameswaran 1997, IEEE Transactions on Biomedical Engineering 44, 493).
    """
    shown, period_s = posterior.fitted[i], response.period_s
    n = shown.size
    times = np.arange(n) * period_s
    twitch = times / _TWITCH_S * np.exp(-times / _TWITCH_S)
    late = round(latency_s / period_s)
    stretch = np.concatenate([np.zeros(late), np.gradient(shown, period_s).clip(0.0)])[:n]
    return moved_by(i, response, posterior, pull=np.convolve(stretch, twitch)[:n] * period_s)


def moved_by(
    i: int, response: CellResponse, posterior: Posterior, *, pull: np.ndarray
) -> np.ndarray:
    """Return the change of the measured angle by an additional torque against it, (n,) rad."""
    shown = posterior.fitted[i]
    kick = response_to_kick(posterior, i, period_s=response.period_s, n=shown.size)
    resistance = float(np.abs(response.torque.sum(axis=0)).max() / np.abs(shown).max())
    size = max(float(posterior.point(i)[K]), _LEAST_SIZE * resistance)
    return np.asarray(-size * np.convolve(kick, pull)[: shown.size])


def with_reflexes(
    posteriors: Sequence[Posterior], cells: Sequence[CellResponse]
) -> list[Posterior]:
    """Return posteriors without a reflex and, equally probable, with one of each latency.

    The gain, reflex torque over K, is common to all timing points. It is added to first order
    about the mode, as one more column of a regression with its own prior.
    """
    likeliest = max(posteriors, key=lambda p: p.log_evidence)
    weights = [cell.weights() for cell in cells]
    hypotheses = [_less_likely(p, 0.5) for p in posteriors]
    for latency_s in LATENCIES_S:
        shapes = [
            reflex_shape(i, cell, likeliest, latency_s=latency_s) for i, cell in enumerate(cells)
        ]
        for p in posteriors:
            reflex = replace(
                _with_reflex(p, cells, weights, shapes),
                hypothesis=replace(p.hypothesis, reflex_s=latency_s),
            )
            hypotheses.append(_less_likely(reflex, 0.5 / len(LATENCIES_S)))
    return hypotheses


def _less_likely(posterior: Posterior, chance: float) -> Posterior:
    return replace(posterior, log_evidence=posterior.log_evidence + float(np.log(chance)))


def _with_reflex(
    posterior: Posterior,
    cells: Sequence[CellResponse],
    weights: Sequence[np.ndarray],
    shapes: Sequence[np.ndarray],
) -> Posterior:
    """Return the posterior with the gain of a reflex among the fitted parameters."""
    p = posterior
    along = sum(gain @ s for gain, s in zip(p.gains, shapes, strict=True))
    slope = np.linalg.solve(p.bread, along)
    weighted = [s @ w for s, w in zip(shapes, weights, strict=True)]
    curvature = sum(t @ s for t, s in zip(weighted, shapes, strict=True)) - slope @ along
    curvature += _GAIN_SD**-2
    residuals = [c.angle - f for c, f in zip(cells, p.fitted, strict=True)]
    gain = float(sum(t @ r for t, r in zip(weighted, residuals, strict=True)) / curvature)
    gains = tuple(
        g - np.outer(along, (t - slope @ g) / curvature)
        for g, t in zip(p.gains, weighted, strict=True)
    )
    bread = p.bread + np.outer(along, along) / curvature
    reach = along / (_GAIN_SD * curvature)
    covariance = bread @ p.prior_precision @ bread + np.outer(reach, reach)
    covariance += sum(g @ c.noise @ g.T for g, c in zip(gains, cells, strict=True))
    # Change of the fit by the other parameters: their Jacobian times their change.
    taken = [np.linalg.solve(w, g.T @ slope) for w, g in zip(weights, p.gains, strict=True)]
    return replace(
        p,
        values=p.values - gain * along,
        bread=bread,
        gains=gains,
        covariance=covariance,
        reflex_reach=reach,
        fitted=tuple(f + gain * (s - t) for f, s, t in zip(p.fitted, shapes, taken, strict=True)),
        log_evidence=p.log_evidence
        + 0.5 * gain**2 * curvature
        - 0.5 * float(np.log(curvature * _GAIN_SD**2)),
    )
