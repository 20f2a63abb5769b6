"""Simulated people who walk the protocol of a study and are analysed by its method."""

from dataclasses import dataclass, replace
from zlib import crc32

from jointz.analysis.participant_jobs import participant_settings
from jointz.analysis.study_protocol import StudyProtocol
from jointz.core.channels import MOTION_SENSORS
from jointz.core.method_names import BAYESIAN
from jointz.core.study import Calibrated, CalibrationSpec, ParticipantSpec, Study
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.calibration import relative_sd
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.results.certificate_result import PARAMETERS, VirtualEstimate
from jointz.results.estimates import CellEstimate
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.descriptions import exoskeleton
from jointz.rig.sim.direct_walk import Walk, WalkPlan, walk_directly
from jointz.rig.sim.own_truth import cell_truth, own_truth
from jointz.rig.sim.people import Person, draw_person, personal_preset
from jointz.rig.sim.presets import Preset, preset
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.sensors.motion_sensors import draw_motion_instruments
from jointz.rig.sim.walking.plant_build import Grid

_LEVEL, _PULSES = "unperturbed", "perturbed"
_PHYSICS_HZ = 2500.0
_GAINS = ("torque_gain", "angle_gain", "friction_gain", *(f"{n}_gain" for n in MOTION_SENSORS))
_MEASURED = ("angle_lag_s", *(f"{name}_lag_s" for name in MOTION_SENSORS), "tissue_hz")
_SLOWEST_TISSUE_HZ = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class VirtualRequest:
    """Study, coupling and protocol of the simulated people, the same for all of them."""

    study: Study
    coupling: str  # of device and leg that the estimator assumes
    protocol: StudyProtocol
    seed: int

    @property
    def true_coupling(self) -> str:
        """Coupling in the simulation: that which the study states, whatever the estimator's."""
        return self.study.spec.coupling or self.coupling

    @property
    def population_seed(self) -> int:
        """Seed of people that no simulated study has."""
        return crc32(f"certificate {self.seed}".encode())


@dataclass(frozen=True, slots=True)
class VirtualPerson:
    """Estimates of a simulated person."""

    cells: tuple[CellEstimate, ...]
    estimates: tuple[VirtualEstimate, ...]  # K, B and J beside their truth


def world_of(coupling: str) -> Preset:
    """Return the preset of simulated people, without strap and frame if coupled rigidly."""
    world = preset("realistic")
    if coupling == "rigid":
        return replace(world, name="realistic, rigid coupling", body=None)
    return world


