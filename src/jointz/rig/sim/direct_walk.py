"""A simulated walk without devices and runtime: pulses fired from the true phase.

For studies of accuracy over hundreds of people. The physics is that of
:mod:`jointz.rig.sim.walking.plant`; what is left out is the real-time loop with its estimate of
the gait phase, its compensation of the actuator's friction and its safety gate, and the logs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
import xarray as xr
from numba import njit

from jointz.core.channels import MOTION_SENSORS, PULSE_COLUMNS
from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.pulse_models import (
    NamedPulse,
    Pulse,
    PulseSpec,
    PulseVariant,
    TorquePart,
    name_of,
    variants_of,
)
from jointz.core.recording import build_recording
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.sensors.footswitch_model import ContactMaker
from jointz.rig.sim.sensors.moment_measurement import MomentMeasurement
from jointz.rig.sim.sensors.motion_sensors import MotionSensors, advance_and_measure
from jointz.rig.sim.walking import plant
from jointz.rig.sim.walking.gait_motion import Stride
from jointz.rig.sim.walking.layout import HISTORY, STATE_SIZE, Noise, State
from jointz.rig.sim.walking.plant_build import Grid, PlantBuild

#: 17 N*m held for 250 ms (dissertation 4.2).
WALKING_PULSE = PulseSpec(amplitude_nm=17.0, duration_s=0.25, hold_s=0.25)
#: Half the steps of the physics for 0.6 of the time: angles are within 1e-5 rad at all presets,
#: 5e-4 rad at ``realistic``, whose reflexes are late by any time and here by whole steps.
QUICK_GRID = Grid(500.0, substeps=5)
_MEASURED = ("motor_angle", "motor_velocity", "current", "angle", "joint_moment")
_BISECTIONS = 40


@dataclass(frozen=True, slots=True)
class WalkPlan:
    """How many pulses are fired where, and how many strides are walked.

    Parameters
    ----------
    per_point : int or mapping of str to int
        Pulses at every timing point, or at each; 0 for an unperturbed walk.
    pulse : PulseSpec
        Their shape; ``both`` alternates the direction at every timing point.
    amplitudes_nm : tuple of float, N*m
        Sizes that take turns at every timing point; the pulse's own without.
    pulses : tuple of NamedPulse
        Shapes that take turns at every timing point with their sizes and directions, instead of
        ``pulse`` and ``amplitudes_nm``.
    timing_points : mapping of str to float
        Timing point -> % of the gait cycle.
    gap_strides : tuple of int
        Fewest and most strides from one pulse to the next.
    warm_up_strides, tail_strides : int
        Before the first pulse and after the last.

    Raises
    ------
    DataError
        When a count is negative or for no timing point, a timing point lies outside the cycle,
        an amplitude is not positive, or numbers of strides leave no room for a pulse.

    Examples
    --------
    >>> WalkPlan(per_point={"LRE": 3}).counts["LRE"], WalkPlan(per_point=0).counts["MST"]
    (3, 0)
    """

    per_point: int | Mapping[str, int] = 50
    pulse: PulseSpec = WALKING_PULSE
    amplitudes_nm: tuple[float, ...] = ()
    pulses: tuple[NamedPulse, ...] = ()
    timing_points: Mapping[str, float] = field(default_factory=lambda: dict(TIMING_POINTS))
    gap_strides: tuple[int, int] = (3, 7)
    warm_up_strides: int = 10
    tail_strides: int = 5

    def __post_init__(self) -> None:
        problems = list(self._problems())
        if problems:
            raise DataError("WalkPlan: " + "; ".join(problems) + ".")

    def _problems(self) -> Iterator[str]:
        per_point = {} if isinstance(self.per_point, int) else dict(self.per_point)
        if unknown := sorted(set(per_point) - set(self.timing_points)):
            yield (
                f"expected per_point for {', '.join(self.timing_points)}, got {', '.join(unknown)}"
            )
        if any(n < 0 for n in self.counts.values()):
            yield f"expected per_point >= 0, got {self.per_point}"
        if not all(0.0 <= at < 100.0 for at in self.timing_points.values()):
            yield f"expected timing_points in 0..100 %, got {dict(self.timing_points)}"
        if not all(size > 0.0 for size in self.amplitudes_nm):
            yield f"expected amplitudes_nm > 0 (direction has the sign), got {self.amplitudes_nm}"
        if self.pulses and self.amplitudes_nm:
            yield "expected no amplitudes_nm beside pulses, which have their own"
        if not 1 <= self.gap_strides[0] <= self.gap_strides[1]:
            yield f"expected gap_strides from low to high, 1 or more, got {self.gap_strides}"
        if self.warm_up_strides < 1 or self.tail_strides < 1:
            yield (
                "expected one stride or more of warm_up_strides and tail_strides, got "
                f"{self.warm_up_strides} and {self.tail_strides}"
            )

    @property
    def counts(self) -> dict[str, int]:
        """Pulses at each timing point."""
        if isinstance(self.per_point, int):
            return dict.fromkeys(self.timing_points, self.per_point)
        return {name: self.per_point.get(name, 0) for name in self.timing_points}

    @property
    def shapes(self) -> dict[str, Pulse]:
        """Every shape by its name; "" for the only one."""
        return {name_of(pulse): pulse for pulse in self.pulses or (self.pulse,)}

    def variant(self, count: int) -> PulseVariant:
        """Return shape and signed size of a pulse, given the number before it at its point."""
        if not self.pulses:
            return PulseVariant("", self.torque_nm(count))
        variants = variants_of(self.pulses)
        return variants[count % len(variants)]

    def torque_nm(self, count: int) -> float:
        """Return the signed size of a pulse with ``count`` pulses before it at its timing point.

        >>> both = WALKING_PULSE.model_copy(update={"direction": "both"})
        >>> plan = WalkPlan(pulse=both, amplitudes_nm=(8.0, 17.0))
        >>> [plan.torque_nm(count) for count in range(4)]
        [8.0, -8.0, 17.0, -17.0]
        """
        sizes = self.amplitudes_nm or (self.pulse.amplitude_nm,)
        if self.pulse.direction == "both":
            return (1.0, -1.0)[count % 2] * sizes[count // 2 % len(sizes)]
        sign = 1.0 if self.pulse.direction == "positive" else -1.0
        return sign * sizes[count % len(sizes)]


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """What was recorded in a walk.

    Parameters
    ----------
    time_s : (n,) float, s
        Time stamps.
    channels : mapping of str to (n,) float
        Channel -> samples, SI: ``motor_angle, motor_velocity, current, angle, joint_moment,
        command, contact``; ``angle``, ``joint_moment`` and ``contact`` where nothing is worn.
        With the rig's sensors also ``joint_encoder`` where worn, ``shank_velocity`` and
        ``thigh_velocity``.
    pulses : pandas.DataFrame
        ``pulse, onset_s, duration_s, amplitude_nm, timing_point, shape, completed``.
    """

    time_s: np.ndarray
    channels: Mapping[str, np.ndarray]
    pulses: pd.DataFrame

    @property
    def end_s(self) -> float:
        """The last time stamp."""
        return float(self.time_s[-1])

    @property
    def pulse_table(self) -> pd.DataFrame:
        """The pulses as a study's table has them."""
        return self.pulses[["onset_s", "duration_s", "amplitude_nm", "timing_point"]]

    def recording(self, condition: str, *, participant: str, file: str) -> xr.Dataset:
        """Return the recording of the walk, with all its channels."""
        return build_recording(
            self.time_s,
            self.channels,
            units={"contact": "1"},
            condition=condition,
            file=file,
            contact_kind="contact",
            participant=participant,
            joint="knee",
            positive="flexion",
        )


