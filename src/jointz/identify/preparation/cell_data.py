"""Input and result of the fit of a cell, common to all methods."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Exclusion, Failure
from jointz.core.errors import EstimationError
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.baselines import Baseline
from jointz.identify.preparation.conditioning import ANGLE, TORQUE
from jointz.results.estimates import ParameterEstimate, Response

PARAMETERS = ("stiffness", "damping", "inertia")
#: Rows of unfiltered windows.
MATCHED_ANGLE, RAW_ANGLE, RAW_TORQUE, RAW_COMMAND = range(4)
#: Smaller signals are numerical noise, not a response.
_DUST_RAD = 1e-9
_DUST_NM = 1e-9
#: Largest condition number of the regressors.
_WORST_CONDITION = 1e6
#: A value below this share of torque over motion is rounding.
_ROUNDING_SHARE = 1e-9


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Settings of a fit."""

    n_resamples: int  # bootstrap resamples
    seed: int  # seed of the random generator of every cell
    rate_hz: float  # sampling rate of the responses
    # whether to follow 4.2.3 by the letter: the unperturbed mean is fixed, and the mean over
    # replicates is reported. Otherwise unperturbed strides are resampled too, and the plug-in
    # estimate is reported
    as_published: bool
    # sds that widen the intervals, and the intrinsic impedance to subtract
    calibration: CalibrationSpec
    mass_kg: float | None = None  # body mass, for values per kg
    wants_per_mass: bool = True  # whether values per kg are expected even if the mass is missing
    bounded: bool = True  # whether K, B, J >= 0 is required, as in 4.2.3, not in 2.2.3
    cutoff_hz: float = 20.0  # low-pass of the responses


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of the pulses of a cell and their baseline."""

    # (n_pulse, 4, n) recorded windows, baseline included; channels as in :class:`CellData`
    recorded: np.ndarray
    # (n_pulse,) sign of each pulse; responses are multiplied by it before averaging
    signs: np.ndarray
    baseline: Baseline  # unperturbed windows of each pulse
    lead: int = 0  # samples before the onset, and as many after the end of the window

    @property
    def turned(self) -> np.ndarray:
        """The signs, (n_pulse, 1, 1)."""
        return np.asarray(self.signs[:, None, None])

    def responses(self) -> np.ndarray:
        """Return windows minus baseline, turned by the sign, (n_pulse, 4, n)."""
        return np.asarray(self.turned * (self.recorded - self.baseline.mean()))


@dataclass(frozen=True, slots=True)
class CellData:
    """Data of a cell for a method."""

    # low-passed angle (rad), velocity (rad/s), acceleration (rad/s^2) and torque (N*m) from each
    # onset
    filtered: Windows
    # as sampled, from ``lead`` samples before each onset: angle for matching strides (rad), angle
    # (rad), torque (N*m) and commanded torque (N*m); None unless the method needs them
    raw: Windows | None = None

    def unfiltered(self) -> Windows:
        """Return the raw windows, which a method with ``raw`` has."""
        if self.raw is None:
            raise ValueError(
                "CellData: this method takes unfiltered windows, found none. Cut them too "
                "(CellMethod.raw)."
            )
        return self.raw


@dataclass(frozen=True, slots=True)
class CellFit:
    """The fit of one cell."""

    parameters: tuple[ParameterEstimate, ...]  # K, B, J and values per kg
    # VAF (2.7) of the torque of the average filtered response, %; None where undecided
    vaf_pct: float | None
    condition_number: float | None  # of the scaled regressors; None where undecided
    displacement_rad: float  # largest absolute angle of the average response
    response: Response | None  # the average response; None where undecided
    nuisance: tuple[ParameterEstimate, ...] = ()  # estimates beside the impedance


Fit = Callable[[CellData, FitSettings], CellFit]


def check_average(average: np.ndarray, condition: float) -> None:
    """Raise EstimationError for an average response that cannot be fitted."""
    for row, rounding, failure in (
        (ANGLE, _DUST_RAD, Failure.CONSTANT_ANGLE),
        (TORQUE, _DUST_NM, Failure.CONSTANT_TORQUE),
    ):
        if np.ptp(average[row]) < rounding:
            raise EstimationError(failure, failure.meaning)
    if not condition < _WORST_CONDITION:
        raise EstimationError(Failure.ILL_CONDITIONED, Failure.ILL_CONDITIONED.meaning)


def without_rounding(point: np.ndarray, average: np.ndarray) -> np.ndarray:
    """Return K, B, J with zero for values that are rounding."""
    motion = np.abs(average[:TORQUE]).max(axis=1)
    rounding = _ROUNDING_SHARE * np.abs(average[TORQUE]).max() / motion
    return np.where(np.abs(point) < rounding, 0.0, point)


def response_of(average: np.ndarray, fitted: np.ndarray, *, rate_hz: float) -> Response:
    """Return the average response with the torque fitted to it."""
    return Response(
        time_s=np.arange(average.shape[1]) / rate_hz,
        angle=average[ANGLE],
        torque=average[TORQUE],
        fitted_torque=fitted,
    )


def vaf_pct(average: np.ndarray, fitted: np.ndarray) -> float:
    """Return the share of the torque's second moment that a fit explains (2.7), %."""
    power = (average[TORQUE] ** 2).sum()
    return float(100.0 * (1.0 - ((fitted - average[TORQUE]) ** 2).sum() / power))


def calibration_sd(entry: Calibrated | None) -> float:
    """Return the sd of a calibration's entry, zero without one."""
    return 0.0 if entry is None else entry.sd


def intrinsic_impedance(known: CalibrationSpec) -> tuple[np.ndarray, np.ndarray]:
    """Return the device's own K, B and J in the torque, zero if unknown, and their sds."""
    none = Calibrated(value=0.0, sd=0.0)
    entries = [getattr(known, f"intrinsic_{name}") or none for name in PARAMETERS]
    return np.array([e.value for e in entries]), np.array([e.sd for e in entries])


def lag_sd(known: CalibrationSpec) -> float:
    """Return the sd of the lag between angle and torque, s; only their difference matters."""
    return float(np.hypot(calibration_sd(known.angle_lag_s), calibration_sd(known.torque_lag_s)))


def dead_signals(windows: np.ndarray) -> list[str]:
    """Return a code for each window with a constant signal, before a baseline is subtracted.

    A dead sensor minus a moving baseline looks like a response.
    """
    angle = np.ptp(windows[:, ANGLE], axis=1) < _DUST_RAD
    torque = np.ptp(windows[:, TORQUE], axis=1) < _DUST_NM
    codes = [Exclusion.CONSTANT_ANGLE.value, Exclusion.CONSTANT_TORQUE.value]
    return [str(code) for code in np.select([angle, torque], codes, default="")]
