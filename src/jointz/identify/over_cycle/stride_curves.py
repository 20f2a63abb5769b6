"""Strides over the gait cycle: single ones without a device, and means of each condition."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from jointz.identify.preparation.recording_groups import Unit, unit_of
from jointz.identify.preparation.sources import Source
from jointz.results.mean_stride import MeanStride

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
        if "torque" in source.given.recording:
            curves.setdefault(unit_of(source.given), []).extend(_strides(source))
    return tuple(
        StrideCurves(participant, side, angle, moment, session)
        for (session, side), strides in curves.items()
        if strides
        for angle, moment in [np.stack(strides, axis=1)]
    )


def mean_strides(participant: str, unit: Unit, sources: Sequence[Source]) -> tuple[MeanStride, ...]:
    """Return the mean stride of each condition, over its strides without pulses."""
    strides: dict[str, list[np.ndarray]] = {}
    for source in sources:
        if source.given.condition is not None:
            strides.setdefault(source.given.condition, []).extend(_strides(source))
    return tuple(
        _mean_stride(participant, unit, condition, np.stack(own))
        for condition, own in strides.items()
        if len(own) > 1
    )


def _mean_stride(participant: str, unit: Unit, condition: str, strides: np.ndarray) -> MeanStride:
    mean, sd = strides.mean(axis=0), strides[:, 0].std(axis=0, ddof=1)
    # Without a device the torque is a moment of the joint.
    by_device = condition != "no_device" and bool(np.isfinite(mean[1]).all())
    return MeanStride(
        participant=participant,
        condition=condition,
        n_strides=len(strides),
        gait_pct=np.linspace(0.0, 100.0, NODES),
        angle=mean[0],
        angle_sd=sd,
        torque=mean[1] if by_device else None,
        session=unit[0],
        side=unit[1],
    )


def _strides(source: Source) -> Iterator[np.ndarray]:
    """Yield angle and torque of every usable stride, (2, NODES); NaN without a torque."""
    recording = source.given.recording
    if source.strides is None:
        return
    time = recording["time"].to_numpy()
    names = [name for name in ("angle", "torque") if name in recording]
    signals = np.stack([recording[name].to_numpy() for name in names])
    for start, length in zip(
        source.strides.start_s[source.undisturbed],
        source.strides.duration_s[source.undisturbed],
        strict=True,
    ):
        first, last = np.searchsorted(time, (start, start + length))
        around = slice(max(first - 1, 0), last + 1)
        if np.isfinite(signals[:, around]).all():
            at = start + length * np.linspace(0.0, 1.0, NODES)
            stride = np.full((2, NODES), np.nan)
            for row, signal in zip(stride, signals, strict=False):
                row[:] = np.interp(at, time[around], signal[around])
            yield stride
