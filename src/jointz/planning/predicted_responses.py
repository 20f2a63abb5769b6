"""Responses that planned pulses would give: their shapes, errors and numbers, without any data."""

from dataclasses import dataclass, replace

import numpy as np

from jointz.core.protocols.pulse_models import Pulse, PulseVariant, name_of, variants_of
from jointz.identify.prediction.unperturbed_prediction import LEAD_SAMPLES
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.responses import (
    PointResponse,
    ShapeAverage,
    data_end_s,
    data_length_s,
    usable_samples,
)
from jointz.planning.laboratory import Actuator, Laboratory
from jointz.planning.unperturbed_walking import PointWalking

_STEP_S = 5e-4


@dataclass(frozen=True, slots=True)
class Design:
    """Pulses at every timing point, and the window of the analysis."""

    name: str
    pulses: tuple[Pulse, ...]
    window_s: float

    @property
    def variants(self) -> tuple[PulseVariant, ...]:
        """Every shape in every size and direction: each is fired equally often."""
        return variants_of(self.pulses)


def planned_points(design: Design, lab: Laboratory, person: int) -> list[PointResponse]:
    """Return the responses of all timing points, with zeros for the sensor signals."""
    walking = lab.walking_of(person)
    return [_planned_point(design, label, at, lab) for label, at in walking.items()]


def _planned_point(design: Design, label: str, at: PointWalking, lab: Laboratory) -> PointResponse:
    length_s = data_length_s(design.window_s, lab.coupling)
    n = min(round(length_s / at.period_s) + LEAD_SAMPLES + 1, at.n_samples)
    time_s = (np.arange(n) - LEAD_SAMPLES) * at.period_s
    variants = design.variants
    by_name = {name_of(pulse): pulse for pulse in design.pulses}
    shapes = tuple(
        ShapeAverage(
            sensor_signals=np.zeros((len(at.channels), n)),
            torque=v.amplitude_nm * torque_share(by_name[v.shape], lab.actuator, time_s),
            n_pulses=1,
            used=time_s <= data_end_s(at.phase, at.stride_s),
        )
        for v in variants
    )
    return PointResponse(
        label=label,
        phase=at.phase,
        stride_s=at.stride_s,
        time_s=time_s,
        shapes=shapes,
        velocity=at.velocity[:n],
        prediction_errors=at.prediction_errors[:, :, :n],
        torque_prediction_errors=at.torque_prediction_errors[:, :n],
        n_strides=at.n_strides,
        twist_sd=lab.twist_sd,
        channels=at.channels,
    )


def torque_share(pulse: Pulse, actuator: Actuator, time_s: np.ndarray) -> np.ndarray:
    """Return torque over amplitude at times from the onset, with the lag of the actuator."""
    fine = np.arange(0.0, time_s[-1] + _STEP_S, _STEP_S)
    ends = np.cumsum([part.duration_s for part in pulse.course])
    starts = np.concatenate([[0.0], ends[:-1]])
    command = np.zeros(fine.size)
    for part, begin, end in zip(pulse.course, starts, ends, strict=True):
        inside = (fine >= begin - 1e-9) & (fine < end - 1e-9)
        share = (fine[inside] - begin) / (end - begin)
        command[inside] = part.begin + (part.end - part.begin) * share
    kept = float(np.exp(-_STEP_S / actuator.time_constant_s))
    followed = np.zeros(fine.size)
    for k in range(1, fine.size):
        followed[k] = kept * followed[k - 1] + (1.0 - kept) * command[k - 1]
    return np.interp(time_s - actuator.delay_s, fine, followed, left=0.0)


def with_usable_samples(model: LegModel, theta: np.ndarray) -> LegModel:
    """Return the model without the samples after the joint has moved too far."""
    points = []
    for k, point in enumerate(model.points):
        shown = model.responses(theta[None], k)[0].reshape(
            len(point.shapes), len(point.channels), -1
        )
        shapes = tuple(
            replace(s, used=s.used & usable_samples(angle[0], point.time_s))
            for s, angle in zip(point.shapes, shown, strict=True)
        )
        points.append(replace(point, shapes=shapes))
    return model.with_points(points)
