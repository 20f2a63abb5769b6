"""Prepared recordings of a participant: torque, strides, pulses, filtered signals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import xarray as xr

from jointz.core.channels import HEEL_STRIKES
from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.method_names import BAYESIAN
from jointz.core.priors import PriorsSpec
from jointz.core.study import (
    CalibrationSpec,
    DeviceSpec,
    ParticipantSpec,
    PerturbationsSpec,
    TorqueModelSpec,
    UserExclusion,
)
from jointz.gait.heel_strikes import find_heel_strikes
from jointz.gait.strides import Strides, find_strides
from jointz.gait.timestamps import find_gaps, rate_hz
from jointz.identify.preparation.channel_clocks import with_clock_errors
from jointz.identify.preparation.conditioning import Conditioned, condition, torque_from_current
from jointz.identify.preparation.missing_samples import interpolate_missing
from jointz.identify.preparation.pulses import (
    Pulse,
    pulses_from_angle,
    pulses_from_command,
    pulses_from_reference,
    pulses_from_table,
    with_measured_amplitudes,
)
from jointz.identify.preparation.triggers import pulses_from_trigger, triggers_of
from jointz.identify.study_kinds import StudyKind
from jointz.kernels.robust_spread import robust_sd

if TYPE_CHECKING:
    from jointz.identify.walking.posterior import LastFit

_STRIKE_CHANNELS = (HEEL_STRIKES, "contact", "ground_reaction_force", "cycle")
#: Channel of the friction in a torque from current, a name that no channel of a user has.
FRICTION_OF_MODEL = "friction of the torque model"
#: A line of exclusions.csv refers to an event within this time.
SAME_TIME_S = 2e-3
#: Pulses are a small share of walking; a command that is on for more than this is no pulse.
_CONTINUOUS_SHARE = 0.8
#: Fewest steps of a platform in walking, and the largest spread of their sizes over the median.
_FEWEST_STEPS, _UNLIKE_STEPS = 10, 0.4


@dataclass(frozen=True, slots=True)
class RecordingInput:
    """A recording with its calibration and pulse table."""

    recording: xr.Dataset
    calibration: CalibrationSpec
    pulse_table: pd.DataFrame | None = None

    @property
    def condition(self) -> str:
        """The recording's condition."""
        return str(self.recording.attrs["condition"])

    @property
    def file(self) -> str:
        """The recording's file, as the study names it."""
        return str(self.recording.attrs["file"])


@dataclass(frozen=True, slots=True)
class ParticipantSettings:
    """Settings of the study and of the analysis for one participant."""

    kind: StudyKind
    perturbations: PerturbationsSpec
    group_edges: tuple[float, ...] = ()  # edges of the groups, SI; empty where there are none
    torque_model: TorqueModelSpec | None = None  # model of the torque from the current
    methods: tuple[str, ...] = (BAYESIAN,)  # the chosen method, then those to compare it with
    method_asked_for: bool = False  # whether the method was requested and differs from the default
    n_resamples: int = 1000  # of the bootstrap
    seed: int = 0
    mass_kg: float | None = None  # of the participant
    # exclusions that the user states for this participant
    user_exclusions: tuple[UserExclusion, ...] = ()
    joint: str = "knee"
    positive: str = "flexion"  # the positive direction of the joint
    person: ParticipantSpec | None = None  # person of the recordings, for the mass of the limb
    device: DeviceSpec | None = None  # device worn on the limb
    priors: PriorsSpec = field(default_factory=PriorsSpec)  # those that the study states
    coupling: str = "strap"  # of device and leg: ``strap`` or ``rigid``
    last_fit: "LastFit | None" = None  # where the fit begins, if estimates follow each other

    @property
    def timing_points(self) -> Mapping[str, float]:
        """Timing point -> % of the gait cycle."""
        return self.perturbations.timing_points or TIMING_POINTS

    def left_out_by(self, file: str, moment_s: float) -> UserExclusion | None:
        """Return the user's exclusion of the pulse or stride that begins at a time.

        The last line about it in ``exclusions.csv`` counts; None if it is not excluded.
        """
        lines = [
            e
            for e in self.user_exclusions
            if e.recording == file and abs(e.onset_s - moment_s) < SAME_TIME_S
        ]
        return lines[-1] if lines and lines[-1].action == "exclude" else None


