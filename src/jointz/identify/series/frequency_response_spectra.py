"""The impedance of one record over frequency, and the band in which it can be known."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.series.joint_record import JointRecord
from jointz.kernels.series.spectra import CrossSpectra, coherence_threshold, welch

Input = Literal["torque", "angle"]
TorqueSide = Literal["joint", "device"]

#: The band ends where the coherence, median of five neighbours, falls below; and by itself no
#: higher than this: there bones, straps and sensor mounts are coherent too.
_BAND_COHERENCE = 0.25
_HIGHEST_HZ = 60.0
_MEDIAN_WIDTH = 5
#: Segments of the record: many averages, and a resolution finer than a joint's resonance.
_SEGMENTS = 16
_LONGEST_WINDOW_S = 4.0
_SHORTEST_WINDOW = 32
_FEWEST_SEGMENTS = 4
_HIGHEST_SHARE = 0.8


@dataclass(frozen=True, slots=True)
class JointSpectra:
    """Everything spectral about one record."""

    impedance: np.ndarray  # torque over angle
    relative_sd: np.ndarray  # sd of its gain over the gain, and of its phase in rad
    coherence: np.ndarray  # of angle and torque; of angle and command where there is one
    error_power: np.ndarray  # density of what no linear response explains of the output
    output_power: np.ndarray  # density of the output
    spectra: CrossSpectra  # from the input to the output, or from the command to the angle
    highest_hz: float  # end of the band
    perturbed: str  # ``torque`` or ``angle``

    @property
    def band(self) -> np.ndarray:
        """(f,) bool: the frequencies used."""
        f = self.spectra.frequency_hz
        inside: np.ndarray = (f >= self.spectra.resolution_hz) & (f <= self.highest_hz)
        return inside


def prepare_record(record: JointRecord, torque_acts_on: TorqueSide) -> JointRecord:
    """Remove offsets and turn the torque to act on the joint."""
    for name, code in (
        ("angle", Failure.CONSTANT_ANGLE.value),
        ("torque", Failure.CONSTANT_TORQUE.value),
    ):
        values = record.channels[name]
        if np.ptp(values) <= 1e-12 * np.abs(values).max():
            raise EstimationError(
                code,
                f"the {name} is constant ({values[0]:.6g}): nothing to identify. Check the column.",
            )
    command = record.channels.get("command")
    if command is not None and np.ptp(command) == 0.0:
        raise DataError(
            "the channel 'command' is constant and cannot be an instrument. Give the torque that "
            "was commanded (in recordings of jointz the channel 'reference'), or leave it out.",
            channel="command",
        )
    centred = {name: values - values.mean() for name, values in record.channels.items()}
    if torque_acts_on == "device":
        centred["torque"] = -centred["torque"]
    return replace(record, channels=centred)


def joint_spectra(
    record: JointRecord, *, perturbed: Input, cutoff_hz: float | None, where: str
) -> JointSpectra:
    """Return the impedance over frequency and the band in which it can be known."""
    half = record.rate_hz / 2.0
    if cutoff_hz is not None and not 0.0 < cutoff_hz < half:
        raise DataError(
            f"{where}: expected 0 < cutoff_hz < {half:.6g} (half the sampling rate), got "
            f"{cutoff_hz:g}. Lower cutoff_hz."
        )
    window_s = _window_s(record, where)
    command = record.channels.get("command") if perturbed == "torque" else None
    if command is None:
        found = _direct(record, perturbed=perturbed, window_s=window_s)
    else:
        found = _through_command(record, command, window_s=window_s)
    highest = _coherent_to_hz(found, where=where, has_command=command is not None)
    return replace(found, highest_hz=cutoff_hz if cutoff_hz is not None else highest)


def _window_s(record: JointRecord, where: str) -> float:
    seconds = record.time.size / record.rate_hz
    shortest = _SHORTEST_WINDOW / record.rate_hz
    if seconds < _FEWEST_SEGMENTS * shortest:
        raise DataError(
            f"{where}: the record lasts {seconds:.4g} s, at least "
            f"{_FEWEST_SEGMENTS * shortest:.4g} s are needed. Give a longer record."
        )
    return max(min(seconds / _SEGMENTS, _LONGEST_WINDOW_S), shortest)


def _direct(record: JointRecord, *, perturbed: Input, window_s: float) -> JointSpectra:
    names = ("torque", "angle") if perturbed == "torque" else ("angle", "torque")
    x, y = (record.channels[name] for name in names)
    spectra = welch(x, y, rate_hz=record.rate_hz, window_s=window_s)
    response, coherence = spectra.response, spectra.coherence
    impedance = _inverse(response) if perturbed == "torque" else response
    lost = spectra.n_averages / max(spectra.n_averages - 1.0, 1.0)
    return JointSpectra(
        impedance=impedance,
        relative_sd=spectra.relative_sd(),
        coherence=coherence,
        error_power=(1.0 - coherence) * spectra.auto_out * lost,
        output_power=spectra.auto_out,
        spectra=spectra,
        highest_hz=0.0,
        perturbed=perturbed,
    )


def _through_command(record: JointRecord, command: np.ndarray, *, window_s: float) -> JointSpectra:
    angle, torque = record.channels["angle"], record.channels["torque"]
    settings = {"rate_hz": record.rate_hz, "window_s": window_s}
    to_angle, to_torque = welch(command, angle, **settings), welch(command, torque, **settings)
    both = welch(torque, angle, **settings)
    admittance = to_angle.cross / np.where(to_torque.cross == 0.0, 1.0, to_torque.cross)
    error = (
        both.auto_out
        - 2.0 * np.real(admittance.conj() * both.cross)
        + np.abs(admittance) ** 2 * both.auto_in
    )
    error = np.maximum(error, 0.0)
    explained = np.maximum(np.abs(to_angle.cross) ** 2 / to_angle.auto_in, 1e-300)
    return JointSpectra(
        impedance=_inverse(admittance),
        relative_sd=np.sqrt(error / (2.0 * both.n_averages * explained)),
        coherence=np.minimum(to_angle.coherence, to_torque.coherence),
        error_power=error,
        output_power=both.auto_out,
        spectra=to_angle,
        highest_hz=0.0,
        perturbed="torque",
    )


def _inverse(response: np.ndarray) -> np.ndarray:
    inverse: np.ndarray = 1.0 / np.where(response == 0.0, 1e-300, response)
    return inverse


def _coherent_to_hz(found: JointSpectra, *, where: str, has_command: bool) -> float:
    """Return the highest frequency at which output and input still belong together."""
    f, c = found.spectra.frequency_hz, found.coherence
    middle = np.lib.stride_tricks.sliding_window_view(
        np.pad(c, _MEDIAN_WIDTH // 2, mode="edge"), _MEDIAN_WIDTH
    )
    needed = max(_BAND_COHERENCE, coherence_threshold(found.spectra.n_averages))
    top_hz = min(_HIGHEST_HZ, _HIGHEST_SHARE * f[-1])
    reached = np.flatnonzero((f > 0.0) & (f <= top_hz))
    if reached.size < _MEDIAN_WIDTH:
        raise DataError(
            f"{where}: the record is too short: its spectra have {reached.size} frequencies below "
            f"{top_hz:.3g} Hz, one in {f[1]:.3g} Hz; at least {_MEDIAN_WIDTH} are needed. Record "
            f"at least {_SEGMENTS * _MEDIAN_WIDTH / top_hz:.2g} s."
        )
    usable = reached[np.median(middle, axis=1)[reached] > needed]
    if usable.size < _MEDIAN_WIDTH:
        pair = "command and angle" if has_command else "torque and angle"
        raise EstimationError(
            Failure.NOT_COHERENT.value,
            f"{where}: {pair} are not coherent: the coherence exceeds {needed:.2g} at "
            f"{usable.size} of {f.size} frequencies. Check that the columns belong together and "
            "that the perturbation was on, or record longer.",
        )
    return float(f[usable[-1]])
