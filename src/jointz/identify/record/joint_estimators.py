"""Estimators of K, B, J from one prepared time series of a joint.

All fit torque = K*angle + B*velocity + J*acceleration + offset (1.5, 2.1). They
differ in which signal holds the error:

``least_squares``, ``bounded_least_squares``
    Torque on angle. Right when the angle was perturbed; with the torque
    perturbed, torque arising inside the joint biases K by about -18 %.
``admittance``
    Angle simulated from measured torque (output error). Right when the torque
    was perturbed and the actuator does not react to the angle.
``instrumental_variable``
    Torque on angle with the commanded torque as the instrument. Right in a
    loop too, such as a device with stiffness of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares as minimise_squares
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.kernels.block_sandwich import autocorrelation

#: Above this the regressors are one motion (a single sine): what the filter leaves at the edges,
#: a thousandth, would decide.
_LARGEST_CONDITION = 1e3
#: First-stage F of the weakest direction below which instruments are weak (Staiger and
#: Stock 1997, doi:10.2307/2171753).
_WEAK_F = 10.0
#: A parameter below this share of torque over motion stands at its bound.
_AT_BOUND = 1e-6
_START_FLOOR = 1e-3
#: Share of stiffness and damping, by the step, that an inertia does not show below.
_NO_INERTIA = 1e-3
#: Passes of the refined instruments; they change little after the second.
_IV_PASSES = 3


@dataclass(frozen=True, slots=True)
class JointSignals:
    """Filtered, uniformly sampled signals of one record, edges dropped."""

    rate_hz: float  # sampling rate
    time: np.ndarray  # s
    angle: np.ndarray  # offset removed, rad
    velocity: np.ndarray  # rad/s
    acceleration: np.ndarray  # rad/s^2
    torque: np.ndarray  # torque on the joint, offset removed, N*m
    command: np.ndarray | None = None  # commanded torque, N*m

    def regressors(self) -> np.ndarray:
        """Return (n, 4): angle, velocity, acceleration, one."""
        ones = np.ones_like(self.angle)
        return np.column_stack([self.angle, self.velocity, self.acceleration, ones])

    def scale(self) -> np.ndarray:
        """Return (3,): torque over motion, the order of size K, B and J may have."""
        motion = np.column_stack([self.angle, self.velocity, self.acceleration])
        return np.asarray(np.std(self.torque) / np.std(motion, axis=0))


@dataclass(frozen=True, slots=True)
class Solution:
    """K, B, J of an estimator, with all that an interval needs."""

    kbj: np.ndarray  # K, B, J, SI
    # (n, p >= 3) instruments, the first three for K, B, J: the sum of instrument times residual is
    # zero
    instruments: np.ndarray
    bread: np.ndarray  # sum of instrument times regressor
    residual: np.ndarray  # measured minus modelled, N*m or rad
    measured: np.ndarray  # fitted signal, N*m or rad
    fitted_signal: str  # ``torque`` or ``angle``
    condition_number: float  # of the scaled regressors
    at_bound: np.ndarray  # (3,) bool: whether K, B, J are at their bound of zero
    unbounded: np.ndarray | None = None  # K, B, J without bounds, SI, where known
    doubt: str = ""  # reason for undecided values; "" otherwise


def least_squares(signals: JointSignals) -> Solution:
    """Regress torque on angle, velocity and acceleration."""
    X = signals.regressors()
    condition = _checked_condition(X[:, :3])
    size = np.linalg.norm(X, axis=0)
    coefficients = np.linalg.lstsq(X / size, signals.torque, rcond=None)[0] / size
    return _torque_solution(signals, X, coefficients, condition)


def bounded_least_squares(signals: JointSignals) -> Solution:
    """Regress torque on motion with K, B, J >= 0, as the dissertation does (4.2.3)."""
    free = least_squares(signals)
    X = free.instruments
    size = np.linalg.norm(X, axis=0)
    Q, R = np.linalg.qr(X / size)
    lower = np.array([0.0, 0.0, 0.0, -np.inf])
    solved = lsq_linear(R, Q.T @ signals.torque, bounds=(lower, np.inf), method="bvls")
    at_bound = solved.active_mask[:3] < 0
    coefficients = solved.x / size
    coefficients[:3][at_bound] = 0.0
    solution = _torque_solution(signals, X, coefficients, free.condition_number)
    return replace(solution, at_bound=at_bound, unbounded=free.kbj)


def instrumental_variable(signals: JointSignals) -> Solution:
    """Regress torque on motion with the commanded torque as the instrument.

    Instruments are the angle, velocity and acceleration that the command alone
    would cause in joint and device together: that is what it drives. Their K, B,
    J come of the command regressed on the motion, by least squares and then
    through the instruments of the previous pass (refined instruments, Young
    2011, Recursive Estimation, chapter 8). What arises inside the joint, or
    comes back through the device, is uncorrelated with them. Instruments of the
    joint alone would be right too, but weak beside a stiff device.
    """
    command = signals.command
    if command is None:
        raise DataError(
            "instrumental_variable: expected the commanded torque as the instrument, found no "
            "channel 'command'. Give command=, or choose estimator='admittance'.",
            channel="command",
        )
    if np.ptp(command) == 0:
        raise DataError(
            "instrumental_variable: the channel 'command' is constant and cannot be an "
            "instrument. Give the torque that was commanded, or estimator='admittance'.",
            channel="command",
        )
    X = signals.regressors()
    condition = _checked_condition(X[:, :3])
    Z = _instruments(signals, command - command.mean(), X)
    coefficients = _solved_through(Z, X, signals.torque)
    return replace(_torque_solution(signals, Z, coefficients, condition), doubt=_weakness(Z, X))


def admittance(signals: JointSignals) -> Solution:
    """Fit the angle that the measured torque causes in a second-order joint.

    Minimises the squared angle error over K, B, J >= 0. The joint is stepped
    exactly for a torque linear between samples; initial angle and velocity and
    the offset of the angle are projected out (variable projection, Kaufman
    1975, doi:10.1007/BF01932995). Torque arising inside the joint is error of
    the output and leaves no bias, so long as the measured torque does not react
    to the angle.
    """
    drive = _compensated_for_hold(signals.torque)
    unit = float(np.std(signals.angle))

    def residual(values: np.ndarray) -> np.ndarray:
        return np.asarray(_simulate(values, drive, signals)[0] / unit)

    def jacobian(values: np.ndarray) -> np.ndarray:
        return np.asarray(-_sensitivities(values, drive, signals)[0] / unit)

    start = _admittance_start(signals, residual)
    solved = minimise_squares(
        residual, start, jacobian, bounds=(0.0, np.inf), x_scale=start, xtol=1e-9, ftol=1e-12
    )
    sensitivity, error = _sensitivities(solved.x, drive, signals)
    at_bound = solved.x < _AT_BOUND * signals.scale()
    return Solution(
        kbj=np.where(at_bound, 0.0, solved.x),
        instruments=sensitivity,
        bread=sensitivity.T @ sensitivity,
        residual=error,
        measured=signals.angle,
        fitted_signal="angle",
        condition_number=_checked_condition(sensitivity),
        at_bound=at_bound,
        doubt="" if solved.success else "the output-error fit did not converge",
    )


#: Estimators by name.
ESTIMATORS: Mapping[str, Callable[[JointSignals], Solution]] = {
    "least_squares": least_squares,
    "bounded_least_squares": bounded_least_squares,
    "admittance": admittance,
    "instrumental_variable": instrumental_variable,
}


def _torque_solution(
    signals: JointSignals, Z: np.ndarray, coefficients: np.ndarray, condition: float
) -> Solution:
    X = signals.regressors()
    return Solution(
        kbj=coefficients[:3],
        instruments=Z,
        bread=Z.T @ X,
        residual=signals.torque - X @ coefficients,
        measured=signals.torque,
        fitted_signal="torque",
        condition_number=condition,
        at_bound=np.zeros(3, dtype=bool),
    )


def _checked_condition(motion: np.ndarray) -> float:
    centred = motion - motion.mean(axis=0)
    condition = float(np.linalg.cond(centred / np.linalg.norm(centred, axis=0)))
    if not condition < _LARGEST_CONDITION:
        raise EstimationError(
            Failure.ILL_CONDITIONED.value,
            "stiffness, damping and inertia cannot be told apart: the scaled regressors have "
            f"condition number {condition:.3g}, expected below {_LARGEST_CONDITION:.0g}. Perturb "
            "with more than one frequency, or raise cutoff_hz so that it does not remove them.",
        )
    return condition


def _instruments(signals: JointSignals, source: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Return (n, 4): the motion that ``source`` causes in joint and device together, and one."""
    Z = X
    for _ in range(_IV_PASSES):
        total = _solved_through(Z, X, source)[:3]
        # A source counted the other way makes the same instruments, turned.
        positive = np.copysign(1.0, total[2]) * total
        motion = simulate_motion(_stable(positive, signals), source, signals.rate_hz)
        Z = np.column_stack([*motion, np.ones_like(source)])
        Z /= np.linalg.norm(Z, axis=0)
    return Z


