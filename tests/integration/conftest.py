"""A browser, short protocols, and sessions on simulated rigs whose commands are kept."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from jointz.core.clock import VirtualClock
from jointz.core.protocols.protocol import Protocol
from jointz.core.recording import build_recording
from jointz.core.study import PerturbationsSpec
from jointz.identify.participant import ParticipantResult, analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import WALKING
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol, protocol_text
from jointz.rig.experiment.files.journal import read_journal
from jointz.rig.experiment.session import Session, SessionPlan
from jointz.rig.session.rigs.rig_settings import open_rig, rig_settings
from jointz.rig.session.run import NoOperator
from jointz.rig.sim.descriptions import exoskeleton

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), "")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser for all pages of a file.

    Not for the whole session: while playwright runs, no test of this process can run asyncio.
    """
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if not CHROMIUM:
        pytest.skip("no chromium on this machine")
    with api.sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield made
        made.close()


def _short(name="walking", conditions=(), *, strides=6, people=1, **plan) -> Protocol:
    whole = load_protocol(name)
    made = []
    for condition in whole.conditions:
        if condition.perturbations is None:
            few = {"strides": strides}
        else:
            few = {"perturbations": condition.perturbations.model_copy(update=plan)}
        if not conditions or condition.name in conditions:
            made.append(condition.model_copy(update=few))
    return whole.model_copy(update={"conditions": tuple(made), "participants": people})


@pytest.fixture(scope="session")
def short_walking() -> Callable[..., Protocol]:
    """Return what makes a walking protocol short: few strides, changes of the pulses' plan."""
    return _short


@pytest.fixture(scope="session")
def short_bench() -> Callable[..., Protocol]:
    """Return what takes the first pair of conditions and the first load of a bench protocol."""

    def short(name="sea-mass-spring", *, trials=2, **changes):
        whole = load_protocol(name)
        few = {"trials": trials, **changes}
        conditions = tuple(c.model_copy(update=few) for c in whole.conditions[:2])
        return whole.model_copy(update={"conditions": conditions, "loads": whole.loads[:1]})

    return short


@pytest.fixture(scope="session")
def walking_file(tmp_path_factory) -> Callable[..., Path]:
    """Return what writes a protocol file for two people."""

    def write(*, strides, pulses):
        text = protocol_text("walking")
        for old, new in (
            ("participants = 10", "participants = 2"),
            ("strides = 60", f"strides = {strides}"),
            ("count_per_point = 50", f"count_per_point = {pulses}"),
        ):
            assert old in text
            text = text.replace(old, new)
        file = tmp_path_factory.mktemp("protocol") / "short.toml"
        file.write_text(text)
        return file

    return write


@contextmanager
def _one_core() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.cpu_count", lambda: 1)
        patch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
        yield


@pytest.fixture(scope="session")
def one_core() -> Callable[[], AbstractContextManager[None]]:
    """Return what hides all cores but one: to start workers takes longer than a small study."""
    return _one_core


class SpiedSession:
    """A session on a simulated rig; keeps every command to the actuator with the tick's time."""

    def __init__(self, protocol, folder, *, seed=2):
        self.protocol, self.folder = protocol, folder
        self.rig = open_rig(rig_settings(protocol, "sim", "nominal", seed), 0)
        self.period_s = 1.0 / protocol.rates.control_hz
        self.commands, self.clock, self.devices = [], None, None
        self._opened, self.rig.open = self.rig.open, self._open

    def _open(self, condition, **more):
        self.clock, self.devices = more["clock"], self._opened(condition, **more)
        actuator = self.devices.actuator
        if actuator is not None:
            actuator.command_torque = self._kept(actuator.command_torque)
            actuator.stop = self._kept(actuator.stop)
        return self.devices

    def _kept(self, command):
        def kept(*torque):
            self.commands.append((self.clock.now_ns() * 1e-9, torque[0] if torque else "stop"))
            command(*torque)

        return kept

    def session(self, *, rig=None, protocol=None, **more):
        plan = SessionPlan(protocol or self.protocol, 1, self.folder)
        given = {"operator": NoOperator(), "progress": lambda *_told: None, **more}
        return Session(plan, rig or self.rig, clocks=VirtualClock, real_time=False, **given)

    def run(self, **more):
        self.session(**more).run()

    def records(self, trial="perturbed"):
        return read_log(self.folder / "logs" / f"{trial}-0.jzlog").records

    def events(self):
        return read_journal(self.folder / "journal.jsonl")

    def event_names(self):
        return [event["event"] for event in self.events()]

    def assert_stopped(self, at_s, *, within_ticks=1):
        """Zero torque was commanded, and stop called, within so many ticks of a time."""
        zeros = [t for t, torque in self.commands if torque in (0.0, "stop") and t >= at_s - 1e-9]
        assert zeros[0] <= at_s + within_ticks * self.period_s + 1e-9
        assert {torque for t, torque in self.commands if t > zeros[0]} <= {0.0, "stop"}
        assert self.commands[-1][1] == "stop"


@pytest.fixture(scope="session")
def spied_session() -> type[SpiedSession]:
    return SpiedSession


def _analyze_walk(rig, walked, plan, calibration) -> ParticipantResult:
    recording = build_recording(
        walked.time_s,
        dict(walked.channels),
        units={"contact": "1"},
        contact_kind="contact",
        condition="perturbed",
        file="walk.nc",
    )
    settings = ParticipantSettings(
        kind=WALKING,
        perturbations=PerturbationsSpec(timing_points=dict(plan.timing_points)),
        torque_model=exoskeleton(rig.build(worn=True)).torque_model,
        n_resamples=10,
        mass_kg=rig.person.mass_kg,
        coupling="rigid",
    )
    pulses = walked.pulses[["onset_s", "duration_s", "amplitude_nm", "timing_point"]]
    given = RecordingInput(recording, calibration, pulses)
    return analyze_participant("S01", [given], settings)


@pytest.fixture(scope="session")
def analyze_walk() -> Callable[..., ParticipantResult]:
    """Return what analyses a walk that was simulated directly."""
    return _analyze_walk