def walk_directly(
    rig: SimulatedRig, condition: str, *, worn: bool = True, plan: WalkPlan | None = None
) -> Walk:
    """Walk one uninterrupted stretch of a condition.

    Parameters
    ----------
    rig : SimulatedRig
        Who walks in what. Its grid is used (:data:`QUICK_GRID` saves time); stumbles that are
        ordered from it are walked.
    condition : str
        Name of the condition; it seeds the randomness, as in an experiment.
    worn : bool
        Whether the exoskeleton is worn.
    plan : WalkPlan, optional
        Pulses and strides; 50 pulses a timing point by default.

    Returns
    -------
    Walk
        Recorded signals and the pulses.

    Raises
    ------
    DataError
        When pulses are asked for but nothing is worn, pulses overlap or outlast the walk, or the
        rig's devices are ordered to misbehave: there are no devices.

    Notes
    -----
    A pulse fires at the first sample at or after its timing point in the true phase of its
    stride. Sample for sample the signals are those of ``RunningPlant``
    (:mod:`jointz.rig.sim.benches`) for the same command. Misleads about onsets: in an experiment
    they scatter with the stride times (docs/run.md), and heel strikes are known from the
    footswitch only.

    Examples
    --------
    >>> from jointz.rig.sim.rig import simulated_rig
    >>> walk = walk_directly(simulated_rig(0), "perturbed", plan=WalkPlan(per_point=1))
    >>> sorted(walk.pulses["timing_point"])
    ['ISW', 'LRE', 'MST', 'MSW', 'PSW', 'TST']
    """
    if rig.inject.orders:
        raise DataError(
            "walk_directly: expected no orders in rig.inject, there are no devices to misbehave. "
            "Open the rig for that."
        )
    plan = plan or WalkPlan()
    rng = rig.person.stream(f"direct plan {condition}")
    planned = _planned(plan, rng)
    if planned and not worn:
        raise DataError("walk_directly: no pulse without an exoskeleton. Set worn or no pulses.")
    build = rig.build(worn=worn, condition=condition)
    n_strides = (planned[-1][0] if planned else plan.warm_up_strides) + plan.tail_strides
    motion = rig.motion(condition, 0)
    strides = [motion.next() for _ in range(n_strides + 1)]
    period_s = build.grid.period_s
    n = int(strides[-1].start_s / period_s)
    pulses = _pulse_table(planned, strides, plan, period_s)
    _check_room(pulses, n * period_s)
    command = _command(pulses, plan, n, period_s)
    sensors = MotionSensors(build, purpose=condition, segment=0)
    noise = rig.person.stream(f"noise {condition}", 0)
    measured = _advance(build, strides, command, noise, sensors)
    contacts = ContactMaker(
        rig.preset.footswitch,
        contact_share=rig.preset.gait.contact_share,
        rng=rig.person.stream(f"contact {condition}", 0),
    )
    channels = dict(zip(_MEASURED, measured[: len(_MEASURED)], strict=True))
    channels["command"] = command
    moment = MomentMeasurement(build, purpose=condition, segment=0)
    channels["joint_moment"] = moment.gain * channels["joint_moment"] + moment.errors(n)
    if not worn:
        channels = {name: channels[name] for name in ("angle", "joint_moment")}
    moving = dict(zip(MOTION_SENSORS, measured[len(_MEASURED) :], strict=True))
    channels |= {name: moving[name] for name in sensors.channels}
    channels["contact"] = _contact(contacts, strides, n, build.grid.period_ns)
    return Walk(np.arange(n) * period_s, channels, pulses)


