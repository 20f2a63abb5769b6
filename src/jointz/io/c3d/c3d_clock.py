"""Clock of a C3D file: frames at one rate, channels at a whole multiple of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from jointz.core.acquisition import SignalGroup

#: Most points, and most analog values, of a frame.
MOST_VALUES = 0xFFFF
_LATEST_FRAME = 2**31
_WHOLE = 1e-6


@dataclass(frozen=True, slots=True)
class Clock:
    """When the frames of a file were taken."""

    rate_hz: float  # rate of the frames; 0 without content
    first_frame: int  # number of the first frame, counted from 0
    n_frames: int  # number of frames
    times: Mapping[str, int]  # role -> samples in a frame
    rates_hz: Mapping[str, float]  # role -> stated rate


def single(rate_hz: float) -> float:
    """Return a rate as single precision holds it, in as few digits as that needs."""
    with np.errstate(over="ignore"):
        return float(str(np.float32(rate_hz)))


def uniform(group: SignalGroup, lost: list[str]) -> SignalGroup | None:
    """Return a group on a uniform clock, None where its samples are not uniform."""
    name, stamps, rate = group.name, group.time_s, group.rate_hz
    if stamps is not None:
        rate = _rate_of(stamps)
        if rate is None:
            lost.append(
                f"Group '{name}' is left out: its time stamps are not uniform, and a C3D file has "
                "no others."
            )
            return None
        start = float(stamps[0])
        off = float(np.abs(stamps - start - np.arange(len(stamps)) / rate).max())
        lost.append(
            f"The time stamps of group '{name}' become a clock of {rate:.9g} Hz, which differs "
            f"from them by up to {off:.3g} s."
        )
        return replace(group, time_s=None, rate_hz=rate, start_s=start)
    if rate is None or not np.isfinite(rate) or not np.isfinite(group.start_s):
        lost.append(f"Group '{name}' is left out: it has no clock, and a C3D file wants a rate.")
        return None
    if not 0 < single(rate) < np.inf:
        lost.append(f"Group '{name}' is left out: a C3D file has no rate of {rate:g} Hz.")
        return None
    if single(rate) != rate:
        lost.append(f"The rate of group '{name}', {rate!r} Hz, is rounded to {single(rate)!r} Hz.")
    return replace(group, rate_hz=single(rate))


def aligned(
    groups: Mapping[str, SignalGroup], lost: list[str]
) -> tuple[Clock, dict[str, SignalGroup]]:
    """Return the one clock, and the groups that go with it, cut to whole frames."""
    timed = {role: g for role, group in groups.items() if (g := _holdable(group, lost)) is not None}
    if not timed:
        return Clock(0.0, 0, 0, {}, {}), {}
    base = next(iter(timed.values()))
    times: dict[str, int] = {}
    for role, group in timed.items():
        problem, ratio = _misfit(base, group)
        if problem:
            lost.append(f"Group '{group.name}' is left out: {problem}.")
            continue
        if group.start_s != base.start_s:
            lost.append(
                f"Group '{group.name}' starts with the frames, {base.start_s - group.start_s:.3g} "
                "s later than it does."
            )
        times[role] = ratio
    fitting = {role: timed[role] for role in times}
    n_frames = min(group.n_samples // times[role] for role, group in fitting.items())
    for role, group in fitting.items():
        if group.n_samples != n_frames * times[role]:
            cut = group.n_samples - n_frames * times[role]
            lost.append(f"Group '{group.name}' is cut to whole frames, by {cut} samples.")
            cells = [replace(s, values=s.values[: n_frames * times[role]]) for s in group.signals]
            fitting[role] = replace(group, signals=tuple(cells))
    clock = Clock(
        rate_hz=_rate(base),
        first_frame=_first_frame(base, lost),
        n_frames=n_frames,
        times=times,
        rates_hz={role: _rate(group) for role, group in fitting.items()},
    )
    return clock, fitting


def _holdable(group: SignalGroup, lost: list[str]) -> SignalGroup | None:
    """Return a group on a uniform clock, None where no frame holds it, whatever the others are."""
    if len(group.signals) > MOST_VALUES:
        lost.append(f"Group '{group.name}' is left out: {_too_many(group)}.")
        return None
    return uniform(group, lost)


def _too_many(group: SignalGroup) -> str:
    return f"{len(group.signals)} signals are more than a frame can hold"


def _misfit(base: SignalGroup, group: SignalGroup) -> tuple[str, int]:
    """Return why a group does not go with the frames, and how often it is sampled in one."""
    ratio = _rate(group) / _rate(base)
    whole = round(ratio)
    if whole < 1 or abs(ratio - whole) > _WHOLE * ratio:
        problem = (
            f"{_rate(group):g} Hz is no whole multiple of the {_rate(base):g} Hz of the frames"
        )
        return problem, 0
    if abs(group.start_s - base.start_s) * _rate(group) > 0.5:
        return f"it starts at {group.start_s:g} s, the frames at {base.start_s:g} s", 0
    if len(group.signals) * whole > MOST_VALUES:
        return _too_many(group), 0
    return "", whole


def _first_frame(base: SignalGroup, lost: list[str]) -> int:
    rate = _rate(base)
    frame = int(np.clip(round(base.start_s * rate), 0, _LATEST_FRAME))
    if frame / rate != base.start_s:
        lost.append(
            f"The first sample is at {frame / rate:.9g} s there, not at {base.start_s!r} s: a C3D "
            "file counts frames from 0."
        )
    return frame


def _rate_of(stamps: np.ndarray) -> float | None:
    """Return the rate of time stamps that lie less than half a sample from a uniform clock."""
    if len(stamps) < 2 or not np.isfinite(stamps).all() or stamps[-1] <= stamps[0]:
        return None
    rate = single((len(stamps) - 1) / (stamps[-1] - stamps[0]))
    if not 0 < rate < np.inf:
        return None
    off = np.abs(stamps - stamps[0] - np.arange(len(stamps)) / rate)
    return rate if off.max() < 0.5 / rate else None


def _rate(group: SignalGroup) -> float:
    return float(group.rate_hz or 0.0)
