"""Impulse response of a joint, and K, B, J, from one time series."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import firwin, resample_poly
from scipy.stats import norm

from jointz.core.errors import DataError
from jointz.identify.record.frequency_response_second_order import (
    SecondOrder,
    estimate_second_order,
)
from jointz.identify.record.frequency_response_spectra import ImpedanceSpectra, impedance_spectra
from jointz.identify.record.joint_record import JOINT, JointRecord, JointRequest
from jointz.kernels.series.impulse_response_estimate import ImpulseEstimate, estimate_response
from jointz.results.series.impulse_response_fit import ImpulseCurve, ImpulseResponseFit

#: Samples of the decimated record in one period of the highest frequency.
_SAMPLES_PER_PERIOD = 5.0
#: Half-length of the decimation filter in samples of the decimated record; its corner over the
#: new half rate.
_FILTER_REACH = 10
_FILTER_CORNER = 0.9
_FILTER_KAISER = 5.0
#: Two-sided impedance: a reflex comes later than 40 ms and is not of the joint itself.
_IMPEDANCE_S = 0.04
#: One-sided admittance: so many times the slowest decay, within these limits.
_DECAY_TIMES = 8.0
_ADMITTANCE_S = (0.05, 1.0)
_FEWEST_LENGTHS = 10.0


@dataclass(frozen=True, slots=True)
class _DecimatedRecord:
    x: np.ndarray  # input, low-passed and thinned, rad or N*m
    y: np.ndarray  # output, low-passed and thinned, N*m or rad
    rate_hz: float  # rate of the thinned record
    noise: np.ndarray  # autocovariance of filtered white noise of unit variance


def fit_impulse_response(
    request: JointRequest, length_s: float | None = None
) -> ImpulseResponseFit:
    """Estimate the impulse response of a joint, and K, B, J.

    Both signals are decimated to five samples a period of ``cutoff_hz``. The
    response solves Wiener-Hopf (1.4) with a pseudo-inverse
    (:func:`jointz.kernels.series.impulse_response_estimate.estimate_response`; Westwick and
    Kearney 1997). Its bounds are of noise, not of what the perturbation did not
    contain. Joining an improper impedance to a sampled response leaves
    wiggles of the band's end; compare with ``fitted``, which has them too.

    K, B, J are those of the frequency domain, fitted to the same record in the same
    band with the error's weights: a fit to the points of the response has about
    1.4 times the error. A response longer than 40 ms holds reflexes, the second-order
    joint cannot. With a device that reacts to the joint the response is biased as
    (1.2) is; K, B, J are not where a command is given.
    """
    if length_s is not None:
        _check_length(request.record, length_s)
    spectra = impedance_spectra(request)
    joint = estimate_second_order(request, spectra, model="irf")
    longest_s = length_s or _default_length_s(joint.fit.values, request.input)
    _check_length(request.record, longest_s)
    decimated = _decimate(spectra)
    estimate = _estimate(decimated, longest_s, joint)
    return ImpulseResponseFit(
        **joint.result_fields(length_s=longest_s, directions="smallest description length"),
        response_of="admittance" if request.input == "torque" else "impedance",
        vaf_pct=estimate.vaf_pct,
        second_order_vaf_pct=joint.fit.vaf_pct,
        curve=_curve(estimate, joint, decimated.rate_hz),
        n_kept=estimate.singular.size,
        step_s=1.0 / decimated.rate_hz,
    )


def _check_length(record: JointRecord, length_s: float) -> None:
    if not 0.0 < length_s < np.inf:
        raise ValueError(f"length_s: expected > 0 s, got {length_s:g}")
    if record.seconds < _FEWEST_LENGTHS * length_s:
        raise DataError(
            f"{JOINT}: the record lasts {record.seconds:.4g} s, at least {_FEWEST_LENGTHS:.0f} "
            f"impulse responses of {length_s:.4g} s are needed. Record longer, or, in Python, "
            "shorten length_s."
        )


def _default_length_s(values: np.ndarray, perturbed: str) -> float:
    if perturbed == "angle":
        return _IMPEDANCE_S
    slowest = -float(np.max(np.roots(values[::-1]).real))
    decay_s = 1.0 / slowest if slowest > 0.0 else np.inf
    return float(np.clip(_DECAY_TIMES * decay_s, *_ADMITTANCE_S))


def _decimate(spectra: ImpedanceSpectra) -> _DecimatedRecord:
    """Low-pass without phase and thin; the same filter on both signals cancels."""
    record = spectra.record
    names = ("torque", "angle") if spectra.perturbed == "torque" else ("angle", "torque")
    x, y = (record.channels[name] for name in names)
    step = max(1, int(record.rate_hz / (_SAMPLES_PER_PERIOD * spectra.highest_hz)))
    if step == 1:
        return _DecimatedRecord(x, y, record.rate_hz, np.ones(1))
    taps = firwin(
        2 * _FILTER_REACH * step + 1, _FILTER_CORNER / step, window=("kaiser", _FILTER_KAISER)
    )
    inside = slice(_FILTER_REACH, -_FILTER_REACH)
    x, y = (resample_poly(z, 1, step, window=taps)[inside] for z in (x, y))
    noise = np.convolve(taps, taps[::-1])[taps.size - 1 :: step]
    return _DecimatedRecord(x, y, record.rate_hz / step, noise)


def _estimate(decimated: _DecimatedRecord, longest_s: float, joint: SecondOrder) -> ImpulseEstimate:
    last = max(2, round(longest_s * decimated.rate_hz))
    first = 0 if joint.request.input == "torque" else -last
    lags = last - first + 1
    noise = np.zeros(max(lags, decimated.noise.size))
    noise[: decimated.noise.size] = joint.input_noise_sd**2 * decimated.noise
    try:
        return estimate_response(
            decimated.x,
            decimated.y,
            first_lag=first,
            last_lag=last,
            input_noise=noise[:lags] if joint.input_noise_sd > 0.0 else None,
        )
    except ValueError as exc:
        raise DataError(f"{JOINT}: {exc}. Record longer, or, in Python, shorten length_s.") from exc


def _curve(estimate: ImpulseEstimate, joint: SecondOrder, rate_hz: float) -> ImpulseCurve:
    request = joint.request
    reach = float(norm.ppf((1.0 + request.ci_level) / 2.0)) * estimate.sd * rate_hz
    response = estimate.response * rate_hz
    respond = _admittance if request.input == "torque" else _impedance
    fitted = respond(joint.fit.values, estimate.lags, rate_hz)
    columns = {
        "lag_s": estimate.lags / rate_hz,
        "response": response,
        "low": response - reach,
        "high": response + reach,
        "fitted": estimate.basis @ (estimate.basis.T @ fitted),
    }
    return ImpulseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})


def _admittance(values: np.ndarray, lags: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return the angle that K, B, J show after an impulse of torque, per s."""
    K, B, J = values
    t = lags / rate_hz
    half = B / (2.0 * J)
    omega = np.sqrt(complex(K / J - half**2))
    # sin(w t)/w goes over into sinh for an overdamped joint, t for a critical one.
    shape = np.where(omega == 0.0, t, np.sin(omega * t) / (omega or 1.0))
    admittance: np.ndarray = np.real(np.exp(-half * t) * shape) / J
    # A sum over lags is short of the integral by the slope at zero (Euler and Maclaurin).
    admittance[lags == 0] += 1.0 / (12.0 * J * rate_hz)
    return admittance


def _impedance(values: np.ndarray, lags: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return the improper impedance of K, B, J per s, limited to the band."""
    K, B, J = values
    points = 64 * lags.size
    s = 2j * np.pi * np.fft.rfftfreq(points, 1.0 / rate_hz)
    return np.asarray((np.fft.irfft(K + B * s + J * s**2, points) * rate_hz)[lags])
