"""A limit of displacement in a walking session: torque, log, journal, and what is done again."""

from itertools import count

import numpy as np
import pytest

import jointz
from jointz.core.errors import SafetyStop
from jointz.core.limits import LimitsOverride, tightened
from jointz.core.protocols.pulse_models import SampledPulse
from jointz.core.session_log import Flag
from jointz.rig.experiment import trial
from jointz.rig.experiment.files.journal import Journal, pulses_done
from jointz.rig.experiment.gait import unperturbed_angle
from jointz.rig.session.session_check import missing_events

PERIOD_S = 0.002


@pytest.fixture
def walk(spied_session, short_walking, tmp_path):
    """Perturbed walking only, two pulses a point."""
    protocol = short_walking(conditions=["perturbed"], count_per_point=2, warm_up_strides=5)
    return spied_session(protocol, tmp_path)


@pytest.fixture
def limit_displacement(monkeypatch):
    """Set the limit below the protocol, whose own check asks for an expected joint."""

    def limit(rad):
        monkeypatch.setattr(
            "jointz.rig.experiment.session.limits_on_device",
            lambda _, own, **__: tightened(own, LimitsOverride(displacement_rad=rad)),
        )

    return limit


def cut_pulses(ticks):
    """Return first cut tick and end of each pulse that was cut."""
    number, cut = ticks["pulse"].astype(int), (ticks["flags"] & Flag.CUT) != 0
    begins = np.flatnonzero(cut & ~np.append(False, cut[:-1]))
    return [(at, at + int(np.argmax(number[at:] != number[at]))) for at in begins]


def test_pulses_that_go_too_far_are_cut_until_ten_in_a_row_end_the_session(
    walk, limit_displacement
):
    limit_displacement(0.02)
    with pytest.raises(SafetyStop, match=r"safety\.displacement_rad = 0\.02 rad\. Correct"):
        walk.run()
    ticks = walk.records()
    cuts = cut_pulses(ticks)
    assert len(cuts) >= 9  # the trial ends in the tick after the tenth
    for begin, end in cuts:
        assert not ticks["sent_torque"][begin:end].any()
    aborted = [e for e in walk.events() if e["event"] == "pulse_aborted"]
    assert len(aborted) == 10
    assert pulses_done(walk.events(), "perturbed") == {}
    # The log alone, as after a kill that took the journal, shows no pulse as done either.
    assert not [
        event
        for event in missing_events(walk.folder, walk.protocol, [])
        if event["event"] == "pulse_completed"
    ]


def test_a_knee_that_jumps_in_a_pulse_loses_its_torque_in_the_same_tick(
    walk, limit_displacement, monkeypatch
):
    limit_displacement(0.9)
    whole, jumped_s, pushed = trial.Streams.read, [], count(1)

    def read(self, slot_ns):
        age_s = whole(self, slot_ns)
        newest = walk.commands[-1][1] if walk.commands else "stop"
        in_pulse = newest != "stop" and newest > 15.0 and next(pushed) >= 20
        if (jumped_s or in_pulse) and (
            not jumped_s or walk.clock.now_ns() * 1e-9 < jumped_s[0] + 0.05
        ):
            jumped_s.append(walk.clock.now_ns() * 1e-9)
            self.newest_angle = self.newest_angle._replace(value=self.newest_angle.value + 1.0)
        return age_s

    monkeypatch.setattr(trial.Streams, "read", read)
    walk.run()
    before = [torque for t, torque in walk.commands if t < jumped_s[0] - 1e-9]
    after = [torque for t, torque in walk.commands if jumped_s[0] - 1e-9 <= t < jumped_s[0] + 0.15]
    assert before[-1] > 15.0
    assert set(after) == {0.0}
    (aborted,) = (e for e in walk.events() if e["event"] == "pulse_aborted")
    done = [e["pulse"] for e in walk.events() if e["event"] == "pulse_completed"]
    assert sorted(done) == list(range(1, 13))
    assert done[-1] == aborted["pulse"]


def test_no_pulse_begins_before_the_angle_without_it_is_known(
    spied_session, short_walking, tmp_path, limit_displacement, monkeypatch
):
    limit_displacement(0.9)
    # As it is, gait is not steady before the angle is known.
    monkeypatch.setattr(unperturbed_angle, "_FEWEST_STRIDES", 8)
    protocol = short_walking(conditions=["perturbed"], count_per_point=1, warm_up_strides=0)
    walk = spied_session(protocol, tmp_path)
    walk.run()
    missed = {e["reason"] for e in walk.events() if e["event"] == "pulse_missed"}
    assert "unperturbed angle not known yet" in missed
    assert len(pulses_done(walk.events(), "perturbed")) == 6


