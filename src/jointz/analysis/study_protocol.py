"""The protocol of a walking study, as a simulated person can walk it."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from jointz.analysis.participant_jobs import read_participant
from jointz.core.channels import MOTION_SENSORS
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord, StrideRecord
from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.pulse_models import (
    DoubletPulse,
    NamedPulse,
    SampledPulse,
    TrapezoidPulse,
)
from jointz.core.study import Study
from jointz.gait.timestamps import rate_hz
from jointz.identify.preparation.sources import RecordingInput

#: Commands closer than this are equal: relative size, and time.
_SAME_SIZE, _SAME_SIZE_NM, _SAME_S = 0.1, 0.5, 0.01
#: Kinds of pulse with less than this share of all pulses are left out.
_RARE = 0.02
_MOST_KINDS = 16
_MOST_AVERAGED, _BEFORE_S = 40, 0.05
#: A torque below this share of the first level is a second level.
_SECOND_LEVEL, _FULL_LEVEL = -0.3, -0.5
_LATE_S = 0.04
_MOST_ROWS = 500
#: Rates that the simulation can have, Hz; another one otherwise.
_RATES_HZ, _OTHER_RATE_HZ = (200.0, 1000.0), 500.0
_LONGEST_GAP_STRIDES = 60.0


@dataclass(frozen=True, slots=True)
class StudyProtocol:
    """Pulses, strides and sensors of a study, the same for all simulated people."""

    pulses: tuple[NamedPulse, ...]  # each kind with its one size and direction
    timing_points: dict[str, float]  # timing point -> % of the gait cycle
    per_point: dict[str, int]  # timing point -> pulses of a person
    gap_strides: tuple[int, int]  # fewest and most strides from one pulse to the next
    unperturbed_strides: int  # of the walk without pulses; 0 for none
    rate_hz: float
    sensors: tuple[str, ...]  # channels beside the angle

    @property
    def text(self) -> str:
        """Description of the simulated protocol."""
        kinds = ", ".join(map(_described, self.pulses))
        points = ", ".join(
            f"{name} {at:.3g} % ({self.per_point[name]} pulses)"
            for name, at in self.timing_points.items()
        )
        low, high = self.gap_strides
        return (
            f"{kinds}; at {points}; {low} to {high} strides from pulse to pulse; "
            f"{self.unperturbed_strides} unperturbed strides; "
            f"{', '.join(('goniometer', *self.sensors))} at {self.rate_hz:g} Hz."
        )


def study_protocol(
    study: Study,
    pulses: Sequence[PulseRecord],
    strides: Sequence[StrideRecord],
    *,
    asked_by: str = "certify",
) -> StudyProtocol:
    """Return the protocol that is nearest to the pulses of a study; errors name who asked.

    Every kind of pulse (shape, size and direction) is fired equally often at every timing point;
    timing points have their mean onset and number of used pulses.
    """
    used = [p for p in pulses if not p.code and p.timing_point and p.amplitude and p.duration_s]
    if not used:
        raise DataError(
            f"{asked_by}: no pulse with torque and duration was used, so no simulated person can "
            "repeat the protocol. See excluded.csv for the reasons."
        )
    people = len({p.label for p in used})
    most = Counter(p.participant for p in used).most_common(1)[0][0]
    recordings = [r for r in read_participant(study, most, {}) if r.condition == "perturbed"]
    rate = _simulated_rate_hz(recordings)
    own = [p for p in used if p.participant == most]
    shapes = tuple(_shapes(own, recordings, study, rate, asked_by=asked_by))
    points = dict.fromkeys(p.timing_point for p in used)
    nominal = study.spec.perturbations.timing_points or TIMING_POINTS
    onsets = {
        name: _onset_pct([p for p in used if p.timing_point == name], nominal.get(name))
        for name in sorted(points, key=lambda name: nominal.get(name, 0.0))
    }
    counts = Counter(p.timing_point for p in used)
    if lost := [name for name, at in onsets.items() if np.isnan(at)]:
        raise DataError(
            f"{asked_by}: no pulse at {', '.join(lost)} has a phase, so no simulated person can "
            "repeat it. State perturbations.timing_points."
        )
    per_point = {name: max(1, round(counts[name] / people)) for name in onsets}
    gaps = _gap_strides(pulses, strides, longest_s=max(s.length_s for s in shapes))
    level = [s for s in strides if s.condition == "unperturbed" and not s.code]
    walkers = len({(s.participant, s.session, s.side) for s in level})
    unperturbed = round(len(level) / walkers) if walkers else 0
    sensors = tuple(n for n in MOTION_SENSORS if all(n in r.recording for r in recordings))
    return StudyProtocol(shapes, onsets, per_point, gaps, unperturbed, rate, sensors)


def _simulated_rate_hz(recordings: Sequence[RecordingInput]) -> float:
    rate = round(rate_hz(recordings[0].recording["time"].to_numpy()), 1)
    return rate if _RATES_HZ[0] <= rate <= _RATES_HZ[1] else _OTHER_RATE_HZ


def _onset_pct(pulses: Sequence[PulseRecord], nominal: float | None) -> float:
    """Return the circular mean of the measured onsets, else the planned one."""
    measured = [p.measured_pct for p in pulses if p.measured_pct is not None]
    if not measured and nominal is not None:
        return nominal
    turns = np.exp(2j * np.pi * np.array(measured) / 100.0)
    return round(float(np.angle(turns.mean()) / (2.0 * np.pi) * 100.0), 2) % 100.0


def _gap_strides(
    pulses: Sequence[PulseRecord], strides: Sequence[StrideRecord], *, longest_s: float
) -> tuple[int, int]:
    """Return the usual range of strides from one pulse to the next."""
    stride_s = float(np.median([s.duration_s for s in strides if not s.code] or [1.1]))
    gaps: list[float] = []
    for recording in {p.recording for p in pulses}:
        onsets = sorted(p.onset_s for p in pulses if p.recording == recording)
        gaps += [(b - a) / stride_s for a, b in pairwise(onsets)]
    usual = [gap for gap in gaps if gap < _LONGEST_GAP_STRIDES] or [5.0]
    # A timing point late in one stride and one early in a following stride must not overlap.
    least = 1 + int(np.ceil(longest_s / stride_s))
    low, high = (round(float(q)) for q in np.percentile(usual, (20.0, 80.0)))
    return max(low, least), max(high, low, least)


def _shapes(
    pulses: Sequence[PulseRecord],
    recordings: Sequence[RecordingInput],
    study: Study,
    rate: float,
    *,
    asked_by: str,
) -> Iterator[NamedPulse]:
    """Yield every kind of pulse with its one size and direction."""
    sizes = _clusters([abs(p.amplitude or 0.0) for p in pulses], _SAME_SIZE, _SAME_SIZE_NM)
    lengths = _clusters([p.duration_s or 0.0 for p in pulses], 0.0, _SAME_S)
    kinds: dict[tuple[int, int, bool], list[PulseRecord]] = {}
    for pulse, length, size in zip(pulses, lengths, sizes, strict=True):
        kinds.setdefault((length, size, (pulse.amplitude or 0.0) < 0.0), []).append(pulse)
    usual = {k: own for k, own in sorted(kinds.items()) if len(own) >= _RARE * len(pulses)}
    if not 0 < len(usual) <= _MOST_KINDS:
        raise DataError(
            f"{asked_by}: the study has {len(kinds)} kinds of pulse (size, length, direction); a "
            f"simulated person can repeat {_MOST_KINDS}. Analyse kinds of pulse as studies of "
            "their own."
        )
    for number, own in enumerate(usual.values(), start=1):
        yield _shape(f"pulse {number}", own, recordings, study, rate)


def _clusters(values: Sequence[float], relative: float, absolute: float) -> list[int]:
    """Return the number of the cluster of each value; clusters are parted by gaps."""
    array = np.asarray(values)
    order = np.argsort(array)
    steps = np.diff(array[order]) > np.maximum(absolute, relative * array[order][:-1])
    numbers = np.empty(array.size, dtype=int)
    numbers[order] = np.concatenate([[0], np.cumsum(steps)])
    return [int(number) for number in numbers]


def _shape(
    name: str,
    pulses: Sequence[PulseRecord],
    recordings: Sequence[RecordingInput],
    study: Study,
    rate: float,
) -> NamedPulse:
    """Return the commanded course, or a hold or doublet by the measured torque without one."""
    size = float(np.median([abs(p.amplitude or 0.0) for p in pulses]))
    length_s = float(np.median([p.duration_s or 0.0 for p in pulses]))
    negative = (pulses[0].amplitude or 0.0) < 0.0
    given: dict[str, Any] = {
        "name": name,
        "amplitudes_nm": (round(size, 3),),
        "direction": "negative" if negative else "positive",
    }
    n = max(2, min(round(length_s * rate), _MOST_ROWS))
    since = np.arange(n + 1) * length_s / n
    # Measured torque is late, so that a second level ends after the pulse.
    beyond = np.append(since, length_s + since[1] * np.arange(1, round(_LATE_S * rate)))
    commanded = all("command" in r.recording for r in recordings)
    course = _course(pulses, recordings, study, since[:-1] if commanded else beyond)
    largest = float(np.abs(course).max()) if course.size else 0.0
    if commanded and largest > 0.0:
        shares = np.clip(course / largest, -1.0, 1.0).tolist()
        # The last level holds until the end.
        rows: dict[str, Any] = {"times_s": tuple(since.tolist()), "shares": (*shares, shares[-1])}
        return SampledPulse(kind="samples", **rows, **given)
    length_s = round(length_s, 4)
    switch = _switch(course)
    if switch is None:
        return TrapezoidPulse(kind="trapezoid", hold_s=length_s, **given)
    first_s, level = round(float(beyond[switch[0]]), 4), switch[1]
    if not 0.0 < first_s < length_s:
        return TrapezoidPulse(kind="trapezoid", hold_s=length_s, **given)
    return DoubletPulse(
        kind="doublet", durations_s=(first_s, length_s - first_s), second_level=level, **given
    )


def _course(
    pulses: Sequence[PulseRecord],
    recordings: Sequence[RecordingInput],
    study: Study,
    since: np.ndarray,
) -> np.ndarray:
    """Return the median torque after the onset, turned by its sign; empty if none is recorded."""
    courses = []
    for given in recordings:
        time = given.recording["time"].to_numpy()
        commanded = "command" in given.recording
        torque = _torque(given.recording, study)
        own = [p for p in pulses if p.recording == given.file]
        for pulse in own[:_MOST_AVERAGED]:
            if torque is None or not time[0] + _BEFORE_S <= pulse.onset_s <= time[-1] - since[-1]:
                continue
            sign = -1.0 if (pulse.amplitude or 0.0) < 0.0 else 1.0
            if commanded:  # a command holds until the next sample
                at = pulse.onset_s + since + 0.1 * since[1]
                courses.append(sign * torque[np.searchsorted(time, at, side="right") - 1])
                continue
            before = np.interp(pulse.onset_s - _BEFORE_S * np.linspace(0.1, 1.0, 20), time, torque)
            rise = np.interp(pulse.onset_s + since, time, torque) - before.mean()
            courses.append(sign * rise)
    return np.median(courses, axis=0) if courses else np.empty(0)


def _torque(recording: xr.Dataset, study: Study) -> np.ndarray | None:
    model = study.spec.torque_model
    for name in ("command", "torque"):
        if name in recording:
            return np.asarray(np.nan_to_num(recording[name].to_numpy()))
    if "current" not in recording or model is None:
        return None
    per_ampere = model.gear_ratio * model.torque_constant
    return np.asarray(per_ampere * np.nan_to_num(recording["current"].to_numpy()))


def _switch(course: np.ndarray) -> tuple[int, float] | None:
    """Return where a second level of opposite sign begins, and its share; None for a hold."""
    if course.size == 0 or course.min() > _SECOND_LEVEL * course.max():
        return None
    peak = int(np.argmax(course[: int(np.argmin(course)) + 1]))
    crossing = peak + int(np.argmax(course[peak:] < 0.0))
    rise = int(np.argmax(course >= 0.5 * course[peak]))  # the motor's lag
    begin = max(crossing - rise, 1)
    # A short second level is not reached in full.
    level = float(course.min() / course[peak])
    return begin, round(level, 2) if level > _FULL_LEVEL else -1.0


def _described(pulse: NamedPulse) -> str:
    sign = "-" if pulse.direction == "negative" else "+"
    size, length_ms = pulse.sizes_nm[0], 1000.0 * pulse.length_s
    return f"{sign}{size:.3g} N*m for {length_ms:.0f} ms{_reversal(pulse)}"


def _reversal(pulse: NamedPulse) -> str:
    """Name the time at which a pulse reverses."""
    at_s, signs = 0.0, []
    for part in pulse.course:
        signs.append((at_s, np.sign(part.begin)))
        at_s += part.duration_s
    reversed_s = [a for a, sign in signs if sign * signs[0][1] < 0.0]
    return f" (reversed after {1000.0 * reversed_s[0]:.0f} ms)" if reversed_s else ""
