"""From the recordings of a calibration study to what a step finds of one participant."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from jointz.core.errors import StudyError
from jointz.core.protocols.protocol import LoadSpec
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
from jointz.core.study import Calibrated, CalibrationSpec, TorqueModelSpec
from jointz.identify.calibration.footswitch_levels import fit_footswitch
from jointz.identify.calibration.frame import fit_frame
from jointz.identify.calibration.hanging_model import KnownWeight
from jointz.identify.calibration.hinge import fit_hinge
from jointz.identify.calibration.leg import fit_leg
from jointz.identify.calibration.pulse_averages import PulsedRecord
from jointz.identify.calibration.spring import fit_spring
from jointz.identify.calibration.torsion import fit_torsion
from jointz.identify.calibration.zero import fit_zero
from jointz.identify.preparation.conditioning import torque_from_current
from jointz.identify.preparation.pulses import (
    pulses_from_command,
    pulses_from_table,
    with_measured_amplitudes,
)
from jointz.identify.preparation.sources import RecordingInput
from jointz.results.bench.calibration_fit import CalibrationFit

_PERFECT_GAIN, _NOTHING = Calibrated(value=1.0, sd=0.0), Calibrated(value=0.0, sd=0.0)
_CUTOFF_HZ = 20.0
#: Step -> channels that it cannot do without.
_CHANNELS: Mapping[str, tuple[str, ...]] = {
    "zero": ("angle",),
    "footswitch": ("contact",),
    "hinge": ("angle", "motor_angle"),
    "frame": ("motor_angle", "current"),
    "leg": ("angle", "motor_angle", "current"),
    "torsion": ("angle",),
    "spring": ("motor_angle", "current"),
}


@dataclass(frozen=True, slots=True, eq=False)
class StepData:
    """What a step of one participant is estimated from."""

    recordings: Mapping[str, RecordingInput]  # condition -> its recording
    loads: Mapping[str, LoadSpec]  # condition -> the known load that was on the joint
    model: TorqueModelSpec | None  # of the actuator, as stated

    def channels(self, condition: str, *names: str) -> list[np.ndarray]:
        """Return time and channels of a condition."""
        recording = self.recordings[condition].recording
        return [recording[name].to_numpy() for name in ("time", *names)]

    def known(self, condition: str) -> CalibrationSpec:
        """Return what the study says of the instruments already."""
        return self.recordings[condition].calibration

    @property
    def torque_model(self) -> TorqueModelSpec:
        """The actuator's, where it is sure that there is one."""
        if self.model is None:
            raise ValueError("no torque model; step_problems tells of it before")
        return self.model


def step_data(
    step: str,
    recordings: Sequence[RecordingInput],
    *,
    loads: Mapping[str, LoadSpec],
    model: TorqueModelSpec | None,
) -> StepData:
    """Find the recordings of a step's conditions."""
    participant = str(recordings[0].recording.attrs["participant"]) if recordings else "nobody"
    conditions = STEP_RULES[step].conditions
    found = _by_condition(recordings, conditions)
    data = StepData({name: r[0] for name, r in found.items() if len(r) == 1}, loads, model)
    problems = list(_condition_problems(conditions, found, recordings))
    problems += _channel_problems(step, data)
    needs_model = "current" in _CHANNELS[step] or (step == "torsion" and _has_current(data))
    if needs_model and model is None and not problems:
        problems.append("[torque_model]: missing; torque is computed from current with it.")
    problems += [
        f"the known load of the condition '{name}' is missing. Give the protocol that states it "
        "(--protocol), with [[loads]] of that name."
        for name in STEP_RULES[step].loads
        if name not in loads
    ]
    if problems:
        raise StudyError(f"step {step}, participant {participant}", problems)
    return data


def fit_step(step: str, data: StepData) -> CalibrationFit:
    """Estimate a step."""
    return _FITS[step](data)


def _by_condition(
    recordings: Sequence[RecordingInput], conditions: Sequence[str]
) -> dict[str, list[RecordingInput]]:
    """Return recordings by condition; the only one of a step of one needs no session."""
    found = {
        name: [r for r in recordings if r.recording.attrs["session"] == name] for name in conditions
    }
    if len(conditions) == len(recordings) == 1 and not recordings[0].recording.attrs["session"]:
        return {conditions[0]: list(recordings)}
    return found


