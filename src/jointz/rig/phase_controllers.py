"""The controllers of jointz: laws over the gait cycle that follow a profile."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from jointz.control.impedance_profile import GRID_PCT, ImpedanceProfile
from jointz.control.make_profile import impedance_profile
from jointz.control.profile_file import profile_text, read_profile
from jointz.control.rendering.tank import EnergyTank
from jointz.control.state_machine import ImpedanceState, fit_state_machine, osl_states, state_tables
from jointz.core.errors import DataError
from jointz.core.gait_phases import PHASES
from jointz.core.protocols.protocol import Protocol as ProtocolSpec
from jointz.core.protocols.protocol_models import ControllerSpec
from jointz.io.protocols import PUBLISHED
from jointz.rig.devices.interface import Wearer
from jointz.rig.experiment.controllers import ControlParameter, ControlState

#: Masses that differ by more are those of two people.
_SAME_MASS = 0.05
#: A wearer feels at most this change of support from one second to the next.
_SHARE_PER_S = 0.1
#: A phase in which the angle moves by less has no line of moment on angle.
_MOVES_RAD = 0.05
_SHARE = {"share": (0.1, 0.0, 1.0)}
#: Of measured impedance: size of the energy tank (J), full at the start; 0: none.
_IMPEDANCE = {**_SHARE, "tank_j": (0.0, 0.0, 50.0)}
#: Of kinematic PD: default, least and largest of each setting.
_PD = {"share": (1.0, 0.0, 1.0), "stiffness": (10.0, 0.0, 300.0), "damping": (0.2, 0.0, 10.0)}


@dataclass(frozen=True, slots=True, eq=False)
class PhaseTables:
    """A law: torque = feedforward + stiffness * (equilibrium - angle) - damping * velocity.

    Each is an array (100,) over the cycle, SI, linear in between.
    """

    feedforward: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    equilibrium: np.ndarray


class PhaseController:
    """A law over the gait cycle, of which the device gives a share.

    With a tank its stiffness rises only with energy that the damping took out.
    """

    def __init__(
        self, tables: PhaseTables, share: float, about: Mapping[str, Any], tank_j: float = 0.0
    ) -> None:
        rows = (tables.feedforward, tables.stiffness, tables.damping, tables.equilibrium)
        # Lists of floats: an element of an array costs ten times as much in the loop.
        self._nodes = [tuple(map(float, node)) for node in zip(*rows, strict=True)]
        self._about = {**about, "tank_j": tank_j} if tank_j else dict(about)
        self._tank = EnergyTank(tank_j) if tank_j else None
        self._last: tuple[float, float] = 0.0, 0.0  # time and equilibrium of the last tick
        self.parameters = {"share": ControlParameter(share, 0.0, 1.0, _SHARE_PER_S, "1")}

    def torque(self, state: ControlState, values: Mapping[str, float]) -> float:
        """Return the torque, N*m."""
        n = len(self._nodes)
        place = state.phase_pct * 0.01 * n % n
        node = int(place)
        share, (f0, k0, b0, e0) = place - node, self._nodes[node]
        f1, k1, b1, e1 = self._nodes[(node + 1) % n]
        stiffness, damping = k0 + share * (k1 - k0), b0 + share * (b1 - b0)
        equilibrium, given = e0 + share * (e1 - e0), values["share"]
        rest = f0 + share * (f1 - f0) - damping * state.velocity
        stiffness, damping = given * stiffness, given * damping
        if self._tank is not None:
            stiffness = self._limited(self._tank, stiffness, damping, equilibrium, state)
        return stiffness * (equilibrium - state.angle) + given * rest

    def _limited(
        self,
        tank: EnergyTank,
        stiffness: float,
        damping: float,
        equilibrium: float,
        state: ControlState,
    ) -> float:
        """Return the stiffness that the tank allows."""
        (last_s, last), self._last = self._last, (state.time_s, equilibrium)
        elapsed_s = state.time_s - last_s
        moved = (equilibrium - last) / elapsed_s if elapsed_s > 0.0 else 0.0
        # Where the phase jumps the equilibrium does, and its rate says nothing of the damper.
        rate = min(abs(state.velocity), abs(state.velocity - moved))
        return tank.limit(
            stiffness,
            damping,
            deviation=state.angle - equilibrium,
            rate=rate,
            elapsed_s=elapsed_s,
        )

    def describe(self) -> Mapping[str, Any]:
        """Return law and origin, as plain JSON."""
        names = ("feedforward_nm", "stiffness_nm_rad", "damping_nm_s_rad", "equilibrium_rad")
        columns = zip(*self._nodes, strict=True)
        return {**self._about, "tables": dict(zip(names, map(list, columns), strict=True))}


#: Makes the tables of a controller, given a profile and the controller's settings.
Law = Callable[[ImpedanceProfile, Mapping[str, float]], PhaseTables]
_ZERO = np.zeros(GRID_PCT.size)


def _torque_replay(profile: ImpedanceProfile, _: Mapping[str, float]) -> PhaseTables:
    return PhaseTables(profile.moment, _ZERO, _ZERO, _ZERO)


def _kinematic_pd(profile: ImpedanceProfile, settings: Mapping[str, float]) -> PhaseTables:
    """Return a PD law to the mean angle and velocity."""
    damping = _ZERO + settings["damping"]
    stiffness = _ZERO + settings["stiffness"]
    return PhaseTables(damping * profile.velocity, stiffness, damping, profile.angle)


def _continuous(profile: ImpedanceProfile, _: Mapping[str, float]) -> PhaseTables:
    return PhaseTables(_ZERO, profile.stiffness, profile.damping, profile.equilibrium)


def _constant(profile: ImpedanceProfile, _: Mapping[str, float]) -> PhaseTables:
    one = np.ones(GRID_PCT.size)
    return _through_moment(profile, profile.stiffness.mean() * one, profile.damping.mean() * one)


def _per_phase(profile: ImpedanceProfile, _: Mapping[str, float]) -> PhaseTables:
    stiffness, damping = profile.stiffness.copy(), profile.damping.copy()
    for begin, end in PHASES.values():
        phase = slice(round(begin), round(end))  # nodes lie at full %
        stiffness[phase], damping[phase] = stiffness[phase].mean(), damping[phase].mean()
    return _through_moment(profile, stiffness, damping)


def _through_moment(
    profile: ImpedanceProfile, stiffness: np.ndarray, damping: np.ndarray
) -> PhaseTables:
    """Return a law that gives the moment of the profile along its mean stride."""
    lead = (profile.moment + damping * profile.velocity) / stiffness
    return PhaseTables(_ZERO, stiffness, damping, profile.angle + lead)


def _quasi_stiffness(profile: ImpedanceProfile, _: Mapping[str, float]) -> PhaseTables:
    """Return quasi-stiffness: in each gait phase the line of moment on angle that resists it.

    A phase has its mean moment instead where the line would drive the knee on (moment growing with
    angle) or the angle hardly moves; no line is stiffer than the profile.
    """
    feedforward, stiffness = np.zeros(GRID_PCT.size), np.zeros(GRID_PCT.size)
    stiffest = float(profile.stiffness.max())
    for begin, end in PHASES.values():
        phase = slice(round(begin), round(end))  # nodes lie at full %
        angle, moment = profile.angle[phase], profile.moment[phase]
        off, slope = angle - angle.mean(), 0.0
        if np.ptp(angle) > _MOVES_RAD:
            slope = min(max(0.0, -float(off @ moment) / float(off @ off)), stiffest)
        stiffness[phase] = slope
        feedforward[phase] = moment.mean() + slope * angle.mean()
    return PhaseTables(feedforward, stiffness, _ZERO, _ZERO)


def _of_states(states: tuple[ImpedanceState, ...]) -> PhaseTables:
    stiffness, damping, equilibrium = state_tables(states, GRID_PCT)
    return PhaseTables(_ZERO, stiffness, damping, equilibrium)


# --- factories -----------------------------------------------------------------------------------


def _make(
    law: Law,
    known: Mapping[str, tuple[float, float, float]],
    spec: ControllerSpec,
    *,
    protocol: ProtocolSpec,
    wearer: Wearer,
) -> PhaseController:
    """Return a controller that follows a profile."""
    settings = _settings(spec, known)
    profile, about = wearers_profile(spec, protocol=protocol, wearer=wearer)
    tank_j = settings.get("tank_j", 0.0)
    return PhaseController(law(profile, settings), settings["share"], about, tank_j)


make_torque_replay = partial(_make, _torque_replay, _SHARE)
make_kinematic_pd = partial(_make, _kinematic_pd, _PD)
make_quasi_stiffness = partial(_make, _quasi_stiffness, _SHARE)
make_impedance_constant = partial(_make, _constant, _IMPEDANCE)
make_impedance_per_phase = partial(_make, _per_phase, _IMPEDANCE)
make_impedance_continuous = partial(_make, _continuous, _IMPEDANCE)


def make_zero_torque(
    spec: ControllerSpec, *, protocol: ProtocolSpec, wearer: Wearer
) -> PhaseController:
    """Return a controller that asks for no torque."""
    del protocol, wearer
    _settings(spec, {})
    if spec.profile is not None:
        raise DataError("profile: zero torque follows none. Remove it.")
    return PhaseController(PhaseTables(_ZERO, _ZERO, _ZERO, _ZERO), 0.0, {})


def make_four_state(
    spec: ControllerSpec, *, protocol: ProtocolSpec, wearer: Wearer
) -> PhaseController:
    """Return four states of constant impedance: fitted to a profile, else the published ones.

    States change by phase of the gait cycle, since the rig measures no load.
    """
    settings = _settings(spec, _SHARE)
    if spec.profile is None:
        _check_joint("knee", "flexion", protocol, "the published states")
        about = {"states": "published with the opensourceleg library"}
        return PhaseController(_of_states(osl_states()), settings["share"], about)
    _check_joint("knee", "flexion", protocol, "four states")
    profile, about = wearers_profile(spec, protocol=protocol, wearer=wearer)
    return PhaseController(_of_states(fit_state_machine(profile).states), settings["share"], about)


def wearers_profile(
    spec: ControllerSpec, *, protocol: ProtocolSpec, wearer: Wearer
) -> tuple[ImpedanceProfile, dict[str, Any]]:
    """Return the profile that a condition names, for a wearer, and where it comes from."""
    if spec.profile is None:
        raise DataError(
            f"profile: missing; {spec.name} follows one. Give a file of jointz control profile, or "
            f'"{PUBLISHED}".'
        )
    if wearer.mass_kg is None:
        raise DataError(f"profile: the mass of {wearer.id} is unknown, and torques go with it.")
    file = spec.profile.replace("{participant}", wearer.id)
    profile = impedance_profile() if file == PUBLISHED else read_profile(file)
    _check_joint(profile.joint, profile.positive, protocol, f"profile {file}")
    profile = _for_wearer(profile, wearer, file)
    return profile, {"profile": file, "subject": profile.subject, "content": profile_text(profile)}


def _check_joint(joint: str, positive: str, protocol: ProtocolSpec, what: str) -> None:
    wanted = protocol.joint, protocol.positive
    if (joint, positive) != wanted:
        raise DataError(
            f"{what}: expected {' with positive '.join(wanted)}, as the protocol says; got {joint} "
            f"with positive {positive}. Signs are not turned: that is for whoever made it."
        )


def _for_wearer(profile: ImpedanceProfile, wearer: Wearer, file: str) -> ImpedanceProfile:
    mass_kg = float(wearer.mass_kg or 0.0)
    if profile.scales_with_mass:
        return profile.for_mass(mass_kg)
    if abs(mass_kg - profile.mass_kg) > _SAME_MASS * profile.mass_kg:
        raise DataError(
            f"profile {file}: of {profile.subject}, {profile.mass_kg:.4g} kg; {wearer.id} weighs "
            f"{mass_kg:.4g} kg. Take the wearer's own profile, or one of a group."
        )
    return profile


def _settings(
    spec: ControllerSpec, known: Mapping[str, tuple[float, float, float]]
) -> dict[str, float]:
    """Return all settings with defaults; raise for unknown ones and those out of range."""
    problems = [
        f"settings.{name}: {spec.name} has {', '.join(known) or 'none'}. Remove it."
        for name in spec.settings
        if name not in known
    ]
    problems += [
        f"settings.{name}: expected {low:g} to {high:g}, got {spec.settings[name]:g}."
        for name, (_, low, high) in known.items()
        if name in spec.settings and not low <= spec.settings[name] <= high
    ]
    if problems:
        raise DataError(" ".join(problems))
    return {name: float(spec.settings.get(name, default)) for name, (default, *_) in known.items()}