def _solved_through(Z: np.ndarray, X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return b of Z'X b = Z'y; least squares where the instruments are the regressors."""
    rows, columns = np.linalg.norm(Z, axis=0), np.linalg.norm(X, axis=0)
    scaled = Z / rows
    solved = np.linalg.lstsq(scaled.T @ (X / columns), scaled.T @ y, rcond=None)[0]
    return np.asarray(solved / columns)


def _weakness(Z: np.ndarray, X: np.ndarray) -> str:
    """Return why the instruments are weak, "" if they are not.

    The smallest canonical correlation of instruments and regressors makes the
    first-stage F of the worst direction; samples are counted as independent
    ones (Bartlett 1935: n over the sum of both autocorrelations' product).
    """
    centred = [np.linalg.qr(M[:, :3] - M[:, :3].mean(axis=0))[0] for M in (Z, X)]
    smallest = float(np.linalg.svd(centred[0].T @ centred[1], compute_uv=False)[-1])
    product = autocorrelation(Z[:, 0]) * autocorrelation(X[:, 0])
    independent = Z.shape[0] / max(1.0, 1.0 + 2.0 * float(product[1:].sum()))
    F = smallest**2 * independent / max(1.0 - smallest**2, np.finfo(float).tiny)
    if F >= _WEAK_F:
        return ""
    return (
        "the command is a weak instrument: it explains too little of the motion (smallest "
        f"canonical correlation {smallest:.2g}, F {F:.2g}, at least {_WEAK_F:g} needed); check "
        "that command and angle belong together, or record longer"
    )


def _stable(values: np.ndarray, signals: JointSignals) -> np.ndarray:
    """Return the nearest joint that can be simulated for a minute without running away."""
    return np.asarray(np.maximum(values, _START_FLOOR * signals.scale()))


def _admittance_start(
    signals: JointSignals, residual: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Choose the better of two starts: regression, and torque as its own instrument."""
    regression = least_squares(signals)
    X = regression.instruments
    Z = _instruments(signals, signals.torque, X)
    refined = _solved_through(Z, X, signals.torque)[:3]
    starts = [_stable(kbj, signals) for kbj in (regression.kbj, refined)]
    return min(starts, key=lambda values: float(np.sum(residual(values) ** 2)))


def _simulate(
    values: np.ndarray, drive: np.ndarray, signals: JointSignals
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angle error and the basis (n, 3) of the nuisance projected out."""
    to_angle, _, denominator = _discrete_joint(values, signals.rate_hz)
    forced = lfilter(to_angle, denominator, drive)
    basis = np.column_stack([_free_responses(denominator, drive.size), np.ones(drive.size)])
    Q = np.linalg.qr(basis)[0]
    error = signals.angle - forced
    return error - Q @ (Q.T @ error), Q


def _sensitivities(
    values: np.ndarray, drive: np.ndarray, signals: JointSignals
) -> tuple[np.ndarray, np.ndarray]:
    """Return d angle / d (K, B, J), (n, 3), nuisance projected out, and the angle error.

    With H = 1/(J s^2 + B s + K): dH/dK = -H^2, dH/dB = -s H^2, dH/dJ = -s^2 H^2.
    """
    error, Q = _simulate(values, drive, signals)
    modelled = signals.angle - error
    S = -np.column_stack(simulate_motion(values, modelled - modelled.mean(), signals.rate_hz))
    return S - Q @ (Q.T @ S), error


def simulate_motion(
    values: np.ndarray, torque: np.ndarray, rate_hz: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angle, velocity and acceleration that a torque causes in a joint at rest."""
    K, B, J = values
    # Without inertia there is no state: one that a sample does not show stands for it.
    J = max(J, _NO_INERTIA * (K / rate_hz + B) / rate_hz, np.finfo(float).tiny)
    to_angle, to_velocity, denominator = _discrete_joint(np.array([K, B, J]), rate_hz)
    drive = _compensated_for_hold(torque)
    angle = lfilter(to_angle, denominator, drive)
    velocity = lfilter(to_velocity, denominator, drive)
    return angle, velocity, (torque - K * angle - B * velocity) / J


def _discrete_joint(
    values: np.ndarray, rate_hz: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the filters torque to angle and to velocity, exact for torque linear in a step.

    Numerators of angle and velocity, and their common denominator, out of the
    matrix exponential of the state and its first-order hold.
    """
    K, B, J = values
    step = 1.0 / rate_hz
    M = np.zeros((4, 4))
    M[0, 1] = step
    M[1] = -K / J * step, -B / J * step, step / J, 0.0
    M[2, 3] = 1.0
    E = expm(M)
    now, after = E[:2, 2] - E[:2, 3], E[:2, 3]
    to_angle = [
        after[0],
        now[0] - E[1, 1] * after[0] + E[0, 1] * after[1],
        E[0, 1] * now[1] - E[1, 1] * now[0],
    ]
    to_velocity = [
        after[1],
        now[1] - E[0, 0] * after[1] + E[1, 0] * after[0],
        E[1, 0] * now[0] - E[0, 0] * now[1],
    ]
    denominator = [1.0, -(E[0, 0] + E[1, 1]), np.exp(-B / J * step)]
    return np.array(to_angle), np.array(to_velocity), np.array(denominator)


def _free_responses(denominator: np.ndarray, n: int) -> np.ndarray:
    """Return (n, 2): two independent motions of the joint without torque."""
    slowest = float(np.abs(np.roots(denominator)).max())
    # Past 1e-17 of its start a response is zero: denormal numbers are slow to filter.
    lasting = n if slowest >= 1.0 else min(n, int(-39.0 / np.log(slowest)) + 3)
    impulse = np.zeros(lasting)
    impulse[0] = 1.0
    responses = np.zeros((n, 2))
    responses[:lasting, 0] = lfilter([1.0, -1.0], denominator, impulse)
    responses[:lasting, 1] = lfilter([0.0, 1.0], denominator, impulse)
    return responses


def _compensated_for_hold(x: np.ndarray) -> np.ndarray:
    """Return the samples whose straight-line interpolation has the spectrum of ``x``.

    Joining samples by lines multiplies the spectrum by (sin(wT/2)/(wT/2))^2,
    -1 % at 30 Hz and 500 Hz sampling; 1 - d^2/12 + d^4/90 (d: central
    difference) undoes it to 1e-5.
    """
    d2, d4 = np.array([0, 1, -2, 1, 0]), np.array([1, -4, 6, -4, 1])
    kernel = np.array([0, 0, 1, 0, 0]) - d2 / 12.0 + d4 / 90.0
    padded = np.pad(x, 2, mode="reflect", reflect_type="odd")
    return np.convolve(padded, kernel, mode="valid")
