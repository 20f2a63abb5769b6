"""Text of the ``study.toml`` of an experiment that jointz ran, and of its tables."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from jointz.core.channels import MOTION_SENSORS
from jointz.core.codes import Exclusion
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import CalibrationSpec, TorqueModelSpec
from jointz.io.toml_text import written_table, written_text, written_value
from jointz.rig.devices.interface import Rig, Wearer
from jointz.rig.session.run_settings import has_pulse_table, pulses_name, recording_name
from jointz.rig.session.session_recordings import gives_volts

#: Channels of every simulated study.
STUDY_UNITS = {
    "time": "s",
    "angle": "rad",
    "current": "A",
    "motor_angle": "rad",
    "motor_velocity": "rad/s",
    "command": "N*m",
}
_WALKING_UNITS = STUDY_UNITS | {"applied_torque": "N*m"}
_BENCH_UNITS = STUDY_UNITS | {"reference": "N*m"}
#: Chapter II states no filter; this one takes away encoder noise and leaves loads alone.
_BENCH_CUTOFF_HZ = 100.0
_PULSE_COLUMNS = ("onset_s", "duration_s", "amplitude_nm", "timing_point")
_EXCLUSION_COLUMNS = ("participant", "recording", "onset_s", "action", "reason", "time")


def study_toml(
    protocol: Protocol,
    rigs: Sequence[Rig],
    calibrations: Sequence[CalibrationSpec],
    torque_model: Mapping[str, Any] | None,
    *,
    devices: Mapping[str, Any] | None = None,
) -> str:
    """Return the text of ``study.toml``: rig and calibration of each person or load.

    ``torque_model`` and ``devices`` are as the header of a log has them.
    """
    walking = protocol.by_gait
    worn, coupling = rigs[0].device, getattr(rigs[0], "coupling", None)
    lines = [
        f"# Written by jointz run from the protocol {protocol.name}.",
        "jointz = 1",
        f"joint = {written_text(protocol.joint)}",
        f'kind = "{"walking" if walking else "bench"}"',
        f"positive = {written_text(protocol.positive)}",
        'torque_acts_on = "joint"',
        *([] if coupling is None else [f'coupling = "{coupling}"']),
    ]
    units = _walking_units(devices or {}) if walking else _bench_units(devices or {})
    for name, unit in units.items():
        lines += ["", f"[channels.{name}]", f'column = "{name}"', f'unit = "{unit}"']
    if any(condition.trials > 1 for condition in protocol.conditions):
        lines += ["", "[channels.trial]", 'column = "trial"']
    lines += _contact(walking=walking, devices=devices or {})
    if torque_model is not None and "torque" not in units:
        model = TorqueModelSpec.model_validate(torque_model)
        lines += ["", "[torque_model]", *_table(model.model_dump(exclude_defaults=True))]
    if worn is not None:
        lines += ["", "[device]", *_table(worn.model_dump())]
    points = protocol.timing_points
    if not walking:
        lines += ["", "[perturbations]", f"cutoff_hz = {_BENCH_CUTOFF_HZ}"]
    elif points:
        lines += ["", "[perturbations]", f"timing_points = {written_table(points)}"]
        lines += [] if protocol.window_s is None else [f"window_s = {protocol.window_s:g}"]
    if wishes := protocol.wishes:
        planned = wishes.items()
        lines += ["", "[planned_half_width_pct]"]
        lines += [f"{name} = {written_table(by_point)}" for name, by_point in planned]
    for rig, calibration in zip(rigs, calibrations, strict=True):
        lines += ["", "[[participants]]", *participant_lines(rig.wearer, calibration)]
    lines += _additions(protocol)
    for rig in rigs:
        lines += _recordings(rig.wearer.id, protocol)
    return "\n".join(lines) + "\n"


def pulses_csv(table: pd.DataFrame) -> str:
    """Return the text of the pulse table of a recording."""
    columns = [name for name in _PULSE_COLUMNS if name in table]
    return str(table[columns].to_csv(index=False, float_format="%.9g"))


def exclusions_csv(aborted: Sequence[Mapping[str, Any]], time: str) -> str:
    """Return the text of ``exclusions.csv``: pulses that were broken off and done again."""
    table = pd.DataFrame(aborted).assign(
        action="exclude", reason=Exclusion.ABORTED.meaning, time=time
    )
    columns = list(_EXCLUSION_COLUMNS)
    return str(table[columns].to_csv(index=False, float_format="%.9g", lineterminator="\n"))


def _contact(*, walking: bool, devices: Mapping[str, Any]) -> list[str]:
    """Return the footswitch: contacts, or volts whose levels are calibrated."""
    if walking and not gives_volts(devices):
        entries = {"column": "contact", "kind": "contact"}
    elif devices.get("contact") is not None:
        entries = {"column": "contact", "kind": "voltage", "unit": "V"}
    else:
        return []
    return ["", "[channels.contact]", *_table(entries)]


def _walking_units(devices: Mapping[str, Any]) -> dict[str, str]:
    sensor = devices.get("torque")
    moment = {} if sensor is None else {"joint_moment": sensor["unit"]}
    moved = {name: devices[name]["unit"] for name in MOTION_SENSORS if devices.get(name)}
    return _WALKING_UNITS | moment | moved


def _bench_units(devices: Mapping[str, Any]) -> dict[str, str]:
    units = dict(_BENCH_UNITS)
    sensor = devices.get("torque")
    if sensor is not None:
        units[sensor["channel"]] = sensor["unit"]
    positioner = devices.get("positioner")
    if positioner is not None:
        units |= {positioner["channel"]: "rad", "reference_position": "rad"}
    return units


def participant_lines(person: Wearer, calibration: CalibrationSpec) -> list[str]:
    """Return the keys of a participant."""
    lines = [f"id = {written_text(person.id)}"]
    if person.mass_kg is not None:
        lines.append(f"mass_kg = {person.mass_kg:.2f}")
    if person.height_m is not None:
        lines.append(f"height_m = {person.height_m:.3f}")
    entries = calibration.model_dump(exclude_none=True)
    if entries:
        lines.append("calibration = " + written_table(entries))
    return lines


def _recordings(participant: str, protocol: Protocol) -> list[str]:
    lines = []
    of_kind = Counter(condition.condition for condition in protocol.conditions)
    for condition in protocol.conditions:
        entries = {"participant": participant, "condition": condition.condition}
        if (
            condition.session is not None
            or condition.load is not None
            or of_kind[condition.condition] > 1
            or protocol.kind == "calibration"  # by it the analysis tells what was done
        ):
            entries["session"] = condition.session or condition.name
        entries["file"] = recording_name(participant, condition.name)
        if has_pulse_table(protocol, condition):
            entries["perturbations"] = pulses_name(participant, condition.name)
        lines += recording_lines(entries)
    return lines


def _additions(protocol: Protocol) -> list[str]:
    """Return a section for every load of a bench, and session with a known addition."""
    if protocol.cases_are_loads:
        key, added = "participant", {load.name: load for load in protocol.loads}
    else:
        loads = protocol.condition_loads
        key = "session"
        added = {c.session or c.name: loads[c.name] for c in protocol.conditions if c.load}
    lines = []
    for name, load in added.items():
        entries = {part: entry.model_dump() for part, entry in load.properties.items()}
        lines += ["", "[[additions]]", *_table({key: name, **entries})] if entries else []
    return lines


def recording_lines(entries: Mapping[str, str]) -> list[str]:
    """Return the section of a recording."""
    return ["", "[[recordings]]", *_table(entries)]


def _table(values: Mapping[str, Any]) -> list[str]:
    return [f"{name} = {written_value(value)}" for name, value in values.items()]
