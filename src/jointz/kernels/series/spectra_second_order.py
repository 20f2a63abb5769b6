"""Stiffness, damping and inertia from the spectra of one whole record.

The differential equation is multiplied by a window that vanishes smoothly at
both ends, and Fourier transformed; the derivatives are moved from the signals
to the window by parts. Nothing leaks and nothing is smoothed: the equation holds
at every frequency up to noise, whatever the motion before and after.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft

#: Length of the window's ramp as a share of the record, and longest, s.
_RAMP_SHARE = 0.05
_LONGEST_RAMP_S = 0.25
#: The slowest frequencies hold offset and drift.
_FIRST_BIN = 2
#: Frequencies either side over which the power of the error is averaged for the weights.
_HALF_WIDTH = 25
_PASSES = 8
_SMALL_STEP = 1e-5
#: A noise floor is flat to this ratio and this far below the signal: a broad-band signal is no
#: noise, however flat.
_FLAT = 1.25
_FAR_BELOW = 0.1
#: Frequencies above the band in which a floor can be seen.
_FEWEST_ABOVE = 24
_FEWEST_BINS = 12


@dataclass(frozen=True, slots=True)
class RecordSpectra:
    """Windowed spectra of one record, offsets removed.

    ``s`` (f,) rad/s: imaginary unit times angular frequency; ``motion`` (3, f): spectra of angle
    (rad), velocity (rad/s) and acceleration (rad/s^2); ``torque`` (f,): spectrum of the torque,
    N*m; ``instrument`` (f,): spectrum of its part explained by the command, N*m; ``noise``: power
    of the white noise of angle (rad^2) and torque (N^2*m^2), the same at every frequency;
    ``untold_share``: largest share of possible, but undetermined white noise in the power of angle
    and torque; ``window_power``: power of windowed white noise of unit variance.
    """

    s: np.ndarray
    motion: np.ndarray
    torque: np.ndarray
    instrument: np.ndarray | None
    noise: tuple[float, float]
    untold_share: tuple[float, float]
    window_power: float

    @property
    def powers(self) -> np.ndarray:
        """(3, f): 1, s, s^2."""
        return np.stack([np.ones_like(self.s), self.s, self.s**2])


@dataclass(frozen=True, slots=True)
class SpectrumFit:
    """Second-order impedance found from spectra.

    ``values`` (3,): K, B, J, SI; ``covariance`` (3, 3): their covariance, sandwich over
    frequencies; ``vaf_pct``: of the output (angle where the torque was perturbed, else torque)
    inside the band, by Parseval; ``condition_number``: of the scaled equations; ``error_power``
    (f,): power of the error of the output at every frequency; ``output_power`` (f,): power of the
    output; ``converged``: whether the passes settled.
    """

    values: np.ndarray
    covariance: np.ndarray
    vaf_pct: float
    condition_number: float
    error_power: np.ndarray
    output_power: np.ndarray
    converged: bool

    @property
    def n_bins(self) -> int:
        """Frequencies used."""
        return self.error_power.size


def record_spectra(
    angle: np.ndarray,
    torque: np.ndarray,
    *,
    rate_hz: float,
    highest_hz: float,
    command: np.ndarray | None = None,
) -> RecordSpectra:
    """Return the spectra of a record that second-order estimation needs.

    ``angle`` (n,) rad, ``torque`` (n,) N*m, ``command`` (n,), the instrument, where there is one;
    frequencies above ``highest_hz`` are left out.
    """
    n = angle.size
    window, slope, bend = _window(n, rate_hz)
    frequency = fft.rfftfreq(n, 1.0 / rate_hz)
    band = slice(_FIRST_BIN, int(np.searchsorted(frequency, highest_hz, side="right")))
    s = 2j * np.pi * frequency[band]
    if s.size < _FEWEST_BINS:
        raise ValueError(
            f"record_spectra: expected at least {_FEWEST_BINS} frequencies below {highest_hz:g} "
            f"Hz, got {s.size} in {n / rate_hz:.4g} s"
        )
    centred = [x - np.average(x, weights=window) for x in (angle, torque)]
    angles, torques = (fft.rfft(window * x) for x in centred)
    first, second = (fft.rfft(w * centred[0])[band] for w in (slope, bend))
    theta = angles[band]
    noise, untold = zip(*(_noise_power(x, band.stop) for x in (angles, torques)), strict=True)
    instrument = None if command is None else _explained(command, torques, window)[band]
    return RecordSpectra(
        s=s,
        motion=np.stack([theta, s * theta - first, s**2 * theta - 2.0 * s * first + second]),
        torque=torques[band],
        instrument=instrument,
        noise=noise,
        untold_share=untold,
        window_power=float(window @ window),
    )


def fit_second_order(
    spectra: RecordSpectra, *, perturbed: str, weighting: str = "error"
) -> SpectrumFit:
    """Return K, B, J by weighted refined instruments over frequencies.

    ``perturbed``: ``torque`` or ``angle``; ``weighting``: ``error`` (by its inverse power, best for
    a joint of second order) or ``even`` (smallest squared error). White noise of the input, read
    off the unexcited top of the spectrum, is taken off the equations: at high signal to noise the
    errors-in-variables likelihood (Pintelon and Schoukens 2012, System Identification, 9.11;
    refined instruments: Young 2011, Recursive Estimation, chapter 8).
    """
    if perturbed not in ("torque", "angle"):
        raise ValueError(f"fit_second_order: expected torque or angle perturbed, got {perturbed!r}")
    if weighting not in ("error", "even"):
        raise ValueError(f"fit_second_order: expected weighting error or even, got {weighting!r}")
    values = _regress(spectra)
    moved = np.inf
    for _ in range(_PASSES):
        before = values
        values, equations, scores, error = _pass(
            spectra, values, perturbed=perturbed, weighting=weighting
        )
        moved = float(np.max(np.abs(values - before) / np.maximum(np.abs(values), 1e-300)))
        if moved < _SMALL_STEP:
            break
    spent = spectra.s.size / (spectra.s.size - 3)
    size = np.maximum(np.sqrt(np.abs(np.diag(equations))), 1e-300)
    inverse = np.linalg.pinv(equations / np.outer(size, size)) / np.outer(size, size)
    output = spectra.motion[0] if perturbed == "torque" else spectra.torque
    error_power, output_power = np.abs(error) ** 2, np.abs(output) ** 2
    return SpectrumFit(
        values=values,
        covariance=inverse @ (scores @ scores.T) @ inverse.T * spent,
        vaf_pct=100.0 * (1.0 - float(error_power.sum() / output_power.sum())),
        condition_number=float(np.sqrt(np.linalg.cond(equations / np.outer(size, size)))),
        error_power=error_power,
        output_power=output_power,
        converged=moved < 100.0 * _SMALL_STEP,
    )


def _pass(
    spectra: RecordSpectra, values: np.ndarray, *, perturbed: str, weighting: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return new values, equations (3, 3), scores (3, f), and the error of the output (f,)."""
    powers = spectra.powers
    impedance = values @ powers
    error = values @ spectra.motion - spectra.torque
    if perturbed == "angle":
        weight = _weights(error, weighting)
        instruments, in_angle, in_torque = spectra.motion, powers, np.zeros_like(powers)
        output_error = error
    else:
        output_error = error / impedance
        weight = _weights(output_error, weighting) / np.abs(impedance) ** 2
        driver = spectra.torque if spectra.instrument is None else spectra.instrument
        instruments = powers / impedance * driver
        in_angle = np.zeros_like(powers)
        in_torque = powers / impedance if spectra.instrument is None else np.zeros_like(powers)
    angle_noise, torque_noise = spectra.noise
    weighted = instruments.conj() * weight
    equations = np.real(weighted @ spectra.motion.T)
    equations -= angle_noise * np.real((in_angle.conj() * weight) @ powers.T)
    right = np.real(weighted @ spectra.torque)
    right -= torque_noise * np.real(in_torque.conj() @ weight)
    size = np.maximum(np.sqrt(np.abs(np.diag(equations))), 1e-300)
    scaled = np.linalg.lstsq(equations / np.outer(size, size), right / size, rcond=None)[0]
    solved: np.ndarray = scaled / size
    return solved, equations, np.real(weighted * error), output_error