def virtual_person(request: VirtualRequest, number: int) -> VirtualPerson:
    """Let a simulated person walk the protocol, and analyse the recordings."""
    study, protocol = request.study, request.protocol
    own = study.spec.participants[number % len(study.spec.participants)]
    person = _person(own, number, request.population_seed)
    stated = _stated(study, own)
    world = _world(request, person, stated)
    grid = Grid(protocol.rate_hz, substeps=-int(-_PHYSICS_HZ // protocol.rate_hz))
    rig = SimulatedRig(person, world, grid=grid, sensors=_sensors(protocol))
    plan = WalkPlan(
        per_point=protocol.per_point,
        pulses=protocol.pulses,
        timing_points=protocol.timing_points,
        gap_strides=protocol.gap_strides,
    )
    walk = walk_directly(rig, _PULSES, plan=plan)
    truth = _truth(request, rig, walk, plan)
    result = analyze_participant(
        person.id,
        _recordings(rig, walk, protocol, _known(rig, stated)),
        _settings(request, own, rig),
    )
    cells = result.cells[BAYESIAN]
    by_point = {cell.timing_point: cell for cell in cells}
    return VirtualPerson(
        cells=tuple(cells),
        estimates=tuple(
            _estimate(f"V{number + 1:02d}", point, name, truth[point][name], by_point.get(point))
            for point in protocol.timing_points
            for name in PARAMETERS
        ),
    )


def _person(own: ParticipantSpec, number: int, seed: int) -> Person:
    """Return a simulated person of a participant's mass and height."""
    person = draw_person(number, seed=seed)
    return replace(
        person,
        mass_kg=own.mass_kg or person.mass_kg,
        height_m=own.height_m or person.height_m,
    )


def _stated(study: Study, own: ParticipantSpec) -> CalibrationSpec:
    """Return the calibration of a participant's recordings with pulses."""
    entries = [e for e in study.spec.recordings if e.participant == own.id]
    pulsed = [e for e in entries if e.condition == _PULSES] or entries
    return study.spec.calibration_of(pulsed[0]) if pulsed else study.spec.calibration


def _world(request: VirtualRequest, person: Person, stated: CalibrationSpec) -> Preset:
    """Return the person's preset, with the study's frame and errors as its calibration states."""
    world, device = world_of(request.true_coupling), request.study.spec.device
    if world.body is not None and device is not None:
        body = replace(world.body, frame_mass_kg=device.mass_kg, frame_distance_m=device.centre_m)
        world = replace(world, body=body)
    world = personal_preset(person, world)
    lags = _drawn_entries(person, stated)
    encoder, gyroscopes, goniometer = world.encoder, world.gyroscopes, world.goniometer
    return replace(
        world,
        goniometer=replace(
            goniometer,
            delay_s=min((goniometer.delay_s, *lags.get("angle_lag_s", ()))),
            lag_range_s=lags.get("angle_lag_s", goniometer.lag_range_s),
            tissue_range_hz=lags.get("tissue_hz", goniometer.tissue_range_hz),
            gain_error_sd=_sd(stated.angle_gain, goniometer.gain_error_sd),
        ),
        actuator=replace(
            world.actuator,
            gain_error_sd=_sd(stated.torque_gain, world.actuator.gain_error_sd),
            friction_error_sd=_sd(stated.friction_gain, world.actuator.friction_error_sd),
        ),
        encoder=encoder
        and replace(
            encoder,
            lag_range_s=lags.get("joint_encoder_lag_s", encoder.lag_range_s),
            gain_error_sd=_sd(stated.joint_encoder_gain, encoder.gain_error_sd),
        ),
        gyroscopes=gyroscopes
        and replace(
            gyroscopes,
            lag_range_s=lags.get("shank_velocity_lag_s", gyroscopes.lag_range_s),
            gain_error_sd=_sd(stated.shank_velocity_gain, gyroscopes.gain_error_sd),
        ),
    )


def _drawn_entries(person: Person, stated: CalibrationSpec) -> dict[str, tuple[float, float]]:
    """Return true values of the stated lags and of the tissue, as ranges of no width."""
    drawn = {}
    for name, error in _errors_of_calibration(person).items():
        entry = getattr(stated, name)
        if entry is not None:
            least = _SLOWEST_TISSUE_HZ if name == "tissue_hz" else 0.0
            value = max(entry.value + entry.sd * error, least)
            drawn[name] = value, value
    return drawn


def _errors_of_calibration(person: Person) -> dict[str, float]:
    """Return true minus calibrated values, sd, whether they are stated or not."""
    errors = person.stream("stated instruments").standard_normal(len(_MEASURED))
    return dict(zip(_MEASURED, errors.tolist(), strict=True))


def _sd(stated: Calibrated | None, usual: float) -> float:
    return usual if stated is None else relative_sd(stated)


def _known(rig: SimulatedRig, stated: CalibrationSpec) -> CalibrationSpec:
    """Return what is known of the simulated instruments: as much as the study states.

    Gains are 1 with the stated relative sd; the frame is known, as its part is subtracted from
    the estimates.
    """
    entries = {}
    for name in _GAINS:
        entry = getattr(stated, name)
        if entry is not None:
            entries[name] = Calibrated(value=1.0, sd=relative_sd(entry))
    sensors = draw_motion_instruments(rig.person, rig.preset)
    true = {f"{name}_lag_s": sensor.lag_s for name, sensor in sensors.items()}
    true["angle_lag_s"] = rig.preset.goniometer.lag_range_s[0]
    true["tissue_hz"] = (rig.preset.goniometer.tissue_range_hz or (0.0,))[0]
    for name, error in _errors_of_calibration(rig.person).items():
        entry = getattr(stated, name)
        if entry is not None and name in true:
            # Usually the stated value; both gyroscopes of the simulation have one lag.
            entries[name] = Calibrated(value=true[name] - entry.sd * error, sd=entry.sd)
    if rig.calibration.intrinsic_inertia is not None:
        entries["intrinsic_inertia"] = rig.calibration.intrinsic_inertia
    return CalibrationSpec(**entries)


def _sensors(protocol: StudyProtocol) -> tuple[str, ...]:
    encoder = ("encoder",) if MOTION_SENSORS[0] in protocol.sensors else ()
    gyroscopes = ("gyroscopes",) if set(MOTION_SENSORS[1:]) & set(protocol.sensors) else ()
    return "goniometer", *encoder, *gyroscopes


def _truth(
    request: VirtualRequest, rig: SimulatedRig, walk: Walk, plan: WalkPlan
) -> dict[str, dict[str, float]]:
    window_s = request.study.spec.perturbations.window_s
    if request.true_coupling != "rigid":
        return own_truth(rig.person, rig.preset, plan, window_s)
    return cell_truth(
        rig.truth(
            _PULSES,
            worn=True,
            stretches=[Stretch(0, 0.0, walk.end_s)],
            pulses=walk.pulses,
            shapes=plan.shapes,
            window_s=window_s,
        )
    )


def _recordings(
    rig: SimulatedRig, walk: Walk, protocol: StudyProtocol, known: CalibrationSpec
) -> list[RecordingInput]:
    """Return the recordings, with the sensors that the study has."""
    walks = {_PULSES: walk}
    if protocol.unperturbed_strides:
        plan = WalkPlan(per_point=0, warm_up_strides=protocol.unperturbed_strides)
        walks[_LEVEL] = walk_directly(rig, _LEVEL, plan=plan)
    left_out = {"joint_moment", *MOTION_SENSORS} - set(protocol.sensors)
    recordings = []
    for condition, given in walks.items():
        recording = given.recording(condition, participant=rig.person.id, file=condition)
        recording = recording.drop_vars(left_out, errors="ignore")
        table = given.pulse_table if condition == _PULSES else None
        recordings.append(RecordingInput(recording, known, table))
    return recordings


def _settings(
    request: VirtualRequest, own: ParticipantSpec, rig: SimulatedRig
) -> ParticipantSettings:
    """Return the settings of the study, for the simulated device and person."""
    person, perturbations = rig.person, request.study.spec.perturbations
    whole = participant_settings(request.study, own.id, BAYESIAN, resamples=2, seed=request.seed)
    return replace(
        whole,
        methods=(BAYESIAN,),
        coupling=request.coupling,
        perturbations=perturbations.model_copy(
            update={"source": "table", "timing_points": dict(request.protocol.timing_points)}
        ),
        torque_model=exoskeleton(rig.build(worn=True)).torque_model,
        device=rig.device,
        mass_kg=person.mass_kg,
        person=ParticipantSpec(id=person.id, mass_kg=person.mass_kg, height_m=person.height_m),
        user_exclusions=(),
        positive="flexion",
    )


def _estimate(
    who: str, point: str, name: str, truth: float, cell: CellEstimate | None
) -> VirtualEstimate:
    row = None if cell is None else cell.parameter(name)
    if row is None:
        return VirtualEstimate(who, point, name, truth, None, None, None, "failed:no_pulses")
    return VirtualEstimate(who, point, name, truth, row.value, row.ci_low, row.ci_high, row.status)
