"""The second-order joint behind a frequency or an impulse response."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.record.block_regression import t_factor
from jointz.identify.record.frequency_response_spectra import ImpedanceSpectra
from jointz.identify.record.joint_estimators import ESTIMATORS
from jointz.identify.record.joint_record import (
    JOINT,
    PARAMETERS,
    JointRequest,
    angle_warnings,
    value_warnings,
)
from jointz.identify.record.joint_signals import default_estimator, prepare_signals
from jointz.identify.record.second_order_check import check_second_order, withhold_parameters
from jointz.kernels.series.spectra_second_order import (
    RecordSpectra,
    SpectrumFit,
    fit_second_order,
    record_spectra,
)
from jointz.results.estimates import ParameterEstimate
from jointz.results.impedance_limits import weakest_status, withhold_impossible
from jointz.results.series.second_order_verdict import SecondOrderCheck

_LARGEST_CONDITION = 1e3
#: Unexplained power over what any linear response leaves, above which the joint is not of
#: second order.
_MISFIT = 1.5
#: Share of the output's power that smoothing alone may leave.
_SMALLEST_ERROR = 1e-4
#: The other direction must fit this much better (chi square) before it is said to be the right
#: one, and itself not be further from the response than this, a frequency. Where more than this
#: share of the input's power is noise, what was taken off scatters too, and more is asked.
_BETTER, _CLEARLY_BETTER = 3.0, 10.0
_NOISY_INPUT = 0.01
_STILL_FITS = 4.0
_DISAGREEMENT = 0.05
#: Relative error that smoothing leaves on the curve, however little noise there is.
_SMOOTHING_SD = 0.01
#: Noise of the input that could not be told is noted above this share of its power: K, B, J are
#: off by about as much.
_NOTED_NOISE_SHARE = 1e-3
#: Frequencies at which less than this share of either signal is signal speak for no direction.
_LEAST_SIGNAL = 0.1
#: Order of the channels in the spectra of a record.
_CHANNELS = ("angle", "torque")


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """K, B, J of one record, their test and warnings."""

    request: JointRequest
    spectra: ImpedanceSpectra
    model: str  # ``frf`` or ``irf``
    fit: SpectrumFit  # fitted K, B, J and their covariance
    weighting: str  # ``error`` or ``even``
    parameters: tuple[ParameterEstimate, ...]  # K, B, J with intervals
    status: str  # ``ok`` or ``undecided``
    check: SecondOrderCheck  # whether the residual refutes a second-order joint
    ci_method: str  # way of making the intervals
    warnings: tuple[str, ...]
    # sd of the white noise removed from the input, rad or N*m; 0 where unknown
    input_noise_sd: float

    def result_fields(self, **settings: Any) -> dict[str, Any]:
        """Return the fields that results of both models have."""
        record = self.spectra.record
        weights = "weighted by the error" if self.weighting == "error" else "evenly weighted"
        covariance = () if self.check.fails else tuple(map(tuple, self.fit.covariance.tolist()))
        return {
            "model": self.model,
            "estimator": f"frequency-domain errors in variables, {weights}",
            "input": self.request.input,
            "parameters": self.parameters,
            "vaf_of": self.request.output,
            "status": self.status,
            "n_samples": record.time.size,
            "rate_hz": record.rate_hz,
            "cutoff_hz": self.spectra.highest_hz,
            "condition_number": self.fit.condition_number,
            "covariance": covariance,
            "ci_method": self.ci_method,
            "settings": self.request.settings(**settings, input_noise_sd=self.input_noise_sd),
            "warnings": self.warnings,
            "check": self.check,
        }


def estimate_second_order(
    request: JointRequest, spectra: ImpedanceSpectra, *, model: str
) -> SecondOrder:
    """Fit K, B, J to the whole record inside the band.

    Where a joint is plainly not of second order (reflexes), weights by the
    error would let a few frequencies decide; then all weigh alike, as in a
    regression in time, and a warning says so.
    """
    transform = _transform(spectra)
    fit = fit_second_order(transform, perturbed=spectra.perturbed)
    misfit = _misfit(fit, spectra, transform)
    weighting = "even" if misfit > _MISFIT else "error"
    if weighting == "even":
        fit = fit_second_order(transform, perturbed=spectra.perturbed, weighting=weighting)
    if not fit.condition_number < _LARGEST_CONDITION:
        raise EstimationError(
            Failure.ILL_CONDITIONED.value,
            "stiffness, damping and inertia cannot be told apart: the scaled equations have "
            f"condition number {fit.condition_number:.3g}, expected below "
            f"{_LARGEST_CONDITION:.0g}. Perturb with more than one frequency, or raise cutoff_hz.",
        )
    settled = fit.converged and bool(np.isfinite(fit.covariance).all())
    warnings = [] if settled else ["undecided: the fit did not settle"]
    ci_method = f"sandwich over {fit.n_bins} frequencies, Student's t" if settled else "none"
    parameters = withhold_impossible(_parameters(fit, request.ci_level, ci_method))
    check = _check(spectra, fit.covariance)
    if check.fails:
        parameters, note = withhold_parameters(parameters, check, model)
        warnings, ci_method = [note, *warnings], "none"
    if transform.instrument is None:
        warnings += _direction_warnings(fit, spectra, transform)
        warnings += _noise_warnings(spectra, transform)
    if misfit > _MISFIT:
        warnings.append(
            f"the joint is not of second order: it leaves {misfit:.1f} times the power that any "
            "linear response leaves (reflexes, a lag between the sensors?). All frequencies weigh "
            "alike, the values depend on the band, and the intervals do not know it"
        )
    warnings += angle_warnings(spectra.record.channels["angle"]) + value_warnings(fit.values)
    noise = 0.0 if transform.instrument is not None else _white_noise(transform, spectra.perturbed)
    return SecondOrder(
        request=request,
        spectra=spectra,
        model=model,
        fit=fit,
        weighting=weighting,
        parameters=parameters,
        status=weakest_status(parameters),
        check=check,
        ci_method=ci_method,
        warnings=tuple(warnings),
        input_noise_sd=float(np.sqrt(noise / transform.window_power)),
    )


def _transform(spectra: ImpedanceSpectra) -> RecordSpectra:
    channels = spectra.record.channels
    try:
        return record_spectra(
            channels["angle"],
            channels["torque"],
            rate_hz=spectra.record.rate_hz,
            highest_hz=spectra.highest_hz,
            command=channels.get("command") if spectra.perturbed == "torque" else None,
        )
    except ValueError as exc:
        raise DataError(f"{JOINT}: {exc}. Record longer, or raise cutoff_hz.") from exc


def _check(spectra: ImpedanceSpectra, covariance: np.ndarray) -> SecondOrderCheck:
    """Test the residual of the same joint fitted in time, inside the same band."""
    record, cutoff_hz = spectra.record, spectra.highest_hz
    has_command = "command" in record.channels
    estimate = ESTIMATORS[default_estimator(spectra.perturbed, has_command=has_command)]
    try:
        signals = prepare_signals(record, cutoff_hz)
        solution = estimate(signals)
    except (DataError, EstimationError):
        return SecondOrderCheck()
    if solution.doubt:
        return SecondOrderCheck()
    return check_second_order(
        estimate, solution, signals, cutoff_hz=cutoff_hz, covariance=covariance
    )


def _misfit(fit: SpectrumFit, spectra: ImpedanceSpectra, transform: RecordSpectra) -> float:
    """Return unexplained power of the second-order joint over that of any linear response.

    Both over the same frequencies, away from the slowest, where the smoothed
    spectra hold what lies below them.
    """
    lowest_hz = 2.0 * spectra.spectra.resolution_hz
    curve = spectra.band & (spectra.spectra.frequency_hz >= lowest_hz)
    bins = transform.s.imag >= 2.0 * np.pi * lowest_hz
    any_linear = float(spectra.error_power[curve].sum())
    total, output = float(spectra.output_power[curve].sum()), float(fit.output_power[bins].sum())
    if total <= 0.0 or output <= 0.0:
        return 1.0
    second_order = float(fit.error_power[bins].sum()) / output
    return second_order / max(any_linear / total, _SMALLEST_ERROR)


def _parameters(fit: SpectrumFit, ci_level: float, ci_method: str) -> tuple[ParameterEstimate, ...]:
    if ci_method == "none":
        return tuple(
            ParameterEstimate(name, None, None, None, "undecided", ci_level, ci_method)
            for name in PARAMETERS
        )
    reach = t_factor(ci_level, fit.n_bins - len(PARAMETERS)) * np.sqrt(np.diag(fit.covariance))
    return tuple(
        ParameterEstimate(
            name, float(value), float(value - r), float(value + r), "ok", ci_level, ci_method
        )
        for name, value, r in zip(PARAMETERS, fit.values, reach, strict=True)
    )


def _white_noise(transform: RecordSpectra, name: str) -> float:
    return float(transform.noise[_CHANNELS.index(name)])


def _untold_share(transform: RecordSpectra, name: str) -> float:
    return float(transform.untold_share[_CHANNELS.index(name)])


def _noise_warnings(spectra: ImpedanceSpectra, transform: RecordSpectra) -> list[str]:
    """Return a warning of noise of the input that was not taken off.

    It is no more than what the coherence leaves, however broad the input.
    """
    perturbed, band = spectra.perturbed, spectra.band
    power = spectra.spectra.auto_in[band]
    incoherent = float(np.average(1.0 - spectra.coherence[band], weights=power))
    share = min(_untold_share(transform, perturbed), incoherent)
    if share <= _NOTED_NOISE_SHARE:
        return []
    off = "large" if perturbed == "torque" else "small"
    return [
        f"noise of the {perturbed} cannot be told from its signal, which reaches up to half "
        f"the sampling rate: up to {100 * share:.2g} % of its power may be white noise, by which "
        f"stiffness and inertia are too {off}; the intervals do not know it. Sample faster, "
        "perturb less broadly, or give the command"
    ]


def _direction_warnings(
    fit: SpectrumFit, spectra: ImpedanceSpectra, transform: RecordSpectra
) -> list[str]:
    """Return a warning if the other input fits better, or gives another stiffness."""
    perturbed, values = spectra.perturbed, fit.values
    other = "angle" if perturbed == "torque" else "torque"
    other_values = fit_second_order(transform, perturbed=other).values
    noise, other_noise = (
        2.0 * _white_noise(transform, name) / transform.window_power / spectra.record.rate_hz
        for name in (perturbed, other)
    )
    c = np.maximum(spectra.coherence, 1e-6)
    # The other direction's response is the same cross-spectrum over the other density.
    turned = spectra.impedance * c if perturbed == "torque" else spectra.impedance / c
    kept = _signal_share(noise, spectra.spectra.auto_in)
    other_kept = _signal_share(other_noise, spectra.spectra.auto_out)
    # Noise of the input, taken off the values too, lowers the response that it drives.
    truer = spectra.impedance * _correction(kept, perturbed)
    turned = turned * _correction(other_kept, other)
    # Both are judged at the same frequencies, with the same doubt.
    used = spectra.band & (np.minimum(kept, other_kept) >= _LEAST_SIGNAL)
    if not used.any():
        return []
    unsure = np.hypot(1.0 / kept - 1.0, 1.0 / other_kept - 1.0)[used]
    sd = np.hypot(spectra.relative_sd[used], _SMOOTHING_SD)
    sd = np.hypot(sd, unsure / np.sqrt(spectra.spectra.n_averages))
    s = 2j * np.pi * spectra.spectra.frequency_hz[used]
    independent = spectra.spectra.frequency_hz[1] / spectra.spectra.resolution_hz  # share of bins
    distance = float(_chi_square(s, truer[used], values, sd) * independent)
    other_distance = float(_chi_square(s, turned[used], other_values, sd) * independent)
    noisy = noise > _NOISY_INPUT * spectra.spectra.auto_in[spectra.band].mean()
    noisy = noisy or _untold_share(transform, perturbed) > _NOISY_INPUT
    margin = _CLEARLY_BETTER if noisy else _BETTER
    fits = other_distance < _STILL_FITS * float(s.size * independent)
    if other_distance < distance - margin and fits:
        return [
            f"the record looks {other}-perturbed: a second-order joint fits the response "
            f"estimated with the {other} as the input better than this one (chi square "
            f"{other_distance:.0f} against {distance:.0f}). If the {other} was perturbed, choose "
            f"input '{other}': this direction takes torque inside the joint for its response"
        ]
    change = other_values[0] / values[0] - 1.0
    if abs(change) > _DISAGREEMENT:
        return [
            f"with the {other} as the input stiffness would be {other_values[0]:.3g}, "
            f"{100 * change:+.0f} %: be sure that the {perturbed} was perturbed"
        ]
    return []


def _signal_share(noise: float, density: np.ndarray) -> np.ndarray:
    """Return the share of a channel's density that is not its white noise, (f,)."""
    return np.asarray(np.maximum(1.0 - noise / np.maximum(density, 1e-300), 1e-6))


def _chi_square(s: np.ndarray, impedance: np.ndarray, values: np.ndarray, sd: np.ndarray) -> float:
    """Return the squared distance of a response from a second-order joint, in sds."""
    model = values @ np.stack([np.ones_like(s), s, s**2])
    return float((np.abs(impedance / model - 1.0) ** 2 / (2.0 * sd**2)).sum())


def _correction(share: np.ndarray, name: str) -> np.ndarray:
    """Return the factor of the impedance where so much of its input is signal."""
    return share if name == "torque" else 1.0 / share
