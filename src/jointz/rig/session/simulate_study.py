"""Studies of simulated people, made in seconds without the runtime."""

import json
import os
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.errors import DataError
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.io.formats.netcdf_recording import write_recording
from jointz.io.new_folder import new_folder
from jointz.io.toml_text import written_table, written_text
from jointz.rig.devices.interface import Stretch
from jointz.rig.session.run import TRUTH_FILE
from jointz.rig.session.run_claim import STUDY_FILE
from jointz.rig.session.run_settings import pulses_name, recording_name
from jointz.rig.session.study_file import STUDY_UNITS, participant_lines, recording_lines
from jointz.rig.sim.descriptions import exoskeleton
from jointz.rig.sim.direct_walk import QUICK_GRID, WalkPlan, walk_directly
from jointz.rig.sim.people import Person, draw_person
from jointz.rig.sim.presets import Preset
from jointz.rig.sim.presets import preset as preset_named
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.sensors.motion_sensors import draw_motion_instruments

_LEVEL, _PULSES = "unperturbed", "perturbed"
_PLAN = WalkPlan(per_point=10)
_MOST_PARTICIPANTS = 1000
_UNITS = STUDY_UNITS | {"joint_moment": "N*m"}


def simulate_study(
    out: str | os.PathLike[str],
    *,
    preset: str | Preset = "nominal",
    participants: int | Sequence[Person] = 1,
    plan: WalkPlan = _PLAN,
    unperturbed_strides: int = 60,
    lag_sd_s: float | None = None,
    seed: int = 1,
    sensors: Collection[str] | None = None,
) -> Path:
    """Simulate people walking with and without pulses, and write the recordings as a study.

    Parameters
    ----------
    out : path
        The study's folder; must not exist.
    preset : str or Preset
        Quality of people and instruments: ``clean``, ``nominal``, ``hard``, ``anthropometric``,
        ``realistic``, or your own settings.
    participants : int or sequence of Person
        Number of people of the seeded population, or the people.
    plan : WalkPlan
        Pulses and strides of the perturbed walk; 10 pulses a timing point by default.
    unperturbed_strides : int
        Strides of the walk without pulses.
    lag_sd_s : float, optional, s
        Sd of the lab's measurement of its goniometer's lag; by default the lag is unknown.
    seed : int
        Seed of the population; a given person has an own seed.
    sensors : collection of str, optional
        Sensors of the knee's motion: ``goniometer``, and with it ``encoder`` and ``gyroscopes``;
        by default those of the preset.

    Returns
    -------
    pathlib.Path
        The study's folder, for :func:`jointz.analyze`; the truth is in ``ground_truth.json``.

    Raises
    ------
    DataError
        If a number is out of range or pulses do not fit.
    OutputError
        If the folder exists or cannot be written.

    Notes
    -----
    Pulses start at the true gait phase. :func:`jointz.run` runs the whole experiment, with
    estimated phase, safety gate and logs, which takes ten times as long.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     study = simulate_study(f"{folder}/study", plan=WalkPlan(per_point=1))
    ...     sorted(path.name for path in study.iterdir())[0]
    'S01_perturbed.nc'
    """
    settings = preset_named(preset) if isinstance(preset, str) else preset
    people = _people(participants, seed)
    if unperturbed_strides < 1 or (lag_sd_s is not None and not lag_sd_s > 0.0):
        raise DataError(
            "simulate_study: expected one unperturbed stride or more and lag_sd_s above 0, got "
            f"{unperturbed_strides} and {lag_sd_s}."
        )
    rigs = [SimulatedRig(one, settings, grid=QUICK_GRID, sensors=sensors) for one in people]
    with new_folder(Path(out), marker=STUDY_FILE, overwrite=False) as folder:
        truth = {
            rig.person.id: _walk(rig, folder, plan, strides=unperturbed_strides) for rig in rigs
        }
        content = {"protocol": "walked directly", "preset": settings.name, "participants": truth}
        (folder / TRUTH_FILE).write_text(json.dumps(content), encoding="utf-8")
        known = [_known(rig, lag_sd_s) for rig in rigs]
        (folder / STUDY_FILE).write_text(_study_toml(rigs, known, plan), encoding="utf-8")
    return Path(out)


