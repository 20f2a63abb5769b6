"""Regression of a load's torque on its motion, seen through a lag, in one frequency band.

Both records pass the same Gaussian low-pass. Derivatives, delay and first-order filter act on
the angle's spectrum, so that no difference quotient and no fractional shift of a noisy record
is needed; the friction's sign passes the same filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, binary_opening

from jointz.identify.bench_records import EvenRecord, white_noise_sd

#: Standard deviation of the Gaussian low-pass in frequency, Hz (-3 dB at 0.83 of it), and the
#: largest share of the sampling rate it may take.
BAND_HZ = 40.0
_BAND_SHARE = 0.1
#: The direction of motion is read from a wider band: a reversal is sharp.
_SPEED_BAND = 2.25
#: Below this share of the RMS speed friction may hold the load: its torque is then unknown.
_SLOW_SHARE = 0.08
#: The direction must be this many sds of the speed's noise above it.
_SLOW_NOISE = 6.0
_SIGN_SHARE = 0.25  # of the slow speed: width of the smoothed sign
#: A fast reversal is slow for less than this, s, and its friction is known.
_SHORTEST_STICK_S = 0.003
#: Reach of the filter, in sds of its kernel: beside a stick, and at an end of the record.
_REACH = 4.0
_EDGE_REACH = 8.0
_EDGE_S = 0.01  # for the lag
#: Largest spread of a lag on the unphysical side of a pure delay, s^2.
_MOST_NEGATIVE_SPREAD = -5e-6
_PASSES = 30
_SMALL_LAG_STEP_S = 1e-9


@dataclass(frozen=True, slots=True)
class Lag:
    """A lag of the torque record: a delay, and a first-order filter of time constant tau.

    Parameters
    ----------
    total_s : float
        Delay plus tau.
    spread_s2 : float
        Square of tau; zero for a pure delay. Slightly negative values, which noise can
        bring about, raise high frequencies as much as positive ones lower them.
    """

    total_s: float = 0.0
    spread_s2: float = 0.0

    @property
    def filter_time_s(self) -> float:
        """Time constant of the filter, s."""
        return float(np.sqrt(max(self.spread_s2, 0.0)))

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response.

        Parameters
        ----------
        omega : (m,) float, rad/s
            Angular frequencies.
        """
        if self.spread_s2 < 0.0:
            response: np.ndarray = np.exp(
                -1j * omega * self.total_s - omega**2 * self.spread_s2 / 2
            )
            return response
        tau = self.filter_time_s
        response = np.exp(-1j * omega * (self.total_s - tau)) / (1.0 + 1j * omega * tau)
        return response


@dataclass(frozen=True, slots=True)
class BandRecord:
    """A trial inside the band, ready for the regression.

    Parameters
    ----------
    omega : (m,) float, rad/s
        Angular frequencies of the spectra.
    window : (m,) float
        The low-pass.
    angle, direction : (m,) complex
        Spectra of the angle and of the sign of the velocity; direction unfiltered.
    torque : (n,) float, N*m
        Measured torque, filtered.
    inside, keep : (n,) bool
        Samples away from the ends; of them those where friction does not hold the load.
    angle_noise_sd : float, rad
        White noise on the angle.
    step_s : float
        Time between samples.
    """

    omega: np.ndarray
    window: np.ndarray
    angle: np.ndarray
    direction: np.ndarray
    torque: np.ndarray
    inside: np.ndarray
    keep: np.ndarray
    angle_noise_sd: float
    step_s: float


