"""Effect of the device on the gait: mean strides with against without it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.core.errors import DataError
from jointz.results.mean_stride import MeanStride
from jointz.stats import spm_paired_t

#: Fewer pairs have no test.
_FEWEST_PEOPLE: Final = 3

_Curves = tuple[np.ndarray, np.ndarray | None]


def mean_strides_of_people(strides: Iterable[MeanStride]) -> dict[str, dict[str, _Curves]]:
    """Return condition -> participant -> angle (rad) and torque (N*m), over sessions and sides."""
    groups: dict[str, dict[str, list[MeanStride]]] = {}
    for stride in strides:
        groups.setdefault(stride.condition, {}).setdefault(stride.participant, []).append(stride)
    return {
        condition: {person: _mean(own) for person, own in people.items()}
        for condition, people in groups.items()
    }


def device_effect(strides: Sequence[MeanStride]) -> Mapping[str, Any]:
    """Return the test of the mean angle with against without the device, as statistics.

    Strides with the device are those of unperturbed recordings. Empty without three people who
    walked in both conditions.
    """
    curves = mean_strides_of_people(strides)
    without, worn = curves.get("no_device", {}), curves.get("unperturbed", {})
    people = [person for person in worn if person in without]
    if len(people) < _FEWEST_PEOPLE:
        return {}
    angles = (np.stack([own[p][0] for p in people]) for own in (worn, without))
    try:
        test = spm_paired_t(*angles)
    except DataError:  # such as the same curves twice
        return {}
    return {"device_effect": {"participants": people, "test": test.to_dict()}}


def _mean(strides: Sequence[MeanStride]) -> _Curves:
    torques = [s.torque for s in strides if s.torque is not None]
    angle = np.mean([s.angle for s in strides], axis=0)
    return angle, np.mean(torques, axis=0) if torques else None
