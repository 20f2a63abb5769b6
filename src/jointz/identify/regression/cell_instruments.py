"""Regression of torque on motion with the commanded torque as the instrument."""

import numpy as np
from scipy.signal import lfilter

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.identify.preparation.cell_data import (
    RAW_COMMAND,
    CellData,
    CellFit,
    FitSettings,
    check_average,
)
from jointz.identify.preparation.conditioning import TORQUE
from jointz.identify.regression.cell_equations import fitted_by_equations
from jointz.identify.regression.cell_estimator import CellMethod
from jointz.kernels.bounded_lsq import condition_numbers, normal_equations
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.kernels.series.second_order_recursion import transfer_coefficients

#: Refinements of the instruments, which change little after the second.
_PASSES = 3
#: Least K, B and J of the joint for the instruments, as a share of torque over motion.
_FLOOR = 1e-3
#: Least correlation of the instruments with the motion.
_LEAST_CORRELATION = 0.02
#: Least time constant of the joint for the instruments, samples.
_FEWEST_SAMPLES = 3.0
#: Padding of the command with its last value, in periods of the cut-off.
_PADDING_PERIODS = 5.0


def instrumental_variable(cell: CellData, settings: FitSettings) -> CellFit:
    """Regress torque on motion with instruments made of the commanded torque.

    The instruments are angle, velocity and acceleration of a second-order system, joint and device
    together, driven by the command. Its constants are from a regression of the command on the
    motion, refined three times (P. C. Young, Recursive Estimation and Time-Series Analysis, 2011,
    chapter 8). They are independent of torque that arises inside the joint or comes back through
    the device (SCIENCE trap 4).

    It needs no noise model and no delay from command to torque, because late instruments are weaker
    but not wrong. A lag between angle and torque, a wrong baseline and a wrong torque gain bias it
    like least squares.
    """
    average = cell.filtered.responses().mean(axis=0)
    check_average(average, float(condition_numbers(normal_equations(average[None])[0])[0]))
    command = _filtered_command(cell, settings)
    Q = _instruments(average, command, cell.unfiltered().lead, settings.rate_hz)

    def equations(averages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X = np.einsum("np,rcn->rpc", Q, averages[:, :TORQUE])
        y = averages[:, TORQUE] @ Q
        return np.einsum("rpi,rpj->rij", X, X), np.einsum("rpi,rp->ri", X, y)

    return fitted_by_equations(cell, settings, equations)


def _filtered_command(cell: CellData, settings: FitSettings) -> np.ndarray:
    """Return the average command, low-passed as angle and torque were."""
    windows = cell.unfiltered()
    command = windows.responses()[:, RAW_COMMAND].mean(axis=0)
    if not windows.recorded[:, RAW_COMMAND].any():
        raise EstimationError(
            Failure.NO_COMMAND,
            "instrumental_variable: expected the commanded torque as the instrument, found none. "
            "Name the channel 'command' in study.toml, or take another method.",
        )
    if not np.ptp(command) > 0.0:
        raise EstimationError(
            Failure.CONSTANT_COMMAND,
            "instrumental_variable: the channel 'command' does not change in the pulses' windows. "
            "Give the torque that was commanded, or take another method.",
        )
    padding = round(_PADDING_PERIODS * settings.rate_hz / settings.cutoff_hz)
    padded = np.pad(command, padding, mode="edge")
    smooth = lowpass_zero_phase(padded, cutoff_hz=settings.cutoff_hz, rate_hz=settings.rate_hz)
    return smooth[padding : padding + command.size]


def _instruments(average: np.ndarray, command: np.ndarray, lead: int, rate_hz: float) -> np.ndarray:
    """Return an orthonormal basis (n, 3) of the instruments."""
    X = average[:TORQUE].T
    n = len(X)
    window = command[lead : lead + n]
    floor = _FLOOR * np.abs(command).max() / np.abs(X).max(axis=0)
    size = np.linalg.norm(X, axis=0)
    values = np.linalg.lstsq(X / size, window, rcond=None)[0] / size
    Q = np.zeros((n, 3))
    for _ in range(_PASSES):
        motion = _driven(_slow(np.maximum(values, floor), rate_hz), command, rate_hz)
        motion = motion[:, lead : lead + n]
        Q = np.linalg.qr(motion.T / np.linalg.norm(motion, axis=1))[0]
        values = np.linalg.lstsq(Q.T @ (X / size), Q.T @ window, rcond=None)[0] / size
    common = np.linalg.svd(Q.T @ np.linalg.qr(X / size)[0], compute_uv=False)[-1]
    if not common > _LEAST_CORRELATION:
        raise EstimationError(Failure.NOT_COHERENT, Failure.NOT_COHERENT.meaning)
    return np.asarray(Q)


def _slow(values: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return the values with an inertia large enough for a motion of several samples."""
    K, B, J = values
    step = _FEWEST_SAMPLES / rate_hz
    return np.array([K, B, max(J, K * step**2, B * step)])


def _driven(values: np.ndarray, torque: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return angle, velocity and acceleration that a torque causes from rest, (3, n)."""
    a1, a2, *b = transfer_coefficients(values[0], values[1], values[2], 1.0 / rate_hz)
    angle = lfilter(b, [1.0, a1, a2], torque)
    velocity = np.gradient(angle) * rate_hz
    acceleration = (torque - values[0] * angle - values[1] * velocity) / values[2]
    return np.stack([angle, velocity, acceleration])


INSTRUMENTAL_VARIABLE = CellMethod(
    "instrumental_variable", "matched_strides", instrumental_variable, raw=True
)
