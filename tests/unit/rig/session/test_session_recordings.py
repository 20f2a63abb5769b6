"""Recordings out of raw logs: stretches, clocks, rates, holes and pulses."""

import json

import numpy as np
import pytest

from jointz.core.protocols.protocol_models import ConditionSpec
from jointz.core.recording import history_of
from jointz.core.session_log import NO_SAMPLE, WALKING, Flag
from jointz.gait.timestamps import find_gaps
from jointz.io.protocols import load_protocol
from jointz.rig.experiment.files.journal import Journal, read_journal
from jointz.rig.experiment.files.recorder import Recorder
from jointz.rig.experiment.files.session_files import log_path
from jointz.rig.experiment.plan import PlannedPulse
from jointz.rig.session.session_recordings import WalkingRecordings

MS = 1_000_000
PERIOD = 2 * MS
PROTOCOL = load_protocol("walking")
PLAN = (
    PlannedPulse(1, "LRE", 7.0, 17.0, 3),
    PlannedPulse(2, "MST", 21.5, 0.0, 3),
    PlannedPulse(3, "TST", 40.5, -17.0, 3),
)
EMPTY = {
    field.name: float("nan") if field.code in "df" else 0 for field in WALKING.fields
} | dict.fromkeys(
    (field.name for field in WALKING.fields if field.name.endswith("_time_ns")), NO_SAMPLE
)


def angle_of(time_ns):
    return 1e-3 * time_ns / MS


