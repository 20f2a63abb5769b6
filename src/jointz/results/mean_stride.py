"""Mean stride of a participant over the gait cycle."""

from dataclasses import dataclass

from jointz.results.base import Array, Result


@dataclass(frozen=True, slots=True, eq=False)
class MeanStride(Result):
    """Mean angle, torque and moment of a participant's strides without pulses, in one condition."""

    participant: str
    condition: str  # as in study.toml: ``no_device``, ``unperturbed`` or ``perturbed``
    n_strides: int  # accepted strides without a pulse and without missing samples
    gait_pct: Array  # (n,) % of the gait cycle, from 0 to 100
    angle: Array  # (n,) mean angle, rad
    angle_sd: Array  # (n,) SD between strides, rad
    torque: Array | None = None  # (n,) mean torque of the device, N*m; None without a device
    # (n,) mean internal moment of the joint, N*m; None if none was recorded
    moment: Array | None = None
    moment_sd: Array | None = None  # (n,) SD of the moment between strides, N*m
    stride_s: float | None = None  # mean duration of a stride, s; None in older results
    session: str = ""  # "" if the study does not state it
    side: str = ""  # "" if the study does not state it
