"""A session as it runs, followed through its files alone: what an operator's page shows.

Nothing here can hold up the loop: its log and journal are read, never asked for.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.core.gait_phases import phase_difference
from jointz.rig.experiment.files.session_files import (
    CONTROL_FILE,
    JOURNAL_FILE,
    PLAN_FILE,
    SESSION_FILE,
    log_path,
)
from jointz.rig.experiment.files.whole_files import read_object, read_twice
from jointz.rig.session.live.live_motion import TRACES, Motion, StartedPulse
from jointz.rig.session.live.live_progress import SessionProgress
from jointz.rig.session.live.live_tail import JournalTail, LogTail
from jointz.rig.session.run_claim import RUN_FILE, STUDY_FILE
from jointz.rig.session.run_settings import LIVE_FILE, SESSIONS

#: States in which the session's process is needed.
_UNDER_WAY = frozenset({"idle", "waiting", "starting", "running", "paused", "stopping", "between"})
#: States in which no device may be on.
_AT_REST = frozenset({"waiting", "stopped", "tripped", "failed", "between"})
#: What a process writes first for whoever watches.
_BEGINNINGS = frozenset({"prompted", "segment_started"})
#: A loop that writes nothing for so long while it runs is dead or hangs.
SILENT_AFTER_S = 2.0
_LOCKS = Path("/proc/locks")


def is_held(study: Path) -> bool:
    """Tell whether a process runs a study, without taking its lock for a moment even.

    False where the system does not tell who holds what: :func:`refuse_where_unseen`.
    """
    return holder_of(study) is not None


def holder_of(study: Path) -> int | None:
    """Return the number of the process that runs a study, None where none is seen."""
    try:
        inode = (study / RUN_FILE).stat().st_ino
        lines = _LOCKS.read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    # "1: FLOCK ADVISORY WRITE process device:inode 0 EOF"; one that waits for it has "->". By the
    # inode alone: some file systems tell the kernel of another device than they tell us.
    locks = (line.split() for line in lines if "FLOCK" in line and "->" not in line)
    return next((int(f[4]) for f in locks if any(one.endswith(f":{inode}") for one in f)), None)


def refuse_where_unseen() -> None:
    """Refuse to follow sessions where nothing tells whether they run."""
    if not _LOCKS.exists():
        raise DataError(
            f"{_LOCKS}: not there, and nothing else tells whether a session runs. Follow it on "
            "Linux; jointz run itself needs no page."
        )


class LiveSession:
    """The session of a study that was written to last."""

    def __init__(self, study: Path, *, alive: Callable[[], bool] | None = None) -> None:
        self.study = study
        self.generation = 0
        self._alive = alive or (lambda: is_held(study))
        self._folder: Path | None = None
        self._protocol: dict[str, Any] = {}
        self._journal: JournalTail | None = None
        self._progress: SessionProgress | None = None
        self._log: LogTail | None = None
        self._of_log: tuple[str, int] | None = None
        self._motion: Motion | None = None
        self._onsets: dict[str, dict[tuple[int, int], StartedPulse]] = {}
        self._estimate: dict[str, Any] = {}
        self._estimate_of: tuple[Path, int] | None = None  # file, and when it was written
        self._grew_s = time.monotonic()
        self._paused_at, self._paused_strides = -1, 0
        #: Whether its process was seen gone, and what stands in the journal is of that one.
        self._was_gone = self._is_over = not self._alive()

    @property
    def folder(self) -> Path | None:
        """The folder of the session, None before there is one."""
        return self._folder

    def poll(self) -> None:
        """Read what was written since the last poll."""
        # Looked for before the journal is read: what it confirmed last is then taken in.
        alive = self._alive()
        self._is_over = not alive
        self._was_gone = self._was_gone or not alive
        newest = newest_session(self.study)
        if newest is None:
            return
        if newest != self._folder:
            self._open(newest)
        if self._journal is None or self._progress is None:
            return
        events = self._journal.poll()
        self._is_over = not alive and not events
        for event in events:
            self._progress.take(event)
            self._follow_pause(event["event"])
            if event["event"] in _BEGINNINGS and alive:
                self._was_gone = False
        self._follow_log()

    def _open(self, folder: Path) -> None:
        """Begin with another participant, when what was planned is written down."""
        try:
            plan, about = read_twice(folder / PLAN_FILE)[0], read_twice(folder / SESSION_FILE)[0]
        except DataError:  # not yet; both are written before anybody is prompted
            return
        self._folder, self._protocol = folder, about["protocol"]
        self._journal = JournalTail(folder / JOURNAL_FILE)
        self._progress = SessionProgress(plan)
        self._log = self._motion = self._of_log = None
        self._onsets = {}
        self.generation += 1

    def _follow_log(self) -> None:
        progress = self._progress
        if progress is None or self._folder is None:
            return
        stretch = (progress.condition, progress.segment)
        if progress.segment >= 0 and stretch != self._of_log:
            self._of_log, self._motion = stretch, None
            self._log = LogTail(log_path(self._folder, *stretch))
            self._grew_s = time.monotonic()
            self._paused_at, self._paused_strides = -1, 0
        if self._log is None:
            return
        records = self._log.poll()
        if self._motion is None and self._log.header:
            self._motion = Motion(self._log.header)
            self.generation += 1
        if self._motion is not None and records.size:
            self._motion.take(records)
            self._grew_s = time.monotonic()
            self._keep_onsets(self._motion, stretch)

    def _keep_onsets(self, motion: Motion, stretch: tuple[str, int]) -> None:
        onsets = self._onsets.setdefault(self._of_log[0] if self._of_log else stretch[0], {})
        for pulse in motion.pulses:
            onsets[(stretch[1], pulse.number)] = pulse

    def _follow_pause(self, event: str) -> None:
        strides = self._motion.strides if self._motion else 0
        if event == "paused":
            self._paused_at = strides
        elif event == "went_on" and self._paused_at >= 0:
            self._paused_strides += strides - self._paused_at
            self._paused_at = -1

    @property
    def state(self) -> str:
        """Where the session is.

        ``idle`` before it begins, ``waiting`` for a start, ``starting``, ``running``,
        ``paused``, ``stopping``, ``writing`` the study, ``silent`` when it should run and
        writes nothing, and, when its process is gone, ``stopped``, ``tripped``, ``failed`` or
        ``done``.
        """
        told = self._progress.state if self._progress else "idle"
        alive = not self._is_over
        if alive and self._was_gone:
            return "starting"  # taken up again, and has not written anything yet
        if told not in _UNDER_WAY:
            return told
        if not alive:
            if told in ("idle", "between") and (self.study / STUDY_FILE).exists():
                return "done"
            if told == "stopping" and self.unconfirmed:
                return "failed"
            return {"idle": "idle", "stopping": "stopped"}.get(told, "failed")
        if told == "between":
            return "writing"
        return "starting" if told == "idle" else self._moving(told)

    @property
    def unconfirmed(self) -> str:
        """The stretch that ended without a word that its devices stopped; empty where none did."""
        progress = self._progress
        if progress is None:
            return ""
        # One that was taken up again changes nothing before it starts.
        if not (self._is_over or self._was_gone or progress.state in _AT_REST):
            return ""
        opening = progress.state == "starting"  # devices are opened; nothing tells how far it came
        return progress.unconfirmed or (progress.condition if opening else "")

    def _moving(self, told: str) -> str:
        """Return the state of a session whose process lives, by what its loop writes."""
        if told not in ("running", "paused", "stopping"):
            return told
        if self._motion is None or self._motion.ticks == 0:
            return "starting" if told == "running" else told  # devices take their time
        over = told == "stopping" and self._motion.torque_is_off
        if not over and time.monotonic() - self._grew_s > SILENT_AFTER_S:
            return "silent"
        return told

    def rows_after(self, number: int) -> tuple[np.ndarray, int]:
        """Return the rows of the traces that came after one, as far as they are kept."""
        if self._motion is None:
            return np.empty((0, 1 + len(TRACES))), 0
        rows, count = self._motion.rows, self._motion.count
        new = min(max(count - number, 0), rows.shape[0])
        return rows[rows.shape[0] - new :], count

    def strikes_s(self) -> list[float]:
        """Return the heel strikes of the last seconds, s since the stretch began."""
        if self._motion is None or not self._motion.rows.size:
            return []
        since = self._motion.rows[0, 0]
        return [round(at, 3) for at in self._motion.strikes_s if at >= since]

    def status(self) -> dict[str, Any]:
        """Return everything but the traces, as plain values."""
        progress, motion = self._progress, self._motion
        told: dict[str, Any] = {
            "study": self.study.name,
            "state": self.state,
            "protocol": self._protocol.get("title", ""),
            "kind": self._protocol.get("kind", "walking"),
            "without_console": self._protocol.get("without_console", "go_on"),
            "participant": self._folder.name if self._folder else "",
        }
        if progress is None:
            return told
        told |= {
            "condition": progress.condition,
            "prompt": progress.prompt,
            "reason": progress.reason,
            "unconfirmed": self.unconfirmed,
            "conditions": self._conditions(progress),
            "told": list(progress.told)[-40:],
            **self._of_trial(progress),
            "estimates": self._estimates(),
        }
        if motion is not None and self._log is not None:
            device = self._log.header.get("devices", {}).get("actuator") or {}
            told |= {
                "loop": motion.loop() | {"damaged": self._log.damaged},
                "device": motion.device(),
                "limits": self._limits(device.get("limits", {})),
                "flags": motion.flags(),
                "faults": _names_of(motion.faults(), device.get("fault_names", {})),
                "strides": motion.strides,
            }
        return told

    def _estimates(self) -> dict[str, Any]:
        """Return the newest live estimate, read where it has changed; empty without one."""
        if self._folder is None:
            return {}
        file = self._folder / LIVE_FILE
        try:
            written = file, file.stat().st_mtime_ns
            if written != self._estimate_of:
                self._estimate, self._estimate_of = read_object(file), written
        except (DataError, OSError):  # not there yet; it is replaced whole: somebody else wrote it
            return {}
        return self._estimate

    def _of_trial(self, progress: SessionProgress) -> dict[str, Any]:
        trial = progress.trial(progress.condition)
        spec = self._spec(progress.condition)
        points = (spec.get("perturbations") or {}).get("timing_points") or {}
        return {
            "points": trial.points(),
            "timing_points": points,
            "planned": len(trial.planned) - len(trial.withdrawn),
            "done": len(trial.done),
            "missed": trial.missed,
            "aborted": trial.aborted,
            "withdrawn": len(trial.withdrawn),
            "strides_planned": spec.get("strides"),
            "duration_s": spec.get("duration_s"),
            "controller": progress.controller,
            "next": self._next(progress, spec),
            "newest_pulse": self._newest_pulse(trial.planned),
            "onset_errors": self._onset_errors(progress.condition, points, trial.planned),
        }

    def _next(self, progress: SessionProgress, spec: dict[str, Any]) -> dict[str, Any] | None:
        """Return the pulse that is due next and in how many strides, as far as can be told."""
        pulse = progress.trial(progress.condition).next_pulse()
        if pulse is None:
            return None
        told = {"point": pulse["timing_point"], "amplitude_nm": pulse["amplitude_nm"]}
        motion = self._motion
        if "gap_strides" not in pulse or motion is None or progress.segment < 0:
            return told
        waited = motion.strides - self._paused_strides
        if motion.pulses:
            left = pulse["gap_strides"] - (waited - motion.pulses[-1].stride)
        else:
            warm_up = (spec.get("perturbations") or {}).get("warm_up_strides", 0)
            left = warm_up + pulse["gap_strides"] - waited
        return told | {"in_strides": max(left, 0)}

    def _newest_pulse(self, planned: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
        """Return the pulse that began last in the stretch, None before there is one."""
        if self._motion is None or not self._motion.pulses:
            return None
        number = self._motion.pulses[-1].number
        pulse = next((one for one in planned if one["number"] == number), None)
        if pulse is None:
            return None
        about = {"number": number, "shape": pulse.get("shape", "")}
        return about | {"point": pulse["timing_point"], "amplitude_nm": pulse["amplitude_nm"]}

    def _onset_errors(
        self, condition: str, points: dict[str, float], planned: Any
    ) -> list[dict[str, Any]]:
        """Return where in their strides pulses began, achieved minus planned, % of the cycle."""
        names = {pulse["number"]: pulse["timing_point"] for pulse in planned}
        errors = []
        for pulse in self._onsets.get(condition, {}).values():
            point = names.get(pulse.number)
            if pulse.onset_pct is not None and point in points:
                error = phase_difference(pulse.onset_pct, points[point])
                errors.append({"point": point, "error_pct": round(error, 2)})
        return errors

    def _conditions(self, progress: SessionProgress) -> list[dict[str, Any]]:
        rows = []
        for spec in self._protocol.get("conditions", ()):
            names = _trial_names(spec)
            done = sum(n in progress.trials and progress.trials[n].completed for n in names)
            now = progress.condition in names
            rows.append({"name": spec["name"], "trials": len(names), "done": done, "now": now})
        return rows

    def _spec(self, condition: str) -> dict[str, Any]:
        specs = self._protocol.get("conditions", ())
        return next((dict(one) for one in specs if condition in _trial_names(one)), {})

    def _limits(self, own: dict[str, Any]) -> dict[str, Any]:
        tightened = self._protocol.get("safety") or {}
        return own | {name: value for name, value in tightened.items() if value is not None}


def newest_session(study: Path) -> Path | None:
    """Return the session whose journal was written to last, None before there is one."""
    sessions: list[tuple[float, Path]] = []
    for journal in (study / SESSIONS).glob(f"*/{JOURNAL_FILE}"):
        try:
            sessions.append((journal.stat().st_mtime, journal.parent))
        except OSError:  # gone in between
            continue
    return max(sessions)[1] if sessions else None


def control_files(study: Path) -> list[Path]:
    """Return the control files of a study: of the session that runs, and of killed ones."""
    return sorted((study / SESSIONS).glob(f"*/{CONTROL_FILE}"))


def _trial_names(spec: dict[str, Any]) -> list[str]:
    trials = spec.get("trials", 1)
    name = spec["name"]
    return [name] if trials == 1 else [f"{name}-{k}" for k in range(1, trials + 1)]


def _names_of(bits: int, names: dict[str, str]) -> list[str]:
    return [names.get(str(1 << k), f"bit {k}") for k in range(bits.bit_length()) if bits & (1 << k)]
