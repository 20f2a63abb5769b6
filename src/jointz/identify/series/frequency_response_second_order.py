"""The second-order joint behind a frequency or an impulse response."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student_t

from jointz.core.errors import DataError, EstimationError
from jointz.identify.series.frequency_response_spectra import JointSpectra
from jointz.identify.series.joint_estimators import ESTIMATORS
from jointz.identify.series.joint_record import JointRecord, sign_warnings
from jointz.identify.series.joint_signals import default_estimator, prepare_signals
from jointz.identify.series.second_order_check import check_second_order, withhold_parameters
from jointz.kernels.series.spectra_second_order import (
    RecordSpectra,
    SpectrumFit,
    fit_second_order,
    record_spectra,
)
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.second_order_verdict import SecondOrderCheck

PARAMETERS = ("stiffness", "damping", "inertia")
ILL_CONDITIONED = "ill_conditioned"
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
_LARGE_ANGLE_RAD = 0.2
#: Noise of the input that could not be told is noted above this share of its power: K, B, J are
#: off by about as much.
_NOTED_NOISE_SHARE = 1e-3
#: Frequencies at which less than this share of either signal is signal speak for no direction.
_LEAST_SIGNAL = 0.1


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """K, B, J of one record with what must be said about them."""

    fit: SpectrumFit  # numbers
    weighting: str  # ``error`` or ``even``
    parameters: tuple[ParameterEstimate, ...]  # with intervals
    status: str  # ``ok`` or ``undecided``
    check: SecondOrderCheck  # whether the residual refutes a second-order joint
    ci_method: str  # how intervals were made
    warnings: tuple[str, ...]  # what a reader must know
    input_noise_sd: float  # sd of the white noise taken off the input, its unit; 0 where unknown

    @property
    def covariance(self) -> tuple[tuple[float, ...], ...]:
        """(3, 3) of K, B, J; empty where they are withheld."""
        return () if self.check.fails else tuple(map(tuple, self.fit.covariance.tolist()))

    @property
    def estimator(self) -> str:
        """Name of the estimator with its weights."""
        weights = "weighted by the error" if self.weighting == "error" else "evenly weighted"
        return f"frequency-domain errors in variables, {weights}"


def estimate_second_order(
    record: JointRecord, found: JointSpectra, *, ci_level: float, model: str, where: str
) -> tuple[SecondOrder, RecordSpectra]:
    """Fit K, B, J to the whole record inside the band.

    Where a joint is plainly not of second order (reflexes), weights by the
    error would let a few frequencies decide; then all weigh alike, as in a
    regression in time, and a warning says so.
    """
    command = record.channels.get("command") if found.perturbed == "torque" else None
    try:
        spectra = record_spectra(
            record.channels["angle"],
            record.channels["torque"],
            rate_hz=record.rate_hz,
            highest_hz=found.highest_hz,
            command=command,
        )
    except ValueError as exc:
        raise DataError(f"{where}: {exc}. Record longer, or raise cutoff_hz.") from exc
    fit = fit_second_order(spectra, perturbed=found.perturbed)
    misfit = _misfit(fit, found, spectra)
    weighting = "even" if misfit > _MISFIT else "error"
    if weighting == "even":
        fit = fit_second_order(spectra, perturbed=found.perturbed, weighting=weighting)
    _check_condition(fit)
    settled = fit.converged and bool(np.isfinite(fit.covariance).all())
    warnings = () if settled else ("undecided: the fit did not settle",)
    ci_method = f"sandwich over {fit.n_bins} frequencies, Student's t" if settled else "none"
    parameters = _parameters(fit, settled=settled, ci_level=ci_level, ci_method=ci_method)
    noise = spectra.noise[1 if found.perturbed == "torque" else 0] if command is None else 0.0
    check = _check(record, found, fit.covariance)
    if check.fails:
        parameters, note = withhold_parameters(parameters, check, model)
        warnings, ci_method = (note, *warnings), "none"
    result = SecondOrder(
        fit=fit,
        weighting=weighting,
        parameters=parameters,
        status="ok" if settled and not check.fails else "undecided",
        check=check,
        ci_method=ci_method,
        warnings=(*warnings, *_doubts(record, fit, found, spectra, misfit=misfit)),
        input_noise_sd=float(np.sqrt(noise / spectra.window_power)),
    )
    return result, spectra


def _check(record: JointRecord, found: JointSpectra, covariance: np.ndarray) -> SecondOrderCheck:
    """Test the residual of the same joint fitted in time, inside the same band."""
    has_command = "command" in record.channels
    estimate = ESTIMATORS[default_estimator(found.perturbed, has_command=has_command)]
    try:
        signals = prepare_signals(record, found.highest_hz)
        solution = estimate(signals)
    except (DataError, EstimationError):
        return SecondOrderCheck()
    if solution.doubt:
        return SecondOrderCheck()
    return check_second_order(
        estimate, solution, signals, cutoff_hz=found.highest_hz, covariance=covariance
    )


def _misfit(fit: SpectrumFit, found: JointSpectra, spectra: RecordSpectra) -> float:
    """Return unexplained power of the second-order joint over that of any linear response.

    Both over the same frequencies, away from the slowest, where the smoothed
    spectra hold what lies below them.
    """
    lowest_hz = 2.0 * found.spectra.resolution_hz
    curve = found.band & (found.spectra.frequency_hz >= lowest_hz)
    bins = spectra.s.imag >= 2.0 * np.pi * lowest_hz
    any_linear = float(found.error_power[curve].sum())
    total, output = float(found.output_power[curve].sum()), float(fit.output_power[bins].sum())
    if total <= 0.0 or output <= 0.0:
        return 1.0
    second_order = float(fit.error_power[bins].sum()) / output
    return second_order / max(any_linear / total, _SMALLEST_ERROR)


def _check_condition(fit: SpectrumFit) -> None:
    if not fit.condition_number < _LARGEST_CONDITION:
        raise EstimationError(
            ILL_CONDITIONED,
            "stiffness, damping and inertia cannot be told apart: the scaled equations have "
            f"condition number {fit.condition_number:.3g}, expected below "
            f"{_LARGEST_CONDITION:.0g}. Perturb with more than one frequency, or raise cutoff_hz.",
        )


def _parameters(
    fit: SpectrumFit, *, settled: bool, ci_level: float, ci_method: str
) -> tuple[ParameterEstimate, ...]:
    if not settled:
        return tuple(
            ParameterEstimate(name, None, None, None, "undecided", ci_level, ci_method)
            for name in PARAMETERS
        )
    wide = float(student_t.ppf((1.0 + ci_level) / 2.0, fit.n_bins - len(PARAMETERS)))
    reach = wide * np.sqrt(np.diag(fit.covariance))
    return tuple(
        ParameterEstimate(
            name, float(value), float(value - r), float(value + r), "ok", ci_level, ci_method
        )
        for name, value, r in zip(PARAMETERS, fit.values, reach, strict=True)
    )


def _doubts(
    record: JointRecord,
    fit: SpectrumFit,
    found: JointSpectra,
    spectra: RecordSpectra,
    *,
    misfit: float,
) -> tuple[str, ...]:
    notes = []
    if found.perturbed == "angle" or spectra.instrument is None:
        notes += _direction_doubts(fit, found, spectra, record.rate_hz)
        notes += _untold_noise(found, spectra)
    if misfit > _MISFIT:
        notes.append(
            f"the joint is not of second order: it leaves {misfit:.1f} times the power that any "
            "linear response leaves (reflexes, a lag between the sensors?). All frequencies weigh "
            "alike, the values depend on the band, and the intervals do not know it"
        )
    largest = float(np.abs(record.channels["angle"]).max())
    if largest > _LARGE_ANGLE_RAD:
        notes.append(
            f"the angle moves {largest:.2f} rad from its mean, above {_LARGE_ANGLE_RAD} rad: one "
            "stiffness may not hold over such a range"
        )
    return (*notes, *sign_warnings(fit.values))


def _untold_noise(found: JointSpectra, spectra: RecordSpectra) -> list[str]:
    """Say how much of the input's power may be noise that was not taken off.

    It is no more than what the coherence leaves, however broad the input.
    """
    share = spectra.untold_share[1 if found.perturbed == "torque" else 0]
    band = found.band
    power = found.spectra.auto_in[band]
    share = min(share, float(np.average(1.0 - found.coherence[band], weights=power)))
    if share <= _NOTED_NOISE_SHARE:
        return []
    off = "large" if found.perturbed == "torque" else "small"
    return [
        f"noise of the {found.perturbed} cannot be told from its signal, which reaches up to half "
        f"the sampling rate: up to {100 * share:.2g} % of its power may be white noise, by which "
        f"stiffness and inertia are too {off}; the intervals do not know it. Sample faster, "
        "perturb less broadly, or give the command"
    ]


def _direction_doubts(
    fit: SpectrumFit, found: JointSpectra, spectra: RecordSpectra, rate_hz: float
) -> list[str]:
    """Say when the record speaks for the other input, or when the choice decides the stiffness."""
    other_name = "angle" if found.perturbed == "torque" else "torque"
    plain = replace(spectra, instrument=None)
    other = fit_second_order(plain, perturbed=other_name)
    c = np.maximum(found.coherence, 1e-6)
    # The other direction's response is the same cross-spectrum over the other density.
    turned = found.impedance * c if found.perturbed == "torque" else found.impedance / c
    ours_kept = _share_of_signal(spectra, found.perturbed, found.spectra.auto_in, rate_hz)
    theirs_kept = _share_of_signal(spectra, other_name, found.spectra.auto_out, rate_hz)
    # Noise of the input, taken off the values too, lowers the response that it drives.
    truer = found.impedance * _turn(ours_kept, found.perturbed)
    turned = turned * _turn(theirs_kept, other_name)
    # Both are judged at the same frequencies, with the same doubt.
    used = found.band & (np.minimum(ours_kept, theirs_kept) >= _LEAST_SIGNAL)
    if not used.any():
        return []
    unsure = np.hypot(1.0 / ours_kept - 1.0, 1.0 / theirs_kept - 1.0)[used]
    sd = np.hypot(found.relative_sd[used], _SMOOTHING_SD)
    sd = np.hypot(sd, unsure / np.sqrt(found.spectra.n_averages))
    ours, bins = _chi_square(found, used, truer, values=fit.values, sd=sd)
    theirs, _ = _chi_square(found, used, turned, values=other.values, sd=sd)
    noise, inside = _noise_of(spectra, found.perturbed), found.spectra.auto_in[found.band].mean()
    untold = spectra.untold_share[0 if found.perturbed == "angle" else 1]
    noisy = noise / rate_hz > _NOISY_INPUT * inside or untold > _NOISY_INPUT
    if theirs < ours - (_CLEARLY_BETTER if noisy else _BETTER) and theirs < _STILL_FITS * bins:
        return [
            f"the record looks {other_name}-perturbed: a second-order joint fits the response "
            f"estimated with the {other_name} as the input better than this one (chi square "
            f"{theirs:.0f} against {ours:.0f}). If the {other_name} was perturbed, choose input "
            f"'{other_name}': this direction takes torque inside the joint for its response"
        ]
    change = other.values[0] / fit.values[0] - 1.0
    if abs(change) > _DISAGREEMENT:
        return [
            f"with the {other_name} as the input stiffness would be {other.values[0]:.3g}, "
            f"{100 * change:+.0f} %: be sure that the {found.perturbed} was perturbed"
        ]
    return []


def _share_of_signal(
    spectra: RecordSpectra, name: str, density: np.ndarray, rate_hz: float
) -> np.ndarray:
    """Return which share of a channel's density is not its white noise, (f,)."""
    noise = _noise_of(spectra, name) / rate_hz
    share: np.ndarray = np.maximum(1.0 - noise / np.maximum(density, 1e-300), 1e-6)
    return share


def _noise_of(spectra: RecordSpectra, name: str) -> float:
    """Return the one-sided density of a channel's white noise times the sampling rate."""
    return 2.0 * spectra.noise[0 if name == "angle" else 1] / spectra.window_power


def _turn(share: np.ndarray, name: str) -> np.ndarray:
    """Return what the impedance is multiplied by where so much of its input is signal."""
    return share if name == "torque" else 1.0 / share


def _chi_square(
    found: JointSpectra,
    used: np.ndarray,
    impedance: np.ndarray,
    *,
    values: np.ndarray,
    sd: np.ndarray,
) -> tuple[float, float]:
    """Return the squared distance of a response from a joint in sd, and the independent bins."""
    s = 2j * np.pi * found.spectra.frequency_hz[used]
    model = values @ np.stack([np.ones_like(s), s, s**2])
    distance = np.abs(impedance[used] / model - 1.0) ** 2 / (2.0 * sd**2)
    share = found.spectra.frequency_hz[1] / found.spectra.resolution_hz
    return float(distance.sum() * share), float(distance.size * share)