def switch_of(time_ns):
    return float(time_ns // (50 * MS) % 2)


class Stream:
    """A device of a fake session: when it samples, by which clock, and what the host misses."""

    def __init__(self, period_ns=PERIOD, *, clock_ns=0, way_ns=0, lost=(), phase_ns=0, fast=0.0):
        self.period_ns, self.clock_ns, self.way_ns = period_ns, clock_ns, way_ns
        self.fast = fast
        self.lost, self._next_ns = set(lost), phase_ns
        self._number = -1

    def clock(self, true_ns):
        """Return what the device's own clock shows."""
        return true_ns + self.clock_ns + round(true_ns * self.fast)

    def until(self, host_ns):
        """Return the true times of the samples that reached the host by then."""
        found = []
        while self._next_ns + self.way_ns <= host_ns:
            self._number += 1
            if self._number not in self.lost:
                found.append(self._next_ns)
            self._next_ns += self.period_ns
        return found


class Session:
    """A session folder with logs of nothing but what a test needs."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "logs").mkdir()
        self.journal = folder / "journal.jsonl"

    def event(self, name, **details):
        with Journal(self.journal) as journal:
            journal.write(name, condition="perturbed", **details)

    def stretch(
        self, segment, ticks, *, actuator=None, angle=None, contact=None, pulses=(), late_ns=0
    ):
        """Write a log of so many ticks; pulses are (first slot, slot after, number)."""
        actuator, angle, contact = (s or Stream() for s in (actuator, angle, contact))
        self.event("segment_started", segment=segment)
        with Recorder(
            log_path(self.folder, "perturbed", segment),
            {"condition": "perturbed", "segment": segment, "control_hz": 500.0},
            WALKING,
        ) as log:
            for slot in range(ticks):
                host_ns = slot * PERIOD
                number = next((p for first, after, p in pulses if first <= slot < after), 0)
                tick = {
                    "host_time_ns": host_ns + late_ns,
                    "slot": slot,
                    "pulse": number,
                    "command": PLAN[number - 1].amplitude_nm if number else 0.0,
                    "flags": int(Flag.SHAM) if number and PLAN[number - 1].sham else 0,
                }
                log.write(*self._parts(tick, host_ns, actuator, angle, contact))

    @staticmethod
    def _parts(tick, host_ns, actuator, angle, contact):
        a, g, c = (stream.until(host_ns) for stream in (actuator, angle, contact))
        for part in range(max(1, len(a), len(g), len(c))):
            row = EMPTY | tick | {"part": part}
            if part < len(a):
                row |= {"actuator_time_ns": actuator.clock(a[part]), "current": 2.0}
                row |= {"motor_angle": angle_of(a[part]), "motor_velocity": 0.5}
                row |= {"applied_torque": 1.5, "voltage": 48.0, "temperature_c": 30.0}
            if part < len(g):
                row |= {"angle_sensor_time_ns": angle.clock(g[part])}
                row |= {"angle": angle_of(g[part])}
            if part < len(c):
                row |= {"contact_time_ns": contact.clock(c[part])}
                row |= {"contact": switch_of(c[part])}
            yield tuple(row.values())

    def record(self, condition="perturbed"):
        spec = ConditionSpec(name="perturbed", condition=condition, prompt="Walk.", strides=10)
        events, plans = read_journal(self.journal), {"perturbed": PLAN}
        return WalkingRecordings(self.folder, "S01", PROTOCOL, events, plans).record(spec)


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path)


def seconds(record):
    return record.recording["time"].to_numpy()


def values(record, name):
    return record.recording[name].to_numpy()


# --- streams ------------------------------------------------------------------------------------


def test_the_recording_says_whose_it_is_and_where_it_came_from(session):
    session.stretch(0, 10)
    recording = session.record().recording
    assert recording.attrs["participant"] == "S01"
    assert recording.attrs["joint"] == "knee"
    assert recording.attrs["contact_kind"] == "contact"
    assert recording["applied_torque"].attrs["units"] == "N*m"
    (entry,) = history_of(recording)
    assert entry["logs"] == ["perturbed-0.jzlog"]
    assert len(entry["sha256"][0]) == 64


@pytest.mark.parametrize("clock_ns", [0, -7 * 10**9, 1_700_000_000 * 10**9 + 12_345])
def test_a_sensor_with_a_clock_of_its_own_is_placed_by_the_host(session, clock_ns):
    session.stretch(0, 500, angle=Stream(clock_ns=clock_ns), contact=Stream(clock_ns=-clock_ns))
    record = session.record()
    time_ns = np.arange(500) * PERIOD
    np.testing.assert_allclose(seconds(record), time_ns * 1e-9, atol=1e-12)
    for name in ("angle", "motor_angle"):
        np.testing.assert_array_equal(values(record, name), angle_of(time_ns))
    np.testing.assert_array_equal(values(record, "contact"), time_ns // (50 * MS) % 2)


def test_a_slower_angle_is_drawn_by_straight_lines_and_a_slower_contact_holds(session):
    session.stretch(0, 500, angle=Stream(10 * MS), contact=Stream(10 * MS))
    record = session.record()
    time_ns = np.arange(500) * PERIOD
    inside = time_ns <= 990 * MS
    np.testing.assert_allclose(
        values(record, "angle")[inside], angle_of(time_ns)[inside], atol=1e-9
    )
    held = (time_ns // (10 * MS) * 10 * MS) // (50 * MS) % 2
    np.testing.assert_array_equal(values(record, "contact")[inside], held[inside])
    assert np.isnan(values(record, "angle")[~inside]).all()  # nothing is known after its last


def test_without_the_device_the_goniometer_gives_the_times(session):
    session.stretch(0, 200, actuator=Stream(10**12, phase_ns=10**12))
    record = session.record("no_device")
    assert set(record.recording.data_vars) == {"angle", "contact"}
    np.testing.assert_allclose(seconds(record), np.arange(200) * 0.002, atol=1e-12)


def test_what_a_sensor_lost_is_missing_and_not_filled(session):
    holes = [40, *range(50, 90)]
    session.stretch(0, 100, angle=Stream(lost=holes), contact=Stream(lost={60}))
    record = session.record()
    assert np.flatnonzero(np.isnan(values(record, "angle"))).tolist() == holes
    assert np.flatnonzero(np.isnan(values(record, "contact"))).tolist() == [60]


def test_a_hole_of_the_actuator_is_a_gap_in_time(session):
    session.stretch(0, 1000, actuator=Stream(lost=range(300, 420)))
    record = session.record()
    assert seconds(record).size == 880
    assert find_gaps(seconds(record)) == pytest.approx(np.array([[0.598, 0.84]]))
    assert np.isfinite(values(record, "angle")).all()


def test_a_sensor_that_never_gave_a_sample_is_missing_throughout(session):
    session.stretch(0, 100, contact=Stream(10**12, phase_ns=10**12))
    assert np.isnan(values(session.record(), "contact")).all()


def test_a_clock_that_runs_at_another_rate_is_followed(session):
    ppm, ticks = -100.0, 30_000  # a minute; 100 ppm are 6 ms by then
    session.stretch(0, ticks, angle=Stream(fast=ppm * 1e-6, clock_ns=5 * 10**9, way_ns=300_000))
    record = session.record()
    true_ms = np.arange(ticks) * PERIOD / MS
    late_ms = 1e3 * (true_ms * 1e-3 - values(record, "angle"))
    # A sample reaches a tick up to a period late: that much is not known.
    assert np.nanmax(np.abs(late_ms - np.nanmedian(late_ms))) < 0.1
    assert np.abs(np.nanmedian(late_ms)) < 2.1
    clocks = json.loads(record.recording.attrs["history"])[0]["clocks"][0]
    assert clocks["angle"]["drift_ppm"] == pytest.approx(-ppm, abs=1.0)
    assert clocks["actuator"]["drift_ppm"] == 0.0


def test_samples_of_a_clock_that_stands_still_are_left_out_and_counted(session):
    class Standing(Stream):
        def clock(self, true_ns):
            return 99 * PERIOD if 100 * PERIOD <= true_ns < 103 * PERIOD else true_ns

    session.stretch(0, 400, actuator=Standing(), pulses=[(50, 175, 1), (200, 325, 3)])
    for slot, pulse in ((50, 1), (200, 3)):
        session.event("pulse_completed", segment=0, pulse=pulse, onset_slot=slot)
    record = session.record()
    assert seconds(record).size == 397
    assert (np.diff(seconds(record)) > 0).all()
    assert record.pulses["onset_s"].tolist() == pytest.approx([0.1, 0.4])
    clocks = json.loads(record.recording.attrs["history"])[0]["clocks"][0]
    assert clocks["actuator"]["repeated_samples"] == 3


def test_a_command_belongs_to_the_last_sample_that_came_with_its_tick(session):
    session.stretch(0, 100, actuator=Stream(MS), pulses=[(50, 80, 1)])
    record = session.record()
    commanded = seconds(record)[values(record, "command") != 0.0]
    assert commanded[0] == pytest.approx(0.1)
    assert record.pulses["onset_s"].tolist() == pytest.approx([0.1])


# --- stretches ----------------------------------------------------------------------------------


def test_stretches_follow_one_another_with_a_hole_between(session):
    session.stretch(0, 500)
    session.stretch(1, 300)
    record = session.record()
    assert seconds(record).size == 800
    assert find_gaps(seconds(record)) == pytest.approx(np.array([[0.998, 10.998]]))
    assert [s.offset_s for s in record.stretches] == pytest.approx([0.0, 10.998])
    assert len(record.logs) == 2


def test_a_stretch_of_a_device_that_ran_on_begins_ten_seconds_later_all_the_same(session):
    day_ns = 86_400 * 10**9
    session.stretch(0, 100, actuator=Stream(clock_ns=day_ns))
    session.stretch(1, 100, actuator=Stream(clock_ns=2 * day_ns))
    record = session.record()
    assert seconds(record)[[0, 99, 100]] == pytest.approx([0.0, 0.198, 10.198])
    assert [s.offset_s for s in record.stretches] == pytest.approx(
        [-86_400.0, 10.198 - 2 * 86_400.0]
    )


def test_a_stretch_that_ended_before_its_first_sample_keeps_its_place(session):
    session.stretch(0, 100)
    session.stretch(1, 0)
    session.stretch(2, 100, pulses=[(10, 60, 1)])
    session.event("pulse_completed", segment=2, pulse=1, onset_slot=10)
    record = session.record()
    assert len(record.logs) == 3
    assert [s.segment for s in record.stretches] == [0, 2]
    assert record.stretches[1].offset_s == pytest.approx(10.198)
    assert record.pulses["onset_s"].tolist() == pytest.approx([10.198 + 0.02])
    assert record.pulses["completed"].tolist() == [True]


# --- pulses -------------------------------------------------------------------------------------


def test_pulses_come_from_the_log_with_their_time_and_shape(session):
    session.stretch(0, 600, pulses=[(50, 175, 1), (300, 425, 3)])
    session.event("pulse_completed", segment=0, pulse=1, onset_slot=50)
    session.event("pulse_completed", segment=0, pulse=3, onset_slot=300)
    pulses = session.record().pulses
    assert pulses["pulse"].tolist() == [1, 3]
    assert pulses["onset_s"].tolist() == pytest.approx([0.1, 0.6])
    assert pulses["duration_s"].tolist() == pytest.approx([0.25, 0.25])
    assert pulses["amplitude_nm"].tolist() == [17.0, -17.0]
    assert pulses["timing_point"].tolist() == ["LRE", "TST"]
    assert pulses["completed"].tolist() == [True, True]


def test_shams_are_left_out(session):
    session.stretch(0, 400, pulses=[(50, 175, 2)])
    session.event("pulse_completed", segment=0, pulse=2, onset_slot=50)
    record = session.record()
    assert record.pulses.empty
    assert list(record.pulses.columns)[:2] == ["pulse", "onset_s"]
    assert not values(record, "command").any()


def test_a_pulse_broken_off_and_done_again_is_there_twice_and_completed_once(session):
    session.stretch(0, 600, pulses=[(50, 175, 1), (300, 425, 1)])
    session.event("pulse_aborted", segment=0, pulse=1)
    session.event("pulse_completed", segment=0, pulse=1, onset_slot=300)
    pulses = session.record().pulses
    assert pulses["completed"].tolist() == [False, True]


def test_a_pulse_that_a_crash_ended_lasts_to_the_end_of_its_stretch(session):
    session.stretch(0, 100, pulses=[(50, 175, 1)])
    session.stretch(1, 300, pulses=[(50, 175, 1)])
    session.event("pulse_completed", segment=1, pulse=1, onset_slot=50)
    pulses = session.record().pulses
    assert pulses["completed"].tolist() == [False, True]
    assert pulses["onset_s"].tolist() == pytest.approx([0.1, 10.198 + 0.1])
    assert pulses["duration_s"].tolist() == pytest.approx([0.098, 0.25])


def test_a_crash_in_the_very_tick_of_an_onset_leaves_a_pulse_of_no_length(session):
    session.stretch(0, 51, pulses=[(50, 175, 1)])
    pulses = session.record().pulses
    assert pulses["duration_s"].tolist() == [0.0]
    assert pulses["completed"].tolist() == [False]


@pytest.mark.parametrize("first", [50, 51, 52, 53, 54])
def test_onset_follows_the_newest_sample_of_a_slower_actuator(session, first):
    session.stretch(0, 400, actuator=Stream(10 * MS), pulses=[(first, first + 125, 1)])
    session.event("pulse_completed", segment=0, pulse=1, onset_slot=first)
    pulses = session.record().pulses
    assert pulses["completed"].tolist() == [True]
    onset_s = 0.002 * first
    assert onset_s - 0.01 < pulses["onset_s"][0] <= onset_s + 1e-12
    assert pulses["duration_s"][0] == pytest.approx(0.25)


def test_a_sample_lost_in_the_tick_of_the_onset_does_not_make_the_pulse_undone(session):
    session.stretch(0, 400, actuator=Stream(lost={50}), pulses=[(50, 175, 1)])
    session.event("pulse_completed", segment=0, pulse=1, onset_slot=50)
    pulses = session.record().pulses
    assert pulses["completed"].tolist() == [True]
    assert pulses["onset_s"].tolist() == pytest.approx([0.1])