def _weights(error: np.ndarray, weighting: str) -> np.ndarray:
    power = np.abs(error) ** 2
    if weighting == "even":
        return np.full(power.size, 1.0 / max(float(power.mean()), 1e-300))
    return np.asarray(1.0 / _smooth(power))


def _regress(spectra: RecordSpectra) -> np.ndarray:
    """Return K, B, J by plain regression of torque on motion, to start from."""
    size = np.linalg.norm(spectra.motion, axis=1)
    regressors = (spectra.motion / size[:, None]).T
    scaled = np.linalg.lstsq(
        np.concatenate([regressors.real, regressors.imag]),
        np.concatenate([spectra.torque.real, spectra.torque.imag]),
        rcond=None,
    )[0]
    return np.asarray(scaled / size)


def _window(n: int, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a flat window with smooth ends, its slope per s and its bend per s^2."""
    ramp = max(4, round(min(_LONGEST_RAMP_S, _RAMP_SHARE * n / rate_hz) * rate_hz))
    x, length_s = np.arange(ramp) / ramp, ramp / rate_hz
    window, slope, bend = np.ones(n), np.zeros(n), np.zeros(n)
    window[:ramp] = x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    slope[:ramp] = (1.0 - np.cos(2.0 * np.pi * x)) / length_s
    bend[:ramp] = 2.0 * np.pi * np.sin(2.0 * np.pi * x) / length_s**2
    for w, sign in ((window, 1.0), (slope, -1.0), (bend, 1.0)):
        w[-ramp:] = sign * w[:ramp][::-1]
    return window, slope, bend


def _smooth(power: np.ndarray) -> np.ndarray:
    """Return the average over neighbours, ends mirrored."""
    half = min(_HALF_WIDTH, power.size - 1)
    padded = np.pad(power, (half, half), mode="reflect")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    mean = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    # A running sum loses digits; noise-free records must not divide by zero.
    return np.asarray(np.maximum(mean, 1e-13 * float(power.max()) + 1e-300))


def _explained(command: np.ndarray, torques: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Return the torque that the command explains, each frequency left out of its own estimate.

    With itself in, a share of the joint's own torque would come back as its
    instrument.
    """
    C = fft.rfft(window * (command - np.average(command, weights=window)))
    cross, auto = torques * C.conj(), np.abs(C) ** 2
    width = 2 * min(_HALF_WIDTH, C.size - 1) + 1
    others = _smooth_complex(cross) * width - cross
    return np.asarray(C * others / np.maximum(_smooth(auto) * width - auto, 1e-300))


def _smooth_complex(x: np.ndarray) -> np.ndarray:
    half = min(_HALF_WIDTH, x.size - 1)
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    return np.asarray(np.convolve(np.pad(x, (half, half), mode="reflect"), kernel, "valid"))


def _noise_power(spectrum: np.ndarray, band_end: int) -> tuple[float, float]:
    """Return the power of white noise, read off the top of the spectrum, and the share untold.

    A spectrum still falling there is signal, or was filtered: nothing is known but
    that white noise is no more than what is left at its end.
    """
    power = np.abs(spectrum) ** 2
    inside = float(power[_FIRST_BIN:band_end].mean())
    if inside <= 0.0:
        return 0.0, 0.0
    start = max(spectrum.size // 2, band_end)
    if spectrum.size - start < _FEWEST_ABOVE:
        return 0.0, min(float(power[3 * spectrum.size // 4 :].mean()) / inside, 1.0)
    middle = (start + spectrum.size) // 2
    low, high = float(power[start:middle].mean()), float(power[middle:-1].mean())
    flat = max(low, high) <= _FLAT * min(low, high)
    # The upper half holds the least signal.
    if flat and high <= _FAR_BELOW * inside:
        return high, 0.0
    return 0.0, min(high / inside, 1.0)