def _planned(plan: WalkPlan, rng: np.random.Generator) -> list[tuple[int, str, PulseVariant]]:
    """Return stride, timing point and variant of every pulse, in order of time.

    Every round holds each timing point that still has pulses once.
    """
    left = plan.counts
    fired = dict.fromkeys(left, 0)
    stride = plan.warm_up_strides
    planned = []
    while any(left.values()):
        round_ = [name for name, n in left.items() if n > 0]
        for name in rng.permutation(round_).tolist():
            planned.append((stride, name, plan.variant(fired[name])))
            left[name] -= 1
            fired[name] += 1
            stride += int(rng.integers(plan.gap_strides[0], plan.gap_strides[1] + 1))
    return planned


def _pulse_table(
    planned: list[tuple[int, str, PulseVariant]],
    strides: list[Stride],
    plan: WalkPlan,
    period_s: float,
) -> pd.DataFrame:
    rows = []
    for number, (k, name, variant) in enumerate(planned, start=1):
        at_s = _time_of_phase(strides[k], plan.timing_points[name] / 100.0)
        onset_s = np.ceil(at_s / period_s) * period_s
        length_s = plan.shapes[variant.shape].length_s
        rows.append((number, onset_s, length_s, variant.amplitude_nm, name, variant.shape, True))
    return pd.DataFrame(rows, columns=list(PULSE_COLUMNS))


def _check_room(pulses: pd.DataFrame, end_s: float) -> None:
    ends = (pulses["onset_s"] + pulses["duration_s"]).to_numpy()
    following = np.append(pulses["onset_s"].to_numpy()[1:], end_s)
    late = np.flatnonzero(ends[: len(pulses)] > following[: len(pulses)])
    if late.size:
        first = int(late[0])
        raise DataError(
            f"walk_directly: pulse {first + 1} ends at {ends[first]:.3f} s, expected at most "
            f"{following[first]:.3f} s, where the next one or the end of the walk is. "
            "Use more gap_strides or tail_strides, or a shorter pulse."
        )