def _condition_problems(
    conditions: Sequence[str],
    found: Mapping[str, Sequence[RecordingInput]],
    recordings: Sequence[RecordingInput],
) -> list[str]:
    sessions = sorted({str(r.recording.attrs["session"]) for r in recordings} - {""})
    return [
        f'expected one recording with session = "{name}", found {len(found[name])} (sessions: '
        f"{', '.join(sessions) or 'none'}). Name it in study.toml, one a participant."
        for name in conditions
        if len(found[name]) != 1
    ]


def _channel_problems(step: str, data: StepData) -> list[str]:
    problems = []
    for name, given in data.recordings.items():
        recording = given.recording
        lacking = [c for c in _CHANNELS[step] if c not in recording]
        if step == "torsion" and not {"torque", "current"} & set(recording):
            lacking.append("current")
        problems += [
            f"{given.file}: the channel '{channel}' is missing; '{name}' cannot do without it. "
            f"Declare [channels.{channel}] in study.toml."
            for channel in lacking
        ]
        if step == "footswitch" and recording.attrs["contact_kind"] != "voltage":
            problems.append(
                f'{given.file}: the switch gives no volts. Declare kind = "voltage" under '
                "[channels.contact], or leave the step out: other kinds need no levels."
            )
        if STEP_RULES[step].torque == "pulses" and given.pulse_table is None:
            told = (
                f"{given.file}: no pulses. Give it a pulse table (perturbations), or the command."
            )
            problems += [] if "command" in recording else [told]
    return problems


def _has_current(data: StepData) -> bool:
    return any("torque" not in given.recording for given in data.recordings.values())


# --- steps -------------------------------------------------------------------------------------


def _zero(data: StepData) -> CalibrationFit:
    return fit_zero(*data.channels("straight", "angle"))


def _footswitch(data: StepData) -> CalibrationFit:
    return fit_footswitch(*data.channels("walking", "contact"))


def _hinge(data: StepData) -> CalibrationFit:
    return fit_hinge(*data.channels("swing", "angle", "motor_angle"))


def _frame(data: StepData) -> CalibrationFit:
    return fit_frame(_pulsed("pulses", data), known=data.known("pulses"))


def _leg(data: StepData) -> CalibrationFit:
    load = data.loads["weighted"]
    return fit_leg(
        _pulsed("bare", data),
        _pulsed("weighted", data),
        weight=KnownWeight(load.inertia or _NOTHING, load.stiffness or _NOTHING),
        known=data.known("bare"),
    )


def _pulsed(condition: str, data: StepData) -> PulsedRecord:
    """Return a record with its pulses, those of its table or of the command."""
    given = data.recordings[condition]
    recording = given.recording
    torque, friction = torque_from_current(recording, data.torque_model, cutoff_hz=_CUTOFF_HZ)
    encoder = recording["motor_angle"].to_numpy()
    table = given.pulse_table
    pulses = pulses_from_command(recording) if table is None else pulses_from_table(table)
    known = with_measured_amplitudes(pulses, recording.assign(torque=("time", torque)))
    return PulsedRecord(
        time=recording["time"].to_numpy(),
        angle=recording["angle"].to_numpy() if "angle" in recording else encoder,
        motor_angle=encoder,
        driving=torque - friction,
        friction=friction,
        onset_s=np.array([pulse.onset_s for pulse in known]),
        amplitude_nm=np.array([pulse.amplitude for pulse in known]),
    )


def _torsion(data: StepData) -> CalibrationFit:
    recording = data.recordings["locked"].recording
    time, angle = data.channels("locked", "angle")
    torque = recording["torque"].to_numpy() if "torque" in recording else _driving(recording, data)
    return fit_torsion(
        time,
        angle,
        torque,
        motor_angle=recording["motor_angle"].to_numpy() if "motor_angle" in recording else None,
        torque_gain=data.known("locked").torque_gain or _PERFECT_GAIN,
    )


def _driving(recording: xr.Dataset, data: StepData) -> np.ndarray:
    """Return the torque out of the current, without friction, N*m."""
    model = data.torque_model
    torque, friction = torque_from_current(recording, model, cutoff_hz=_CUTOFF_HZ)
    return np.asarray(torque - friction)


def _spring(data: StepData) -> CalibrationFit:
    return fit_spring(
        *data.channels("spring", "motor_angle", "current"),
        model=data.torque_model,
        stiffness=data.loads["spring"].stiffness or _NOTHING,
    )


_FITS: Mapping[str, Callable[[StepData], CalibrationFit]] = {
    "zero": _zero,
    "footswitch": _footswitch,
    "hinge": _hinge,
    "frame": _frame,
    "leg": _leg,
    "torsion": _torsion,
    "spring": _spring,
}
