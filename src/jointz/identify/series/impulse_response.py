"""One time series of any joint to its impulse response."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.signal import firwin, resample_poly
from scipy.stats import norm

from jointz.core import provenance
from jointz.core.errors import DataError
from jointz.identify.series.frequency_response_second_order import (
    SecondOrder,
    estimate_second_order,
)
from jointz.identify.series.frequency_response_spectra import (
    Input,
    TorqueSide,
    joint_spectra,
    prepare_record,
)
from jointz.identify.series.joint_record import JointRecord, check_choice, gather_record
from jointz.kernels.series.impulse_response_estimate import ImpulseEstimate, estimate_response
from jointz.results.series.impulse_response_fit import ImpulseCurve, ImpulseResponseFit

_WHERE = "identify_impulse_response"
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
class _Decimated:
    """Input and output low-passed and thinned, and what is left of white noise of variance one."""

    x: np.ndarray
    y: np.ndarray
    rate_hz: float
    noise: np.ndarray


def identify_impulse_response(  # noqa: PLR0913 - the fixed public signature of identify
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    command: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    input: Input = "torque",
    torque_acts_on: TorqueSide = "joint",
    cutoff_hz: float | None = None,
    length_s: float | None = None,
    ci_level: float = 0.95,
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
    check_choice("input", input, get_args(Input))
    check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
    if not 0.0 < ci_level < 1.0:
        raise ValueError(f"ci_level: expected 0 < ci_level < 1, got {ci_level}")
    given = {"angle": angle, "torque": torque, "command": command, "time": time}
    raw = gather_record(recording, given, rate_hz=rate_hz, where=_WHERE)
    record = prepare_record(raw, torque_acts_on)
    _check_length(record, length_s)
    found = joint_spectra(record, perturbed=input, cutoff_hz=cutoff_hz, where=_WHERE)
    joint, _ = estimate_second_order(record, found, ci_level=ci_level, model="irf", where=_WHERE)
    longest_s = length_s or _default_length_s(joint.fit.values, input)
    _check_length(record, longest_s)
    thin = _decimate(record, found.highest_hz, perturbed=input)
    estimate = _respond(thin, longest_s, perturbed=input, noise_sd=joint.input_noise_sd)
    return ImpulseResponseFit(
        model="irf",
        estimator=joint.estimator,
        input=input,
        response_of="admittance" if input == "torque" else "impedance",
        parameters=joint.parameters,
        vaf_pct=estimate.vaf_pct,
        second_order_vaf_pct=joint.fit.vaf_pct,
        vaf_of="angle" if input == "torque" else "torque",
        status=joint.status,
        curve=_curve(estimate, joint, thin.rate_hz, perturbed=input, ci_level=ci_level),
        n_kept=estimate.singular.size,
        step_s=1.0 / thin.rate_hz,
        n_samples=record.time.size,
        rate_hz=record.rate_hz,
        cutoff_hz=found.highest_hz,
        condition_number=joint.fit.condition_number,
        covariance=joint.covariance,
        ci_method=joint.ci_method,
        settings={
            "length_s": longest_s,
            "directions": "smallest description length",
            "input_noise_sd": joint.input_noise_sd,
            "torque_acts_on": torque_acts_on,
            "ci_level": ci_level,
            "sha256": record.sha256,
            "jointz": provenance.software()["jointz"],
        },
        warnings=joint.warnings,
        check=joint.check,
    )


def _check_length(record: JointRecord, length_s: float | None) -> None:
    if length_s is None:
        return
    if not 0.0 < length_s < np.inf:
        raise ValueError(f"length_s: expected > 0 s, got {length_s:g}")
    seconds = record.time.size / record.rate_hz
    if seconds < _FEWEST_LENGTHS * length_s:
        raise DataError(
            f"{_WHERE}: the record lasts {seconds:.4g} s, at least {_FEWEST_LENGTHS:.0f} impulse "
            f"responses of {length_s:.4g} s are needed. Record longer, or, in Python, shorten "
            "length_s."
        )


def _default_length_s(values: np.ndarray, perturbed: str) -> float:
    if perturbed == "angle":
        return _IMPEDANCE_S
    slowest = -float(np.max(np.roots(values[::-1]).real))
    decay_s = 1.0 / slowest if slowest > 0.0 else np.inf
    return float(np.clip(_DECAY_TIMES * decay_s, *_ADMITTANCE_S))


def _decimate(record: JointRecord, highest_hz: float, *, perturbed: str) -> _Decimated:
    """Low-pass without phase and thin; the same filter on both signals cancels."""
    names = ("torque", "angle") if perturbed == "torque" else ("angle", "torque")
    x, y = (record.channels[name] for name in names)
    step = max(1, int(record.rate_hz / (_SAMPLES_PER_PERIOD * highest_hz)))
    if step == 1:
        return _Decimated(x, y, record.rate_hz, np.ones(1))
    taps = firwin(
        2 * _FILTER_REACH * step + 1, _FILTER_CORNER / step, window=("kaiser", _FILTER_KAISER)
    )
    inside = slice(_FILTER_REACH, -_FILTER_REACH)
    x, y = (resample_poly(z, 1, step, window=taps)[inside] for z in (x, y))
    noise = np.convolve(taps, taps[::-1])[taps.size - 1 :: step]
    return _Decimated(x, y, record.rate_hz / step, noise)


def _respond(
    thin: _Decimated, longest_s: float, *, perturbed: str, noise_sd: float
) -> ImpulseEstimate:
    last = max(2, round(longest_s * thin.rate_hz))
    lags = last + 1 if perturbed == "torque" else 2 * last + 1
    noise = np.zeros(max(lags, thin.noise.size))
    noise[: thin.noise.size] = noise_sd**2 * thin.noise
    try:
        return estimate_response(
            thin.x,
            thin.y,
            first_lag=0 if perturbed == "torque" else -last,
            last_lag=last,
            input_noise=noise[:lags] if noise_sd > 0.0 else None,
        )
    except ValueError as exc:
        raise DataError(
            f"{_WHERE}: {exc}. Record longer, or, in Python, shorten length_s."
        ) from exc


def _curve(
    estimate: ImpulseEstimate,
    joint: SecondOrder,
    rate_hz: float,
    *,
    perturbed: str,
    ci_level: float,
) -> ImpulseCurve:
    reach = float(norm.ppf((1.0 + ci_level) / 2.0)) * estimate.sd * rate_hz
    response = estimate.response * rate_hz
    own = _second_order_response(joint.fit.values, estimate.lags, rate_hz, perturbed=perturbed)
    seen = estimate.basis @ (estimate.basis.T @ own)
    columns = {
        "lag_s": estimate.lags / rate_hz,
        "response": response,
        "low": response - reach,
        "high": response + reach,
        "fitted": seen,
    }
    return ImpulseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})


def _second_order_response(
    values: np.ndarray, lags: np.ndarray, rate_hz: float, *, perturbed: str
) -> np.ndarray:
    """Return the response of K, B, J per s: band-limited for the improper impedance."""
    K, B, J = values
    if perturbed == "torque":
        t = lags / rate_hz
        half = B / (2.0 * J)
        omega = np.sqrt(complex(K / J - half**2))
        # sin(w t)/w goes over into sinh for an overdamped joint, t for a critical one.
        shape = np.where(omega == 0.0, t, np.sin(omega * t) / (omega or 1.0))
        admittance: np.ndarray = np.real(np.exp(-half * t) * shape) / J
        # A sum over lags is short of the integral by the slope at zero (Euler and Maclaurin).
        admittance[lags == 0] += 1.0 / (12.0 * J * rate_hz)
        return admittance
    points = 64 * lags.size
    s = 2j * np.pi * np.fft.rfftfreq(points, 1.0 / rate_hz)
    circular = np.fft.irfft(K + B * s + J * s**2, points) * rate_hz
    impedance: np.ndarray = circular[lags]
    return impedance
