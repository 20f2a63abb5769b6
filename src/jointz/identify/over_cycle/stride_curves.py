"""Angle and moment of single strides of a participant who was never perturbed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.identify.preparation.recording_groups import Unit, unit_of
from jointz.identify.preparation.sources import Source

#: Nodes of a stride, from one heel strike to the next.
NODES = 101


@dataclass(frozen=True, slots=True, eq=False)
class StrideCurves:
    """Strides of one participant, session and side, over the gait cycle."""

    participant: str
    side: str  # "" if the study does not state it
    angle: np.ndarray  # (stride, NODES) joint angle, positive in the study's direction, rad
    moment: np.ndarray  # (stride, NODES) torque on the joint, positive in the same direction, N*m
    session: str = ""  # "" if the study does not state it


def stride_curves(participant: str, sources: Sequence[Source]) -> tuple[StrideCurves, ...]:
    """Return the strides without a device, if a moment was recorded with the angle.

    These are the accepted strides without missing samples that the user has not excluded,
    interpolated linearly. Gains and lags under ``[calibration]`` are those of the device's
    instruments and are not applied.
    """
    curves: dict[Unit, list[np.ndarray]] = {}
    if any(source.given.condition != "no_device" for source in sources):
        return ()
    for source in sources:
        curves.setdefault(unit_of(source.given), []).extend(_strides(source))
    return tuple(
        StrideCurves(participant, side, angle, moment, session)
        for (session, side), strides in curves.items()
        if strides
        for angle, moment in [np.stack(strides, axis=1)]
    )


def _strides(source: Source) -> Iterator[np.ndarray]:
    """Yield angle and moment of every usable stride, (2, NODES)."""
    recording = source.given.recording
    if source.strides is None or "torque" not in recording:
        return
    time = recording["time"].to_numpy()
    signals = np.stack([recording[name].to_numpy() for name in ("angle", "torque")])
    for start, length in zip(
        source.strides.start_s[source.undisturbed],
        source.strides.duration_s[source.undisturbed],
        strict=True,
    ):
        first, last = np.searchsorted(time, (start, start + length))
        around = slice(max(first - 1, 0), last + 1)
        if np.isfinite(signals[:, around]).all():
            at = start + length * np.linspace(0.0, 1.0, NODES)
            yield np.stack([np.interp(at, time[around], row[around]) for row in signals])
