"""Steps of a calibration: recordings of one participant to the fit of a step."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.core.errors import StudyError
from jointz.core.protocols.protocol_calibration_checks import STEP_RULES
from jointz.core.protocols.protocol_models import LoadSpec
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

_UNIT_GAIN, _ZERO = Calibrated(value=1.0, sd=0.0), Calibrated(value=0.0, sd=0.0)
_CUTOFF_HZ = 20.0


@dataclass(frozen=True, slots=True, eq=False)
class StepData:
    """Recordings of one participant for a step, and what is known about them."""

    recordings: Mapping[str, RecordingInput]  # condition -> its recording
    loads: Mapping[str, LoadSpec]  # condition -> known load on the joint
    model: TorqueModelSpec | None  # torque model of the actuator, as stated

    def channels(self, condition: str, *names: str) -> list[np.ndarray]:
        """Return time and channels of a condition."""
        recording = self.recordings[condition].recording
        return [recording[name].to_numpy() for name in ("time", *names)]

    def known(self, condition: str) -> CalibrationSpec:
        """Return the entries of the instruments that the study has already."""
        return self.recordings[condition].calibration

    @property
    def torque_model(self) -> TorqueModelSpec:
        """The actuator's model; :func:`step_data` has checked that there is one."""
        if self.model is None:
            raise ValueError("no torque model; step_data reports it before")
        return self.model

    def torque_and_friction(self, condition: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque out of the current, and the friction in it, N*m."""
        recording = self.recordings[condition].recording
        return torque_from_current(recording, self.torque_model, cutoff_hz=_CUTOFF_HZ)


@dataclass(frozen=True, slots=True)
class _Step:
    channels: tuple[str, ...]  # required channels
    fit: Callable[[StepData], CalibrationFit]


def step_data(
    step: str,
    recordings: Sequence[RecordingInput],
    *,
    loads: Mapping[str, LoadSpec],
    model: TorqueModelSpec | None,
) -> StepData:
    """Assign recordings to the conditions of a step; raise StudyError with all problems."""
    participant = str(recordings[0].recording.attrs["participant"]) if recordings else "nobody"
    conditions = STEP_RULES[step].conditions
    sessions = [str(r.recording.attrs["session"]) for r in recordings]
    if len(conditions) == 1 and sessions == [""]:  # the only one of a step of one
        sessions = list(conditions)
    by_condition: dict[str, RecordingInput] = {}
    problems: list[str] = []
    for name in conditions:
        matching = [r for r, s in zip(recordings, sessions, strict=True) if s == name]
        if len(matching) == 1:
            by_condition[name] = matching[0]
            continue
        found = ", ".join(sorted(set(sessions) - {""})) or "none"
        problems.append(
            f'expected one recording with session = "{name}", found {len(matching)} (sessions: '
            f"{found}). Name it in study.toml, one a participant."
        )
    data = StepData(by_condition, loads, model)
    problems += [p for name in by_condition for p in _recording_problems(step, name, data)]
    needs_model = "current" in _STEPS[step].channels or (
        step == "torsion" and any("torque" not in r.recording for r in by_condition.values())
    )
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
    return _STEPS[step].fit(data)


def _recording_problems(step: str, condition: str, data: StepData) -> list[str]:
    source = data.recordings[condition]
    recording = source.recording
    missing = [c for c in _STEPS[step].channels if c not in recording]
    if step == "torsion" and not {"torque", "current"} & set(recording):
        missing.append("current")
    problems = [
        f"{source.file}: the channel '{channel}' is missing; '{condition}' cannot do without it. "
        f"Declare [channels.{channel}] in study.toml."
        for channel in missing
    ]
    if step == "footswitch" and recording.attrs["contact_kind"] != "voltage":
        problems.append(
            f'{source.file}: the switch gives no volts. Declare kind = "voltage" under '
            "[channels.contact], or leave the step out: other kinds need no levels."
        )
    needs_pulses = STEP_RULES[step].torque == "pulses" and source.pulse_table is None
    if needs_pulses and "command" not in recording:
        problems.append(
            f"{source.file}: no pulses. Give it a pulse table (perturbations), or the command."
        )
    return problems


def _pulsed(condition: str, data: StepData) -> PulsedRecord:
    """Return a record with its pulses, those of its table or of the command."""
    source = data.recordings[condition]
    recording, table = source.recording, source.pulse_table
    torque, friction = data.torque_and_friction(condition)
    encoder = recording["motor_angle"].to_numpy()
    pulses = pulses_from_command(recording) if table is None else pulses_from_table(table)
    pulses = with_measured_amplitudes(pulses, recording.assign(torque=("time", torque)))
    return PulsedRecord(
        time=recording["time"].to_numpy(),
        angle=recording["angle"].to_numpy() if "angle" in recording else encoder,
        motor_angle=encoder,
        driving=torque - friction,
        friction=friction,
        onset_s=np.array([pulse.onset_s for pulse in pulses]),
        amplitude_nm=np.array([pulse.amplitude for pulse in pulses]),
    )


def _leg(data: StepData) -> CalibrationFit:
    load = data.loads["weighted"]
    return fit_leg(
        _pulsed("bare", data),
        _pulsed("weighted", data),
        weight=KnownWeight(load.inertia or _ZERO, load.stiffness or _ZERO),
        known=data.known("bare"),
    )


def _torsion(data: StepData) -> CalibrationFit:
    recording = data.recordings["locked"].recording
    time, angle = data.channels("locked", "angle")
    if "torque" in recording:
        torque = recording["torque"].to_numpy()
    else:
        torque = np.subtract(*data.torque_and_friction("locked"))
    return fit_torsion(
        time,
        angle,
        torque,
        motor_angle=recording["motor_angle"].to_numpy() if "motor_angle" in recording else None,
        torque_gain=data.known("locked").torque_gain or _UNIT_GAIN,
    )


_STEPS: Mapping[str, _Step] = {
    "zero": _Step(("angle",), lambda data: fit_zero(*data.channels("straight", "angle"))),
    "footswitch": _Step(
        ("contact",), lambda data: fit_footswitch(*data.channels("walking", "contact"))
    ),
    "hinge": _Step(
        ("angle", "motor_angle"),
        lambda data: fit_hinge(*data.channels("swing", "angle", "motor_angle")),
    ),
    "frame": _Step(
        ("motor_angle", "current"),
        lambda data: fit_frame(_pulsed("pulses", data), known=data.known("pulses")),
    ),
    "leg": _Step(("angle", "motor_angle", "current"), _leg),
    "torsion": _Step(("angle",), _torsion),
    "spring": _Step(
        ("motor_angle", "current"),
        lambda data: fit_spring(
            *data.channels("spring", "motor_angle", "current"),
            model=data.torque_model,
            stiffness=data.loads["spring"].stiffness or _ZERO,
        ),
    ),
}