def _people(participants: int | Sequence[Person], seed: int) -> list[Person]:
    count = participants if isinstance(participants, int) else len(participants)
    if not 1 <= count <= _MOST_PARTICIPANTS:
        raise DataError(
            f"simulate_study: expected 1 to {_MOST_PARTICIPANTS} participants, got {count}."
        )
    if isinstance(participants, int):
        return [draw_person(number, seed=seed) for number in range(count)]
    people = list(participants)
    if len({person.id for person in people}) < count:
        raise DataError(
            "simulate_study: expected people with different numbers, got "
            f"{', '.join(person.id for person in people)}."
        )
    return people


def _walk(rig: SimulatedRig, folder: Path, plan: WalkPlan, *, strides: int) -> dict[str, Any]:
    """Write both walks of a person; return the truth by condition."""
    level = walk_directly(rig, _LEVEL, plan=WalkPlan(per_point=0, warm_up_strides=strides))
    pulsed = walk_directly(rig, _PULSES, plan=plan)
    truth = {}
    for name, walk in ((_LEVEL, level), (_PULSES, pulsed)):
        file = recording_name(rig.person.id, name)
        write_recording(walk.recording(name, participant=rig.person.id, file=file), folder / file)
        truth[name] = rig.truth(
            name,
            worn=True,
            stretches=[Stretch(0, 0.0, walk.end_s)],
            pulses=walk.pulses,
            shapes=plan.shapes,
        )
    file = pulses_name(rig.person.id, _PULSES)
    pulsed.pulse_table.to_csv(folder / file, index=False, float_format="%.9g")
    return truth


def _known(rig: SimulatedRig, lag_sd_s: float | None) -> CalibrationSpec:
    """Return the lab's calibration: gains and frame, and the lag if it was measured."""
    if lag_sd_s is None:
        return rig.calibration
    true_s = rig.build(worn=True).instruments.angle_lag_s
    error = float(rig.person.stream("knowledge of the lag").standard_normal())
    lag = Calibrated(value=true_s + lag_sd_s * error, sd=lag_sd_s)
    return rig.calibration.overridden_by(CalibrationSpec(angle_lag_s=lag))


def _study_toml(
    rigs: Sequence[SimulatedRig], known: Sequence[CalibrationSpec], plan: WalkPlan
) -> str:
    moving = draw_motion_instruments(rigs[0].person, rigs[0].preset)
    units = _UNITS | {name: CHANNEL_UNITS[name][0] for name in moving}
    model = exoskeleton(rigs[0].build(worn=True)).torque_model.model_dump(exclude_defaults=True)
    lines = [
        "# Written by jointz: simulated people, walked without the runtime.",
        "jointz = 1",
        'joint = "knee"',
        'kind = "walking"',
        'positive = "flexion"',
        'torque_acts_on = "joint"',
        f'coupling = "{rigs[0].coupling}"',
        f"torque_model = {written_table(model)}",
        *(
            f"channels.{name} = {written_table({'column': name, 'unit': unit})}"
            for name, unit in units.items()
        ),
        'channels.contact = { column = "contact", kind = "contact" }',
        f"perturbations.timing_points = {written_table(dict(plan.timing_points))}",
    ]
    if rigs[0].device is not None:
        lines += [f"device = {written_table(rigs[0].device.model_dump())}"]
    for rig, calibration in zip(rigs, known, strict=True):
        lines += ["", "[[participants]]", *participant_lines(rig.wearer, calibration)]
    for rig in rigs:
        lines += _recordings(rig.person.id)
    return "\n".join(lines) + "\n"


def _recordings(participant: str) -> list[str]:
    lines = []
    for condition in (_LEVEL, _PULSES):
        file = recording_name(participant, condition)
        entries = {"participant": participant, "condition": condition, "file": file}
        lines += recording_lines(entries)
    return [*lines, f"perturbations = {written_text(pulses_name(participant, _PULSES))}"]