@dataclass(frozen=True, slots=True)
class Source:
    """A recording with its strides, pulses and filtered signals."""

    input: RecordingInput  # recording with torque, calibration and pulse table
    strides: Strides | None  # None if no channel shows heel strikes
    pulses: tuple[Pulse, ...]  # in order of time
    signals: Conditioned  # filtered signals; without a stretch for a recording without a device
    # (n_stride,) bool: accepted strides without a pulse, not excluded by the user
    undisturbed: np.ndarray

    @property
    def given(self) -> RecordingInput:
        """Former name of ``input``."""
        return self.input


def prepare_sources(
    recordings: Sequence[RecordingInput], settings: ParticipantSettings
) -> list[Source]:
    """Prepare the recordings of a participant, at the rate of the first perturbed one."""
    if not recordings:
        return []
    unperturbed = [r for r in recordings if r.condition == "unperturbed"]
    ordered = sorted(recordings, key=lambda r: r.condition != "perturbed")
    target_hz = rate_hz(ordered[0].recording["time"].to_numpy())
    return [_source(record, unperturbed, settings, target_hz=target_hz) for record in ordered]


def _source(
    record: RecordingInput,
    unperturbed: Sequence[RecordingInput],
    settings: ParticipantSettings,
    *,
    target_hz: float,
) -> Source:
    measured = record.recording
    record = replace(record, calibration=with_clock_errors(record.calibration, measured))
    filled = interpolate_missing(measured)
    record = _zero_corrected(_with_torque(replace(record, recording=filled), settings))
    pulses = _pulses(record, unperturbed, settings)
    if filled is not measured:
        filled = interpolate_missing(measured, [p.onset_s for p in pulses])
        record = _zero_corrected(_with_torque(replace(record, recording=filled), settings))
    strides = _strides(record)
    signals = condition(
        record.recording,
        cutoff_hz=settings.perturbations.cutoff_hz,
        calibration=record.calibration,
        target_rate_hz=target_hz,
    )
    undisturbed = _undisturbed(record, strides, pulses, settings)
    return Source(record, strides, pulses, signals, undisturbed)


def _with_torque(record: RecordingInput, settings: ParticipantSettings) -> RecordingInput:
    recording, model = record.recording, settings.torque_model
    if "torque" in recording or record.condition == "no_device":
        return record
    if model is None or "current" not in recording:
        raise DataError(
            f"{record.file}: no torque. Give channels.torque, or channels.current and "
            "[torque_model].",
            path=record.file,
            channel="torque",
        )
    torque, friction = torque_from_current(
        recording, model, cutoff_hz=settings.perturbations.cutoff_hz, known=record.calibration
    )
    signals = {"torque": torque, FRICTION_OF_MODEL: friction}
    channels = {name: ("time", values, {"units": "N*m"}) for name, values in signals.items()}
    return replace(record, recording=recording.assign(channels))


def _zero_corrected(record: RecordingInput) -> RecordingInput:
    """Subtract the calibrated zero of the angle, which postures, groups and figures need."""
    zero, recording = record.calibration.angle_zero_rad, record.recording
    if zero is None:
        return record
    angle = recording["angle"]
    shifted = angle.copy(data=angle.to_numpy() - zero.value)
    return replace(record, recording=recording.assign(angle=shifted))


def _strides(record: RecordingInput) -> Strides | None:
    """Return the strides, None if the recording has no channel with heel strikes."""
    recording = record.recording
    if not any(name in recording for name in _STRIKE_CHANNELS):
        return None
    strikes = find_heel_strikes(recording, levels_v=record.calibration.contact_levels_v)
    spurious_s = strikes.rejected_s if strikes.method == HEEL_STRIKES else np.empty(0)
    gaps = find_gaps(recording["time"].to_numpy())
    return replace(find_strides(strikes.time_s, gaps), spurious_s=spurious_s)


