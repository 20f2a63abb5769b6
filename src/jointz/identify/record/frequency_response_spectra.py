"""Impedance of one record over frequency, and the band in which it can be estimated."""

from dataclasses import dataclass, replace

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.record.joint_record import JOINT, JointRecord, JointRequest, refuse_constant
from jointz.identify.record.joint_record import Input as Input
from jointz.identify.record.joint_record import TorqueSide as TorqueSide
from jointz.kernels.series.spectra import CrossSpectra, coherence_threshold, welch

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
class ImpedanceSpectra:
    """Spectra of one record, and its impedance."""

    record: JointRecord  # record with offsets removed and torque on the joint
    perturbed: Input
    impedance: np.ndarray  # (f,) torque over angle, N*m/rad
    # (f,) sd of the impedance's gain over the gain; also sd of its phase, rad
    relative_sd: np.ndarray
    # (f,) of angle and torque; with a command, the lower one of its coherences with angle and
    # torque
    coherence: np.ndarray
    # (f,) density of the part of the output that is not linear in the input, unit^2/Hz
    error_power: np.ndarray
    output_power: np.ndarray  # (f,) density of the output, unit^2/Hz
    spectra: CrossSpectra  # from the input to the output, or from the command to the angle
    highest_hz: float = 0.0  # upper end of the band

    @property
    def band(self) -> np.ndarray:
        """(f,) bool: the frequencies used."""
        f = self.spectra.frequency_hz
        return np.asarray((f >= self.spectra.resolution_hz) & (f <= self.highest_hz))


def prepare_record(record: JointRecord, torque_acts_on: TorqueSide) -> JointRecord:
    """Remove offsets and turn the torque to act on the joint."""
    refuse_constant(record)
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


def impedance_spectra(request: JointRequest) -> ImpedanceSpectra:
    """Return the impedance over frequency and the band in which it can be estimated."""
    record = prepare_record(request.record, request.torque_acts_on)
    half, cutoff_hz = record.rate_hz / 2.0, request.cutoff_hz
    if cutoff_hz is not None and not 0.0 < cutoff_hz < half:
        raise DataError(
            f"{JOINT}: expected 0 < cutoff_hz < {half:.6g} (half the sampling rate), got "
            f"{cutoff_hz:g}. Lower cutoff_hz."
        )
    shortest_s = _SHORTEST_WINDOW / record.rate_hz
    if record.seconds < _FEWEST_SEGMENTS * shortest_s:
        raise DataError(
            f"{JOINT}: the record lasts {record.seconds:.4g} s, at least "
            f"{_FEWEST_SEGMENTS * shortest_s:.4g} s are needed. Give a longer record."
        )
    window_s = max(min(record.seconds / _SEGMENTS, _LONGEST_WINDOW_S), shortest_s)
    if request.input == "torque" and "command" in record.channels:
        spectra = _spectra_through_command(record, window_s)
    else:
        spectra = _direct_spectra(record, request, window_s)
    highest_hz = _coherent_to_hz(spectra)
    return replace(spectra, highest_hz=highest_hz if cutoff_hz is None else cutoff_hz)


def _direct_spectra(
    record: JointRecord, request: JointRequest, window_s: float
) -> ImpedanceSpectra:
    x, y = (record.channels[name] for name in (request.input, request.output))
    spectra = welch(x, y, rate_hz=record.rate_hz, window_s=window_s)
    lost = spectra.n_averages / max(spectra.n_averages - 1.0, 1.0)
    response = spectra.response
    return ImpedanceSpectra(
        record=record,
        perturbed=request.input,
        impedance=_inverse(response) if request.input == "torque" else response,
        relative_sd=spectra.relative_sd(),
        coherence=spectra.coherence,
        error_power=(1.0 - spectra.coherence) * spectra.auto_out * lost,
        output_power=spectra.auto_out,
        spectra=spectra,
    )


def _spectra_through_command(record: JointRecord, window_s: float) -> ImpedanceSpectra:
    angle, torque, command = (record.channels[n] for n in ("angle", "torque", "command"))
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
    return ImpedanceSpectra(
        record=record,
        perturbed="torque",
        impedance=_inverse(admittance),
        relative_sd=np.sqrt(error / (2.0 * both.n_averages * explained)),
        coherence=np.minimum(to_angle.coherence, to_torque.coherence),
        error_power=error,
        output_power=both.auto_out,
        spectra=to_angle,
    )


def _inverse(response: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / np.where(response == 0.0, 1e-300, response))


def _coherent_to_hz(spectra: ImpedanceSpectra) -> float:
    """Return the highest frequency at which output and input are coherent."""
    f = spectra.spectra.frequency_hz
    neighbours = np.lib.stride_tricks.sliding_window_view(
        np.pad(spectra.coherence, _MEDIAN_WIDTH // 2, mode="edge"), _MEDIAN_WIDTH
    )
    needed = max(_BAND_COHERENCE, coherence_threshold(spectra.spectra.n_averages))
    top_hz = min(_HIGHEST_HZ, _HIGHEST_SHARE * f[-1])
    reached = np.flatnonzero((f > 0.0) & (f <= top_hz))
    if reached.size < _MEDIAN_WIDTH:
        raise DataError(
            f"{JOINT}: the record is too short: its spectra have {reached.size} frequencies below "
            f"{top_hz:.3g} Hz, one in {f[1]:.3g} Hz; at least {_MEDIAN_WIDTH} are needed. Record "
            f"at least {_SEGMENTS * _MEDIAN_WIDTH / top_hz:.2g} s."
        )
    usable = reached[np.median(neighbours, axis=1)[reached] > needed]
    if usable.size < _MEDIAN_WIDTH:
        through_command = spectra.perturbed == "torque" and "command" in spectra.record.channels
        pair = "command and angle" if through_command else "torque and angle"
        raise EstimationError(
            Failure.NOT_COHERENT.value,
            f"{JOINT}: {pair} are not coherent: the coherence exceeds {needed:.2g} at "
            f"{usable.size} of {f.size} frequencies. Check that the columns belong together and "
            "that the perturbation was on, or record longer.",
        )
    return float(f[usable[-1]])