@dataclass(frozen=True, slots=True)
class Regression:
    """Solution of the regression for one kind of lag.

    Parameters
    ----------
    values : (p,) float
        K, B, J and, where fitted, the friction torque.
    lag : Lag
        The lag.
    regressors : (n, p + q) float
        Columns of ``values`` and of the free parts of the lag, offsets removed.
    scores : (n, p + q) float
        Estimating functions, one row a sample.
    bread : (p + q, p + q) float
        Their derivative, corrected for the noise of the angle.
    residual, measured : (n,) float, N*m
        Of the filtered torque, offsets removed.
    noise_share : float
        Share of the acceleration's variance that is noise of the angle.
    spread_step_s2 : float
        How far the spread would move if it were free; zero where it is or the lag is given.
    """

    values: np.ndarray
    lag: Lag
    regressors: np.ndarray
    scores: np.ndarray
    bread: np.ndarray
    residual: np.ndarray
    measured: np.ndarray
    noise_share: float

    @property
    def condition_number(self) -> float:
        """Condition number of the scaled regressors."""
        size = np.linalg.norm(self.regressors, axis=0)
        if size.min() == 0.0:
            return float("inf")
        gram = (self.regressors / size).T @ (self.regressors / size)
        eigenvalues = np.linalg.eigvalsh(gram)
        return float(np.sqrt(eigenvalues[-1] / max(eigenvalues[0], 1e-300)))


def band_hz(step_s: float) -> float:
    """Return the standard deviation of the Gaussian low-pass, Hz.

    Parameters
    ----------
    step_s : float
        Time between samples.
    """
    return min(BAND_HZ, _BAND_SHARE / step_s)


def band_record(record: EvenRecord, *, friction: bool) -> BandRecord:
    """Return a trial's spectra, filtered torque and usable samples.

    Parameters
    ----------
    record : EvenRecord
        The trial.
    friction : bool
        Whether friction may hold the load at low speed.
    """
    n, band = record.angle.size, band_hz(record.step_s)
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, record.step_s)
    window = np.exp(-0.5 * (omega / (2.0 * np.pi * band)) ** 2)
    angle = np.fft.rfft(record.angle - record.angle.mean())
    torque = np.fft.irfft(window * np.fft.rfft(record.torque - record.torque.mean()), n)
    noise = white_noise_sd(record.angle)
    kernel_s = 1.0 / (2.0 * np.pi * band)
    inside = np.zeros(n, dtype=bool)
    edge = int(np.ceil((_EDGE_REACH * kernel_s + _EDGE_S) / record.step_s))
    inside[edge : n - edge] = True
    keep = inside.copy()
    direction = np.zeros_like(angle)
    if friction:
        speed_window = np.exp(-0.5 * (omega / (2.0 * np.pi * band * _SPEED_BAND)) ** 2)
        velocity = np.fft.irfft(1j * omega * speed_window * angle, n)
        noise_gain = np.sqrt(np.mean((omega * speed_window) ** 2))
        slow = max(_SLOW_SHARE * float(np.std(velocity)), _SLOW_NOISE * noise * float(noise_gain))
        direction = np.fft.rfft(np.tanh(velocity / (_SIGN_SHARE * slow)))
        keep &= ~_may_stick(np.abs(velocity) < slow, record.step_s, kernel_s)
    return BandRecord(omega, window, angle, direction, torque, inside, keep, noise, record.step_s)


def _may_stick(slow: np.ndarray, step_s: float, kernel_s: float) -> np.ndarray:
    """Return where a stick, which is slow for long, reaches through the filter."""
    shortest = max(1, round(_SHORTEST_STICK_S / step_s))
    reach = int(np.ceil(_REACH * kernel_s / step_s))
    sticks = binary_opening(slow, np.ones(shortest, dtype=bool))
    reached: np.ndarray = binary_dilation(sticks, np.ones(2 * reach + 1, dtype=bool))
    return reached


