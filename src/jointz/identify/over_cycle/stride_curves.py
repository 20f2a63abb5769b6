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
    if any(source.input.condition != "no_device" for source in sources):
        return ()
    for source in sources:
        with_moment = [s for s in map(_with_moment, _strides(source)) if np.isfinite(s).all()]
        curves.setdefault(unit_of(source.input), []).extend(with_moment)
    return tuple(
        StrideCurves(participant, side, angle, moment, session)
        for (session, side), strides in curves.items()
        if strides
        for angle, moment in [np.stack(strides, axis=1)]
    )


def _with_moment(stride: tuple[np.ndarray, float]) -> np.ndarray:
    """Return angle and moment, (2, NODES): a torque that is recorded without a device is one."""
    angle, torque, moment = stride[0]
    return np.stack([angle, moment if np.isfinite(moment).all() else torque])


def mean_strides(participant: str, sources: Sequence[Source]) -> tuple[MeanStride, ...]:
    """Return the mean stride of each condition, session and side, over its strides without pulses.

    In perturbed recordings the stride after one with a pulse is left out, too.
    """
    strides: dict[tuple[str, Unit], list[tuple[np.ndarray, float]]] = {}
    for source in sources:
        condition = source.input.condition
        if condition is not None:
            members = strides.setdefault((condition, unit_of(source.input)), [])
            members.extend(_strides(source, settled=condition == "perturbed"))
    return tuple(
        _mean_stride(participant, unit, condition, members)
        for (condition, unit), members in strides.items()
        if len(members) > 1
    )


def _mean_stride(
    participant: str, unit: Unit, condition: str, members: Sequence[tuple[np.ndarray, float]]
) -> MeanStride:
    strides = np.stack([curves for curves, _ in members])
    angle, torque, moment = strides.swapaxes(0, 1)
    torque, moment = (rows[np.isfinite(rows).all(axis=1)] for rows in (torque, moment))
    by_device = condition != "no_device"
    if not by_device and not len(moment):  # without a device the torque is a moment of the joint
        moment = torque
    return MeanStride(
        participant=participant,
        condition=condition,
        n_strides=len(strides),
        gait_pct=np.linspace(0.0, 100.0, NODES),
        angle=angle.mean(axis=0),
        angle_sd=angle.std(axis=0, ddof=1),
        torque=torque.mean(axis=0) if by_device and len(torque) else None,
        moment=moment.mean(axis=0) if len(moment) > 1 else None,
        moment_sd=moment.std(axis=0, ddof=1) if len(moment) > 1 else None,
        stride_s=float(np.mean([duration for _, duration in members])),
        session=unit[0],
        side=unit[1],
    )


def _strides(source: Source, *, settled: bool = False) -> Iterator[tuple[np.ndarray, float]]:
    """Yield angle, torque and moment of every stride, (3, NODES), and its duration, s.

    NaN for torque and moment with missing samples. ``settled``: the stride before has no pulse,
    either.
    """
    recording = source.input.recording
    if source.strides is None:
        return
    time = recording["time"].to_numpy()
    missing = np.full(time.size, np.nan)
    rows = [
        recording[name].to_numpy() if name in recording else missing
        for name in ("angle", "torque", "joint_moment")
    ]
    chosen = source.undisturbed
    if settled:
        chosen = chosen & np.append(True, chosen[:-1])
    for start, length in zip(
        source.strides.start_s[chosen], source.strides.duration_s[chosen], strict=True
    ):
        first, last = np.searchsorted(time, (start, start + length))
        around = slice(max(first - 1, 0), last + 1)
        if np.isfinite(rows[0][around]).all():
            at = start + length * np.linspace(0.0, 1.0, NODES)
            curves = [np.interp(at, time[around], row[around]) for row in rows]
            yield np.stack(curves), float(length)
