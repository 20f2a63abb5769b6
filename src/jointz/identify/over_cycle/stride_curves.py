"""Angle and moment of single strides of somebody who was never perturbed."""

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

    participant: str  # whose; "" where the study does not tell the side
    side: str
    angle: np.ndarray  # joint angle, in the study's positive direction
    moment: np.ndarray  # torque on the joint, in the same direction
    session: str = ""  # "" where the study does not tell it


def stride_curves(participant: str, sources: Sequence[Source]) -> tuple[StrideCurves, ...]:
    """Return the strides walked without a device, where a moment was recorded with the angle.

    Accepted strides that the user did not leave out and that miss no sample count; between samples
    the line is straight. Gains and lags under ``[calibration]`` are those of the device's
    instruments and are not applied.
    """
    found: dict[Unit, list[np.ndarray]] = {}
    if any(source.given.condition != "no_device" for source in sources):
        return ()
    for source in sources:
        found.setdefault(unit_of(source.given), []).extend(_strides(source))
    return tuple(
        StrideCurves(participant, side, angle, moment, session)
        for (session, side), strides in found.items()
        if strides
        for angle, moment in [np.stack(strides, axis=1)]
    )


def _strides(source: Source) -> Iterator[np.ndarray]:
    """Yield angle and moment of every stride that counts, (2, NODES)."""
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
