"""Estimates while a session runs: those of ``jointz analyze`` on what is recorded by then."""

import json
import shutil
import time
from dataclasses import replace

import pytest

import jointz
from jointz.core.errors import DataError
from jointz.io.log_reader import read_log
from jointz.io.protocols import load_protocol
from jointz.results.estimates import relative_half_width
from jointz.rig.console.command import _arguments
from jointz.rig.live_estimates.follow import follow
from jointz.rig.live_estimates.live_estimate import estimate_so_far
from jointz.rig.session.command import RigOptions
from jointz.rig.session.live.live_session import LiveSession
from jointz.rig.session.rigs.rig_settings import open_rig, rig_settings
from jointz.rig.session.run_settings import LIVE_FILE, RunSettings
from jointz.tasks.process_pool import spawn_context

WISH = 30.0


def protocol():
    """Return walking with pulses at two timing points, without the conditions before it."""
    whole = load_protocol("walking_doublets")
    walking = whole.conditions[-1]
    fewer = walking.perturbations.model_copy(
        update={
            "timing_points": {"LRE": 7.0, "ISW": 68.5},
            "count_per_point": 8,
            "gap_strides": (2, 3),
        }
    )
    condition = walking.model_copy(update={"perturbations": fewer})
    wishes = {"stiffness": {"LRE": WISH}}
    changes = {"conditions": (condition,), "planned_half_width_pct": wishes}
    return whole.model_copy(update=changes)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A finished run with its settings and rig, whose session can be taken for a running one."""
    study = tmp_path_factory.mktemp("live") / "study"
    spec = protocol()
    jointz.run(spec, out=study, participants=1, seed=3, progress=False)
    return RunSettings(spec, 3, "real", study), rig_settings(spec, "sim", None, 3, None)


@pytest.fixture
def half(ran, tmp_path):
    """The same session as it was when half of its log was written."""
    settings, rig = ran
    study = tmp_path / "study"
    shutil.copytree(settings.study / "sessions", study / "sessions")
    session = study / "sessions" / "S01"
    (log,) = (session / "logs").iterdir()
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    last = int(read_log(log).records["slot"][-1])
    journal = session / "journal.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    kept = [x for x in lines if json.loads(x[: x.rindex("}") + 1]).get("slot", 0) <= last]
    journal.write_text("".join(x for x in kept if '"segment_started"' in x or '"slot"' in x))
    return replace(settings, study=study), rig


def test_at_the_end_it_is_what_the_analysis_gives(ran):
    settings, rig = ran
    analysis = jointz.analyze(settings.study, resamples=2, progress=False)
    posterior = analysis.log_posteriors[0]

    live = estimate_so_far(settings, open_rig(rig, 0))

    assert live.n_pulses == len(analysis.pulses)
    used = {cell.timing_point: cell.n_used for cell in analysis.cells}
    assert {v.timing_point: v.n_used for v in live.values} == used
    by_place = {(v.parameter, v.timing_point): v for v in live.values}
    assert len(by_place) == 6
    for estimate in ((c.timing_point, p) for c in analysis.cells for p in c.parameters):
        point, parameter = estimate
        value = by_place.get((parameter.name, point))
        if value is None or parameter.status != "ok":
            continue
        at = list(zip(posterior.parameters, posterior.timing_points, strict=True)).index(
            (parameter.name, point)
        )
        least = 100.0 * relative_half_width(float(posterior.sd[at]))
        assert least <= value.half_width_pct < 50.0
    wished = {(v.parameter, v.timing_point) for v in live.values if v.wish_pct == WISH}
    assert wished == {("stiffness", "LRE")}


def test_half_way_there_are_fewer_pulses_and_wider_intervals(ran, half):
    settings, rig = half
    whole = estimate_so_far(ran[0], open_rig(rig, 0))

    live = estimate_so_far(settings, open_rig(rig, 0))

    assert 4 <= live.n_pulses < whole.n_pulses
    assert 0.02 < live.minutes_per_pulse < 0.12
    for now, then in zip(live.values, whole.values, strict=True):
        assert now.n_used < then.n_used
        assert now.half_width_pct > then.half_width_pct


def test_a_process_beside_the_session_writes_what_its_page_shows(half):
    settings, rig = half
    context = spawn_context()
    ended = context.Event()
    _, questions = context.Pipe()
    args = (settings, rig, 0, ended, questions)
    process = context.Process(target=follow, args=args, daemon=True)
    file = settings.session_folder("S01") / LIVE_FILE

    process.start()
    until = time.monotonic() + 120.0
    while not file.exists() and time.monotonic() < until:
        time.sleep(0.2)
    ended.set()
    process.join(30.0)

    assert process.exitcode == 0
    page = LiveSession(settings.study, alive=lambda: True)
    page.poll()
    shown = page.status()["estimates"]
    assert shown == json.loads(file.read_text())
    assert shown["problem"] == ""
    assert {value["timing_point"] for value in shown["values"]} == {"LRE", "ISW"}


def test_a_run_with_it_records_the_same(ran, tmp_path):
    settings, _ = ran
    jointz.run(protocol(), out=tmp_path / "s", participants=1, seed=3, live=True, progress=False)

    for name in ("journal.jsonl", "plan.json", "logs/perturbed-0.jzlog"):
        before, now = (s / "sessions" / "S01" / name for s in (settings.study, tmp_path / "s"))
        assert now.read_bytes() == before.read_bytes()


@pytest.mark.parametrize(
    ("name", "more"), [("walking", {"workers": 2, "clock": "real"}), ("sea-mass-spring", {})]
)
def test_it_is_for_one_walking_participant_at_a_time(name, more, tmp_path):
    with pytest.raises(DataError, match="live: estimates during walking"):
        jointz.run(name, out=tmp_path / "s", live=True, progress=False, **more)
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("name", "live", "given"),
    [
        ("walking", True, ["--live"]),
        ("walking", False, ["--no-live"]),
        ("walking", None, []),
        ("sea-mass-spring", True, []),
    ],
)
def test_the_page_starts_sessions_with_it_unless_told_otherwise(name, live, given, tmp_path):
    arguments = _arguments(
        name, tmp_path, RigOptions(), participants=None, seed=None, live=live, calibration=None
    )
    assert [one for one in arguments if "live" in one] == given
