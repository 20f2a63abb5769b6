"""Parts of a protocol file (TOML), each with the checks that concern it alone."""

import re
from collections.abc import Iterator, Mapping
from functools import partial
from math import hypot, isclose
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.gait_phases import ALL_POINTS, FASTEST_M_S, SLOWEST_M_S, stride_time_ratio
from jointz.core.limits import LimitsOverride
from jointz.core.protocols.pulse_models import (
    NamedPulse,
    Pulse,
    PulseSpec,
    printable_name_problem,
)
from jointz.core.protocols.reference_signal_models import Reference
from jointz.core.study import (
    GRAVITY,
    Calibrated,
    ConditionField,
    Direction,
    Name,
    PlannedHalfWidths,
    SchemaVersion,
)

#: The steps of a calibration, in the order in which a lab does them.
CalibrationStep = Literal["zero", "footswitch", "hinge", "frame", "leg", "torsion", "spring"]
#: Sensors of the joint's motion; gyroscopes are on shank and thigh.
MotionSensor = Literal["goniometer", "encoder", "gyroscopes"]
#: What a session does when the page of its operator is lost.
WithoutConsole = Literal["go_on", "stop"]
#: What live estimates may do: be shown, move the pulses to come to other timing points, end them.
LiveAction = Literal["show", "steer", "stop"]

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
#: Slower, samples are too old to act on; faster than any loop of a computer.
Rate = Annotated[float, Field(ge=100, le=10_000)]
#: No experiment has more of anything that is counted.
Count = Annotated[int, Field(gt=0, le=10_000)]
Strides = Annotated[int, Field(le=10_000)]

#: Duration of a stride at 1.2 m/s where nobody has walked yet, s.
ASSUMED_STRIDE_S = 1.1
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_LONGEST_NAME = 64
#: Of a load that can be told from a locked output, and of any joint, SI units.
_LARGEST = {"stiffness": 1e5, "damping": 1e3, "inertia": 1e3, "mass_kg": 20.0, "distance_m": 1.0}
_ZERO = Calibrated(value=0.0, sd=0.0)


def _name_problems(name: str, *key: str, why: str = "names files") -> Iterator[Problem]:
    if not _FILE_NAME.fullmatch(name) or len(name) > _LONGEST_NAME:
        got = repr(name) if len(name) <= _LONGEST_NAME else f"{len(name)} characters"
        yield Problem(
            key or ("name",),
            f"expected letters, digits, - and _, at most {_LONGEST_NAME}, because it {why}; got "
            f"{got}.",
        )


class RatesSpec(CheckedModel):
    """How often the loop runs and devices are sampled."""

    control_hz: Rate = 500.0
    sample_hz: Rate = 500.0

    def checks(self) -> tuple[Check, ...]:
        """Return the check between the rates."""
        return (self._whole_ratio,)

    def _whole_ratio(self) -> Iterator[Problem]:
        low, high = sorted((self.control_hz, self.sample_hz))
        if not isclose(high / low, round(high / low), rel_tol=1e-9):
            yield Problem(
                ("sample_hz",),
                f"expected a whole multiple of control_hz = {self.control_hz:g} Hz or a whole "
                f"fraction of it, got {self.sample_hz:g} Hz.",
            )