def _time_of_phase(stride: Stride, phase: float) -> float:
    """Return when a stride reaches a phase, by bisection: phase rises with time."""
    low, high = stride.start_s, stride.end_s
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if float(stride.cycles(np.array([middle]))[0]) < phase:
            low = middle
        else:
            high = middle
    return high


def _command(pulses: pd.DataFrame, plan: WalkPlan, n: int, period_s: float) -> np.ndarray:
    """Return the commanded torque at every sample, N*m; zero outside pulses."""
    command = np.zeros(n)
    shares = {name: _shares(pulse.course, period_s) for name, pulse in plan.shapes.items()}
    for onset_s, torque_nm, shape in zip(
        pulses["onset_s"], pulses["amplitude_nm"], pulses["shape"], strict=True
    ):
        first, share = round(onset_s / period_s), shares[shape]
        command[first : first + share.size] = torque_nm * share
    return command


def _shares(course: tuple[TorquePart, ...], period_s: float) -> np.ndarray:
    """Return the share of the amplitude at every sample from the onset on."""
    ends_s = np.cumsum([part.duration_s for part in course])
    since_s = np.arange(round(ends_s[-1] / period_s)) * period_s
    which = np.searchsorted(ends_s, since_s + 1e-9, side="right").clip(max=len(course) - 1)
    begins_s = np.concatenate([[0.0], ends_s[:-1]])[which]
    begin = np.array([part.begin for part in course])[which]
    end = np.array([part.end for part in course])[which]
    share = begin + (end - begin) * (since_s - begins_s) / (ends_s[which] - begins_s)
    return np.asarray(share)


def _contact(contacts: ContactMaker, strides: list[Stride], n: int, period_ns: int) -> np.ndarray:
    """Return the footswitch at every sample: the contacts of every stride but the first."""
    change = np.zeros(n + 1)
    for stride in strides[1:]:
        times = contacts.toggles(stride.start_s, stride.duration_s)
        at = np.array([-(-round(time_s * 1e9) // period_ns) for time_s in times], dtype=int)
        np.add.at(change, at.clip(0, n), np.where(np.arange(at.size) % 2, -1.0, 1.0))
    return np.asarray(np.cumsum(change)[:n].clip(0.0, 1.0))


def _advance(
    build: PlantBuild,
    strides: list[Stride],
    command: np.ndarray,
    rng: np.random.Generator,
    sensors: MotionSensors,
) -> np.ndarray:
    """Return what motor and sensors show and, fifth, the true moment at every sample, (8, n)."""
    gaits = np.array([stride.row for stride in strides])
    period_ns = build.grid.period_ns
    # The sample after which a stride holds: physics advances from the sample before.
    ends = np.array([-(-round(stride.end_s * 1e9) // period_ns) for stride in strides])
    noise = rng.standard_normal((command.size, len(Noise)))
    state = np.zeros(STATE_SIZE)
    history = np.zeros((HISTORY, plant.HISTORY_COLUMNS))
    plant.begin(build.params, state, gaits[0], history)
    person = build.params, state, build.curves, history
    both = noise, sensors.noise(command.size)
    return np.asarray(_advance_all(person, sensors.arrays, (gaits, ends), both, command))


@njit(cache=True, nogil=True)
def _advance_all(
    person: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    sensors: tuple[np.ndarray, np.ndarray, np.ndarray],
    strides: tuple[np.ndarray, np.ndarray],
    noise: tuple[np.ndarray, np.ndarray],
    command: np.ndarray,
) -> np.ndarray:
    """Return what is measured, (8, n).

    ``strides`` are their rows and the samples from which each is over.
    """
    (gaits, ends), state = strides, person[1]
    out = np.empty((8, command.size))
    stride = 0
    for sample in range(command.size):
        if sample - 1 >= ends[stride]:
            stride += 1
            state[State.PATH_KNOWN] = 0.0
        torque_nm = command[sample - 1] if sample > 0 else 0.0
        motor, angle, moment, motion = advance_and_measure(
            person, sensors, gaits[stride], noise, sample, torque_nm
        )
        out[0, sample], out[1, sample], out[2, sample] = motor[0], motor[1], motor[2]
        out[3, sample], out[4, sample] = angle, moment
        out[5, sample], out[6, sample], out[7, sample] = motion
    return out