def solve_regression(
    records: Sequence[BandRecord], *, start: Lag, free: Sequence[str], friction: bool
) -> Regression:
    """Fit K, B, J, friction and the free parts of the lag, by Gauss-Newton steps.

    Parameters
    ----------
    records : sequence of BandRecord
        The trials; each has an offset of its own.
    start : Lag
        The lag, or where to start.
    free : sequence of str
        What of the lag is fitted: ``total``, ``spread``; ``tau`` for a lag that is a
        first-order filter only.
    friction : bool
        Whether a torque of constant size against the motion is fitted.

    Returns
    -------
    Regression
        Values, lag and what an interval needs.

    Raises
    ------
    ValueError
        When the regressors are linearly dependent.

    Notes
    -----
    Noise of the angle adds to the regressors' sums of squares; what it adds is known from its
    sd and taken off (corrected scores, Stefanski 1989, doi:10.1080/03610928908830207), so that
    inertia is not attenuated. Noise of the torque is the residual.
    """
    lag, values = start, np.zeros(4 if friction else 3)
    for _ in range(_PASSES):
        parts = [_columns(r, lag, values, free=free, friction=friction) for r in records]
        X = np.concatenate([part[0] for part in parts])
        y = np.concatenate([part[1] for part in parts])
        noise = np.sum([part[2] for part in parts], axis=0)
        size = np.linalg.norm(X, axis=0)
        size[size == 0.0] = 1.0  # the lag's columns of the first pass, which starts from zero
        bread = (X.T @ X - noise) / np.outer(size, size)
        step = np.linalg.lstsq(bread, X.T @ y / size, rcond=1e-13)[0] / size
        values, moved = step[: values.size], step[values.size :]
        lag = _moved(lag, moved, free)
        if moved.size == 0 or (np.any(moved) and np.abs(moved[0]) < _SMALL_LAG_STEP_S):
            break
    residual = y - X[:, : values.size] @ values
    noise_part = np.zeros(X.shape[1])
    noise_part = noise[:, : values.size] @ values / y.size
    scores = X * residual[:, None] + noise_part
    share = float(noise[2, 2] / size[2] ** 2)
    return Regression(values, lag, X, scores, X.T @ X - noise, residual, y, share)


def _moved(lag: Lag, step: np.ndarray, free: Sequence[str]) -> Lag:
    total, spread = lag.total_s, lag.spread_s2
    for name, change in zip(free, step, strict=True):
        if name == "spread":
            spread = max(spread + float(change), _MOST_NEGATIVE_SPREAD)
        else:
            total += float(change)
    if "tau" in free:
        total = max(total, 0.0)
        spread = total**2
    return Lag(total, spread)


def _columns(
    record: BandRecord, lag: Lag, values: np.ndarray, *, free: Sequence[str], friction: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a trial's regressors, torque, and what angle noise adds to the sums of squares."""
    n, keep = record.torque.size, record.keep
    jw = 1j * record.omega
    seen = record.window * lag.response(record.omega)
    of_angle = [seen, seen * jw, seen * jw**2]
    spectra = [gain * record.angle for gain in of_angle]
    if friction:
        of_angle.append(np.zeros_like(seen))
        spectra.append(seen * record.direction)
    model_gain = sum(v * gain for v, gain in zip(values, of_angle, strict=True))
    model = sum(v * column for v, column in zip(values, spectra, strict=True))
    for name in free:
        slope = _lag_slope(lag, record.omega, name)
        of_angle.append(slope * model_gain)
        spectra.append(slope * model)
    X = np.column_stack([np.fft.irfft(column, n)[keep] for column in spectra])
    y = record.torque[keep]
    gains = np.column_stack(of_angle)
    twice = np.full(record.omega.size, 2.0)  # negative frequencies
    twice[0] = 1.0
    density = record.angle_noise_sd**2 * y.size / n
    noise = density * np.real((gains.conj() * twice[:, None]).T @ gains)
    return X - X.mean(axis=0), y - y.mean(), noise


def _lag_slope(lag: Lag, omega: np.ndarray, name: str) -> np.ndarray:
    """Return the derivative of the logarithm of the lag's response."""
    jw, tau = 1j * omega, lag.filter_time_s
    slope: np.ndarray
    if name == "total":
        slope = -jw
    elif name == "spread":
        slope = jw**2 / (2.0 * (1.0 + jw * tau))
    else:  # tau, with the total
        slope = -jw / (1.0 + jw * tau)
    return slope