def _as_tuple(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _kind_of_count(value: Any) -> str:
    return "table" if isinstance(value, Mapping) else "number"


#: One number for all timing points, or a table of them.
CountPerPoint = Annotated[
    Annotated[Count, Tag("number")] | Annotated[dict[Name, Count], Tag("table")],
    Discriminator(_kind_of_count),
]


class PerturbationPlan(CheckedModel):
    """Which pulses fire when.

    In walking, at timing points of the gait cycle, ``gap_strides`` apart. On a
    bench, at points of the reference's cycle, each at the first that comes after
    ``pause_s`` of rest, or at clock times: ``count`` pulses, each after ``pause_s``.
    """

    timing_points: dict[Name, float] | None = Field(default=None, min_length=1)
    count_per_point: CountPerPoint | None = None
    gap_strides: tuple[Strides, Strides] | None = Field(default=None, strict=False)
    warm_up_strides: Annotated[int, Field(ge=0, le=10_000)] = 10
    count: Count | None = None
    pause_s: Positive | None = None
    sham_share: Annotated[float, Field(ge=0, lt=1)] = 0.0
    order: Literal["balanced", "random", "sequential", "cyclic"] = "balanced"

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of the plan."""
        points = self._points_named, self._points_in_cycle, self._points_differ
        return *points, self._gaps, self._counts, self._shams

    @property
    def counts(self) -> dict[str, int]:
        """Pulses at each timing point, shams left out; at "" if there are no timing points."""
        given = self.count_per_point
        if isinstance(given, dict):
            return {name: given.get(name, 0) for name in self.timing_points or {}}
        if given is None:
            return {"": self.count or 0}
        return dict.fromkeys(self.timing_points or {}, given)

    @property
    def shams(self) -> dict[str, int]:
        """Shams at each timing point."""
        per_pulse = self.sham_share / (1.0 - self.sham_share)
        return {name: round(per_pulse * n) for name, n in self.counts.items()}

    @property
    def total(self) -> int:
        """Pulses of the plan, shams included."""
        return sum(self.counts.values()) + sum(self.shams.values())

    def _points_named(self) -> Iterator[Problem]:
        for name in self.timing_points or {}:
            if name == ALL_POINTS:
                message = "means all of them; expected another name."
                yield Problem(("timing_points", name), message)
            if problem := printable_name_problem(name):
                yield Problem(("timing_points", name), f"{problem}; got {name[:80]!r}.")

    def _points_in_cycle(self) -> Iterator[Problem]:
        for name, pct in (self.timing_points or {}).items():
            if not 0 <= pct < 100:
                message = f"expected 0 <= % of cycle < 100, got {pct:g}."
                yield Problem(("timing_points", name), message)

    def _points_differ(self) -> Iterator[Problem]:
        first: dict[float, str] = {}
        for name, pct in (self.timing_points or {}).items():
            if first.setdefault(pct, name) != name:
                message = f"{pct:g} % is {first[pct]} already. Remove one of the two."
                yield Problem(("timing_points", name), message)

    def _gaps(self) -> Iterator[Problem]:
        if self.gap_strides is None:
            return
        fewest, most = self.gap_strides
        if not 1 <= fewest <= most:
            yield Problem(
                ("gap_strides",),
                f"expected [fewest, most] with 1 <= fewest <= most, got [{fewest}, {most}].",
            )

    def _counts(self) -> Iterator[Problem]:
        if self.timing_points is not None and self.count_per_point is None:
            yield Problem(("count_per_point",), "missing; timing_points need it.")
        if self.timing_points is None and self.count_per_point is not None:
            yield Problem(("timing_points",), "missing; count_per_point needs them.")
        if isinstance(self.count_per_point, dict) and self.timing_points is not None:
            yield from self._points_counted(self.count_per_point, self.timing_points)
        if self.count is not None and self.count_per_point is not None:
            message = "count_per_point says how many there are. Remove one of the two."
            yield Problem(("count",), message)

    @staticmethod
    def _points_counted(
        counts: Mapping[str, int], points: Mapping[str, float]
    ) -> Iterator[Problem]:
        if missing := [name for name in points if name not in counts]:
            message = f"missing for {', '.join(missing)}; give one number for all, or each."
            yield Problem(("count_per_point",), message)
        for name in counts:
            if name not in points:
                message = f"is no timing point; expected one of {', '.join(points)}."
                yield Problem(("count_per_point", name), message)

    def _shams(self) -> Iterator[Problem]:
        pulses = min(self.counts.values(), default=0)
        if self.sham_share and pulses and not all(self.shams.values()):
            yield Problem(
                ("sham_share",),
                f"{self.sham_share:g} of {pulses} pulses is less than one sham. Raise it, or "
                "remove it for none.",
            )


class ControllerSpec(CheckedModel):
    """Controller that commands the torque of a condition; the package that has it checks the rest.

    In ``profile``, the path of a file or ``published``, ``{participant}`` stands for the id.
    """

    name: Name
    profile: Name | None = None
    settings: dict[Name, float] = Field(default_factory=dict)


class ConditionSpec(CheckedModel):
    """One part of the experiment, run without a break.

    Conditions of one ``session`` belong together: what is unperturbed in it is the
    baseline of what is perturbed, and on a bench it names the timing point.
    """

    name: Name
    condition: ConditionField
    prompt: str
    session: Name | None = None
    strides: Count | None = None
    duration_s: Positive | None = None
    trials: Count = 1
    torque_nm: Reference | None = None
    position_rad: Reference | None = None
    velocity_rad_s: Reference | None = None
    perturbations: PerturbationPlan | None = None
    controller: ControllerSpec | None = None
    load: Name | None = None

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of the condition."""
        names = partial(checked_name, self), self._session_named
        return *names, self._pulses_fit_condition, self._one_motion

    @property
    def worn(self) -> bool:
        """Whether the device is worn."""
        return self.condition != "no_device"

    @property
    def trial_names(self) -> tuple[str, ...]:
        """Names of the trials; the condition's own name for a single trial."""
        if self.trials == 1:
            return (self.name,)
        return tuple(f"{self.name}-{k}" for k in range(1, self.trials + 1))

    @property
    def references(self) -> dict[str, Reference]:
        """Quantity with unit -> its reference."""
        named = {
            "torque_nm": self.torque_nm,
            "position_rad": self.position_rad,
            "velocity_rad_s": self.velocity_rad_s,
        }
        return {name: reference for name, reference in named.items() if reference is not None}

    def _session_named(self) -> Iterator[Problem]:
        if self.session is not None:
            yield from _name_problems(self.session, "session", why="stands in tables")

    def _pulses_fit_condition(self) -> Iterator[Problem]:
        if self.perturbations is not None and self.condition != "perturbed":
            yield Problem(
                ("perturbations",),
                f'condition is "{self.condition}". Remove them, or set condition = "perturbed".',
            )

    def _one_motion(self) -> Iterator[Problem]:
        if self.position_rad is not None and self.velocity_rad_s is not None:
            message = "position_rad is given too; one side moves one way. Remove one of the two."
            yield Problem(("velocity_rad_s",), message)


class GaitSpec(CheckedModel):
    """Walking speed, and settings of the phase of the gait cycle."""

    speed_m_s: Positive
    strides_in_mean: Annotated[int, Field(ge=1, le=20)] = 5
    accepted_band: tuple[float, float] = Field(default=(0.75, 1.33), strict=False)
    steady_after_strides: Annotated[int, Field(ge=1, le=100)] = 3
    refractory_s: Positive = 0.3

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of the gait settings."""
        return self._walking_speed, self._band, self._refractory

    @property
    def assumed_stride_s(self) -> float:
        """Assumed duration of a stride before anybody has walked, s."""
        # A speed that nobody walks at is one problem; what follows from it need not be more.
        speed_m_s = min(max(self.speed_m_s, SLOWEST_M_S), FASTEST_M_S)
        return ASSUMED_STRIDE_S * stride_time_ratio(speed_m_s)

    @property
    def shortest_stride_s(self) -> float:
        """Shortest accepted stride at the assumed duration, s."""
        return self.assumed_stride_s * self.accepted_band[0]

    def _walking_speed(self) -> Iterator[Problem]:
        if not SLOWEST_M_S <= self.speed_m_s <= FASTEST_M_S:
            yield Problem(
                ("speed_m_s",),
                f"expected {SLOWEST_M_S:g} to {FASTEST_M_S:g} m/s, at which people walk; got "
                f"{self.speed_m_s:g} m/s.",
            )

    def _band(self) -> Iterator[Problem]:
        low, high = self.accepted_band
        if not 0 < low < 1 < high:
            message = f"expected [low, high] with 0 < low < 1 < high, got [{low:g}, {high:g}]."
            yield Problem(("accepted_band",), message)

    def _refractory(self) -> Iterator[Problem]:
        if self.accepted_band[0] > 0 and self.refractory_s >= self.shortest_stride_s:
            yield Problem(
                ("refractory_s",),
                f"expected less than the shortest stride accepted ({self.shortest_stride_s:.3g} s),"
                f" got {self.refractory_s:g} s.",
            )


class LoadSpec(CheckedModel):
    """A known load of a bench, with standard deviations; what it leaves out is zero.

    A load without any is a free output; ``locked`` holds the output instead. In a
    calibration it is on the joint in the condition of the same name, in walking in those that name
    it: a weight on the shank, ``distance_m`` from the joint, or a spring across the joint.
    """

    name: Name
    stiffness: Calibrated | None = None
    damping: Calibrated | None = None
    inertia: Calibrated | None = None
    locked: bool = False
    mass_kg: Calibrated | None = None
    distance_m: Calibrated | None = None

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of the load."""
        whole = self._nothing_moves_when_locked, self._weight_is_whole
        return (partial(checked_name, self), self._positive, *whole)

    @property
    def added_inertia(self) -> Calibrated:
        """Inertia about the joint: the stated one, or m d^2 of a weight, kg*m^2."""
        return self.inertia or self._of_weight(2)

    @property
    def gravity_nm(self) -> Calibrated:
        """Largest torque of gravity, m g d of a weight, N*m; 0 for a stated inertia."""
        return self._of_weight(1, times=GRAVITY)

    @property
    def properties(self) -> dict[str, Calibrated]:
        """Parts that are not zero, by their keys in ``additions`` of a study."""
        inertia, stiffness = self.added_inertia, self.stiffness or _ZERO
        entries = {"inertia": inertia, "stiffness": stiffness, "damping": self.damping or _ZERO}
        entries["gravity_nm"] = self.gravity_nm
        return {name: entry for name, entry in entries.items() if entry.value != 0.0}

    def _of_weight(self, power: int, times: float = 1.0) -> Calibrated:
        """Return a multiple of mass * distance^power."""
        m, d = self.mass_kg or _ZERO, self.distance_m or _ZERO
        sd = hypot(d.value**power * m.sd, power * m.value * d.value ** (power - 1) * d.sd)
        return Calibrated(value=times * m.value * d.value**power, sd=times * sd)

    def _weight_is_whole(self) -> Iterator[Problem]:
        if (self.mass_kg is None) != (self.distance_m is None):
            key = "mass_kg" if self.mass_kg is None else "distance_m"
            yield Problem((key,), "missing; mass_kg and distance_m go together.")
        if self.mass_kg is not None and self.inertia is not None:
            yield Problem(("inertia",), "mass_kg and distance_m give it. Remove one of the two.")

    def _nothing_moves_when_locked(self) -> Iterator[Problem]:
        for key in ("damping", "inertia"):
            if self.locked and getattr(self, key) is not None:
                yield Problem((key,), "a locked output does not move. Remove one of the two.")

    def _positive(self) -> Iterator[Problem]:
        for key in _LARGEST:
            entry: Calibrated | None = getattr(self, key)
            if entry is not None and not 0 <= entry.value <= _LARGEST[key]:
                stiffer = " What gives way less is locked = true." if key == "stiffness" else ""
                yield Problem(
                    (key, "value"),
                    f"expected 0 to {_LARGEST[key]:g} in SI units, got {entry.value:g}.{stiffer}",
                )


class ExpectedJoint(CheckedModel):
    """Joint with the device on it that displacements are computed with before a session."""

    stiffness: Annotated[float, Field(gt=0, le=_LARGEST["stiffness"])]
    damping: Annotated[float, Field(ge=0, le=_LARGEST["damping"])]
    inertia: Annotated[float, Field(gt=0, le=_LARGEST["inertia"])]


class LiveSpec(CheckedModel):
    """Estimates while a session runs, and what they may change of it.

    ``planned_half_width_pct`` stands for K, B and J at all timing points; without it the table of
    the protocol holds. Pulses stop only when every timing point has ``fewest_pulses``.
    """

    may: Annotated[tuple[LiveAction, ...], BeforeValidator(_as_tuple)] = Field(
        default=("show",), min_length=1, strict=False
    )
    planned_half_width_pct: Positive | None = None
    fewest_pulses: Annotated[int, Field(ge=20, le=10_000)] = 20
    every_pulses: Count = 24

    @property
    def decides(self) -> bool:
        """True if estimates may steer or stop the session."""
        return bool({"steer", "stop"} & set(self.may))


class ProtocolFields(CheckedModel):
    """Keys of a protocol file, schema version 1."""

    jointz_protocol: SchemaVersion
    name: Name
    title: str = Field(min_length=1)
    section: str = ""
    kind: Literal["walking", "bench", "calibration", "control"]
    calibration: CalibrationStep | None = None
    bench: Literal["series-elastic", "quasi-direct-drive"] | None = None
    joint: str = Field(min_length=1)
    positive: Direction = "flexion"
    participants: Count = 1
    seed: Annotated[int, Field(ge=0)] = 1
    notes: tuple[str, ...] = Field(default=(), strict=False)
    rates: RatesSpec = RatesSpec()
    gait: GaitSpec | None = None
    pulse: PulseSpec | None = None
    pulses: tuple[NamedPulse, ...] = Field(default=(), max_length=20, strict=False)
    expected_joint: ExpectedJoint | None = None
    window_s: Annotated[float, Field(ge=0.001, le=10)] | None = None
    sensors: tuple[MotionSensor, ...] = Field(default=(), strict=False)
    safety: LimitsOverride = LimitsOverride()
    planned_half_width_pct: PlannedHalfWidths | None = None
    live: LiveSpec | None = None
    without_console: WithoutConsole = "go_on"
    loads: tuple[LoadSpec, ...] = Field(default=(), strict=False)
    conditions: tuple[ConditionSpec, ...] = Field(min_length=1, strict=False)

    @property
    def shapes(self) -> tuple[Pulse, ...]:
        """Every pulse of the protocol."""
        return self.pulses if self.pulse is None else (self.pulse,)

    @property
    def wishes(self) -> PlannedHalfWidths | None:
        """Half-widths that are wanted, % of the value, by parameter and timing point."""
        if self.live is None or self.live.planned_half_width_pct is None:
            return self.planned_half_width_pct
        points = dict.fromkeys(self.timing_points, self.live.planned_half_width_pct)
        return {"stiffness": points, "damping": points, "inertia": points}

    @property
    def timing_points(self) -> dict[str, float]:
        """Timing points of all conditions -> onset, % of the gait cycle."""
        plans = (c.perturbations for c in self.conditions if c.perturbations is not None)
        return {name: at for plan in plans for name, at in (plan.timing_points or {}).items()}

    @property
    def by_gait(self) -> bool:
        """True for walking and control: the loop follows the gait cycle of a person."""
        return self.kind in ("walking", "control")

    @property
    def condition_loads(self) -> dict[str, LoadSpec]:
        """Condition in walking -> its known addition to the joint."""
        named = {load.name: load for load in self.loads}
        return {c.name: named[c.load] for c in self.conditions if c.load is not None}

    @property
    def cases_are_loads(self) -> bool:
        """Whether loads take the place of participants (a bench with loads)."""
        return self.kind == "bench" and bool(self.loads)

    @property
    def cases(self) -> int:
        """Number of participants, or of loads in their place."""
        return len(self.loads) if self.cases_are_loads else self.participants


def checked_name(model: ConditionSpec | LoadSpec | ProtocolFields) -> Iterator[Problem]:
    """Yield the problems of a name."""
    # Looked up when the check runs: a name that could not be read is no longer there.
    return _name_problems(model.name)