def _pulses(
    record: RecordingInput, unperturbed: Sequence[RecordingInput], settings: ParticipantSettings
) -> tuple[Pulse, ...]:
    if record.condition == "no_device":
        return ()
    source = settings.perturbations.source or usual_source(
        table=record.pulse_table is not None,
        command="command" in record.recording,
        trigger="trigger" in record.recording,
    )
    if record.condition == "unperturbed":
        # A pulse in the unperturbed condition disturbs its stride; command or trigger show it.
        if source == "trigger":
            return triggers_of(record.recording, brief=False)
        return pulses_from_command(record.recording) if "command" in record.recording else ()
    if source == "table":
        if record.pulse_table is None:
            raise DataError(f'{record.file}: perturbations.source is "table" but it has none.')
        pulses = with_measured_amplitudes(pulses_from_table(record.pulse_table), record.recording)
        _check_names(pulses, record.file, settings)
        return pulses
    if source == "angle":
        pulses = pulses_from_angle(record.recording, cutoff_hz=settings.perturbations.cutoff_hz)
        _check_steps(pulses, record.file, settings)
        return pulses
    if source == "command":
        pulses = pulses_from_command(record.recording)
        _refuse_continuous(pulses, record, settings)
        return pulses
    if source == "trigger":
        return pulses_from_trigger(record.recording)
    partners = most_alike(record, unperturbed, keys=("session", "side", "trial"))
    if not partners:
        raise DataError(
            f"{record.file}: pulses are to be read off the difference of references, which needs "
            "an unperturbed recording of the same participant. Add it, or a pulse table."
        )
    return pulses_from_reference(record.recording, partners[0].recording)


def _check_steps(steps: Sequence[Pulse], file: str, settings: ParticipantSettings) -> None:
    """Raise DataError for steps in walking that are few or unlike: those of the gait itself."""
    sizes = np.array([abs(step.amplitude) for step in steps])
    alike = sizes.size and robust_sd(sizes) <= _UNLIKE_STEPS * np.median(sizes)
    if not settings.kind.by_gait or (sizes.size >= _FEWEST_STEPS and alike):
        return
    shown = ", ".join(f"{s.onset_s:.3f} s ({np.degrees(s.amplitude):+.2g} deg)" for s in steps[:5])
    raise DataError(
        f'{file}: perturbations.source is "angle", for a platform that moves the joint by many '
        f"steps of one size. Expected {_FEWEST_STEPS} or more alike, found {sizes.size}"
        f"{f', such as at {shown}' if shown else ''}. Give [channels.command], [channels.trigger] "
        "or a pulse table.",
        path=file,
        channel="angle",
    )


def _refuse_continuous(
    pulses: Sequence[Pulse], record: RecordingInput, settings: ParticipantSettings
) -> None:
    """Raise DataError for walking in which the command is on nearly all the time."""
    time = record.recording["time"].to_numpy()
    on_s, walked_s = sum(p.duration_s for p in pulses), float(time[-1] - time[0])
    if settings.kind.by_gait and on_s > _CONTINUOUS_SHARE * walked_s:
        raise DataError(
            f"{record.file}: the command is on for {on_s:.0f} of {walked_s:.0f} s, so it has no "
            "pulses to average. Analyse a random torque with jointz identify time-varying; give a "
            "pulse table if there are pulses.",
            path=record.file,
            channel="command",
        )


def _check_names(pulses: Sequence[Pulse], file: str, settings: ParticipantSettings) -> None:
    """Raise DataError for timing points that the study's list does not have."""
    known = settings.perturbations.timing_points
    unknown = {p.timing_point for p in pulses if p.timing_point} - set(known or ())
    if settings.kind.by_gait and known and unknown:
        raise DataError(
            f"{file}: its pulse table names the timing point(s) {', '.join(sorted(unknown))}, "
            f"perturbations.timing_points has {', '.join(known)}. Correct one of them.",
            path=file,
        )


def usual_source(*, table: bool, command: bool, trigger: bool) -> str:
    """Return the default source of pulses."""
    if table:
        return "table"
    return "command" if command else "trigger" if trigger else "reference"


def most_alike(
    record: RecordingInput, others: Sequence[RecordingInput], *, keys: Sequence[str]
) -> list[RecordingInput]:
    """Return the recordings that share most of session, side or trial with one."""

    def shared(other: RecordingInput) -> tuple[bool, ...]:
        return tuple(other.recording.attrs[k] == record.recording.attrs[k] for k in keys)

    best = max(map(shared, others), default=())
    return [other for other in others if shared(other) == best]


def _undisturbed(
    record: RecordingInput,
    strides: Strides | None,
    pulses: Sequence[Pulse],
    settings: ParticipantSettings,
) -> np.ndarray:
    """Return the accepted strides without a pulse that the user did not exclude."""
    if strides is None:
        return np.zeros(0, dtype=bool)
    onsets = np.array([p.onset_s for p in pulses])
    first = np.searchsorted(onsets, strides.start_s)
    last = np.searchsorted(onsets, strides.start_s + strides.duration_s)
    kept = [settings.left_out_by(record.file, start) is None for start in strides.start_s]
    return np.asarray(strides.accepted & (first == last) & np.array(kept, dtype=bool))
