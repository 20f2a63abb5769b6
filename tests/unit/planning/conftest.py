"""Small plans: few timing points, few legs, slow sampling, goniometer only."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

import jointz
from jointz.core.protocols.protocol import Protocol
from jointz.core.study import ParticipantSpec
from jointz.io.protocols import load_protocol
from jointz.planning.laboratory import SENSORS, Actuator, Laboratory
from jointz.planning.plan_result import Plan
from jointz.planning.planner import Planner
from jointz.planning.schedule import schedule_of_protocol
from jointz.planning.unperturbed_walking import stored_walking
from jointz.planning.wishes import Wishes

ONE_POINT = {"MST": 21.5}
DOUBLET: Mapping[str, Any] = {
    "name": "short",
    "kind": "doublet",
    "amplitudes_nm": (10.0, 17.0),
    "durations_s": (0.040, 0.022),
    "direction": "both",
}


def _small(
    name: str = "walking_doublets",
    *,
    points: Mapping[str, float] = ONE_POINT,
    per_point: int | Mapping[str, int] = 48,
    **changes: Any,
) -> Protocol:
    """Return a stored protocol with few timing points, sampled slowly."""
    raw = load_protocol(name).model_dump(exclude_defaults=True, exclude_none=True)
    for condition in raw["conditions"]:
        if plan := condition.get("perturbations"):
            plan |= {"timing_points": dict(points), "count_per_point": per_point}
    return Protocol.model_validate(raw | {"rates": {"sample_hz": 250.0}} | changes)


@pytest.fixture(scope="session")
def small_protocol() -> Callable[..., Protocol]:
    """Return what makes a protocol small."""
    return _small


@pytest.fixture(scope="session", autouse=True)
def _few_legs() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jointz.planning.planner.LEGS", 3)
        yield


@pytest.fixture(scope="session")
def doublets() -> Protocol:
    """A protocol of one timing point with doublets of its own."""
    return _small(pulses=[DOUBLET])


@pytest.fixture(scope="session")
def made(doublets: Protocol) -> Plan:
    """The plan of doublets without a wish."""
    return jointz.plan(doublets)


@pytest.fixture
def bare_plan(monkeypatch: pytest.MonkeyPatch, made: Plan) -> Callable[..., Plan]:
    """Return what plans without comparing sensors: a third of the time."""
    monkeypatch.setattr(Planner, "_measures", lambda *_: list(made.measures))
    return jointz.plan


@pytest.fixture(scope="session")
def lab() -> Callable[..., Laboratory]:
    """Return what makes a lab without a pilot, with sensors beside the goniometer."""

    def make(protocol: Protocol, *sensors: str) -> Laboratory:
        schedule = schedule_of_protocol(protocol)
        noise = {name: SENSORS[name][1] for name in ("goniometer", *sensors)}
        walking = stored_walking(
            schedule.timing_points,
            {SENSORS[name][0]: sd for name, sd in noise.items()},
            window_s=schedule.design.window_s,
            rate_hz=250.0,
            stride_s=1.1,
            n_strides=schedule.teaching_strides,
        )
        person = ParticipantSpec(id="typical", mass_kg=75.0, height_m=1.75)
        return Laboratory((person,), (walking,), noise, Actuator(17.0))

    return make


@pytest.fixture(scope="session")
def see(lab: Callable[..., Laboratory]) -> Callable[[Protocol], Plan]:
    """Return what plans with fixed pulses, as for a study that was recorded."""

    def seen(protocol: Protocol) -> Plan:
        schedule = schedule_of_protocol(protocol)
        planner = Planner(
            schedule, lab(protocol), Wishes(), walking="stored", seed=1, tell=lambda _: None
        )
        return planner.plan(None)

    return seen