def test_a_limit_that_no_pulse_reaches_changes_nothing(
    walk, spied_session, tmp_path, limit_displacement
):
    walk.run()
    other = spied_session(walk.protocol, tmp_path / "limited")
    limit_displacement(1.0)
    other.run()
    mine, theirs = walk.records(), other.records()
    fields = [n for n in mine.dtype.names if n not in ("host_time_ns", "busy_us", "crc")]
    for name in fields:
        np.testing.assert_array_equal(mine[name], theirs[name], err_msg=name)


@pytest.fixture
def walk_with_zero(spied_session, short_walking, tmp_path):
    """Two pulses a point, each with zero torque in its middle; no more are allowed."""
    there_and_back = SampledPulse(
        kind="samples",
        name="there and back",
        amplitudes_nm=[10.0],
        times_s=[0.0, 0.05, 0.06, 0.12, 0.13, 0.2],
        shares=[1.0, 1.0, 0.0, 0.0, -1.0, -1.0],
    )
    protocol = short_walking(conditions=["perturbed"], count_per_point=2, warm_up_strides=5)
    changed = {"pulse": None, "pulses": (there_and_back,)}
    safety = protocol.safety.model_copy(update={"pulse_count": 12})
    return spied_session(protocol.model_copy(update={**changed, "safety": safety}), tmp_path)


def test_a_pulse_that_passes_through_zero_counts_once(walk_with_zero):
    walk_with_zero.run()
    assert len(pulses_done(walk_with_zero.events(), "perturbed")) == 12


def test_a_pulse_that_is_faded_stays_at_zero_when_its_torque_comes_back(
    walk_with_zero, monkeypatch
):
    whole, faded_slots = trial.GaitWatch.update, []

    def update(self, slot_ns, *samples):
        stride = whole(self, slot_ns, *samples)
        commanded = walk_with_zero.commands[-1:]
        if not faded_slots and commanded and commanded[0][1] > 5.0:
            faded_slots.append(slot_ns)
        # Gait is steady again before the pulse goes on.
        if faded_slots and slot_ns < faded_slots[0] + 80_000_000:
            self.steady = False
        return stride

    monkeypatch.setattr(trial.GaitWatch, "update", update)
    with pytest.raises(SafetyStop, match="limit 12"):  # it is done again, as a thirteenth
        walk_with_zero.run()
    ticks = walk_with_zero.records()
    faded = ticks["pulse"] == ticks["pulse"][(ticks["flags"] & Flag.FADING) != 0][0]
    first = np.flatnonzero(faded)[: round(0.2 / PERIOD_S)]
    assert np.all(np.abs(ticks["sent_torque"][first][round(0.13 / PERIOD_S) :]) < 2.0)


@pytest.fixture
def too_soft_at_tst(limit_displacement, monkeypatch):
    """A knee that every pulse at TST moves too far."""
    limit_displacement(0.9)

    def displacement(self, slot_ns):
        del slot_ns
        pulse = self._pulses and self._pulses.active
        return None if pulse is None else 2.0 if pulse.timing_point == "TST" else 0.0

    monkeypatch.setattr(trial.Trial, "_displacement", displacement)


@pytest.mark.parametrize(
    "writes", [None, 16, *(pytest.param(n, marks=pytest.mark.slow) for n in (6, 24, 26))]
)
@pytest.mark.usefixtures("too_soft_at_tst")
def test_withdrawn_pulses_stay_so_when_a_session_is_resumed(
    short_walking, tmp_path, monkeypatch, writes
):
    points = {"LRE": 7.0, "TST": 40.5, "ISW": 68.5}
    protocol = short_walking(conditions=["perturbed"], count_per_point=4, timing_points=points)
    out = tmp_path / "study"
    if writes is not None:  # as a kill: nothing is written after so many events
        write, counted = Journal.write, count(1)

        def killed(self, event, **details):
            if next(counted) >= writes:
                raise KeyboardInterrupt
            write(self, event, **details)

        with monkeypatch.context() as patch:
            patch.setattr(Journal, "write", killed)
            with pytest.raises(KeyboardInterrupt):
                jointz.run(protocol, out=out, seed=5)
    report = jointz.run(protocol, out=out, seed=5, resume=writes is not None).report
    rows = report.to_frame().set_index("timing_point")
    assert rows[["planned", "completed", "withdrawn"]].to_numpy().tolist() == [
        [4, 4, 0],
        [4, 0, 4],
        [4, 4, 0],
    ]
    assert "4 pulses were withdrawn, because" in report.summary()
