"""Effect of the device on the gait: mean strides with against without it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.core.errors import DataError
from jointz.results.mean_stride import MeanStride
from jointz.results.statistics.waveform_test import WaveformTest
from jointz.stats import spm_paired_t

#: Fewer pairs have no test.
_FEWEST_PEOPLE: Final = 3


def strides_by_person(strides: Iterable[MeanStride]) -> dict[str, dict[str, list[MeanStride]]]:
    """Return condition -> participant -> mean strides of all sessions and sides."""
    groups: dict[str, dict[str, list[MeanStride]]] = {}
    for stride in strides:
        groups.setdefault(stride.condition, {}).setdefault(stride.participant, []).append(stride)
    return groups


def device_effect(strides: Sequence[MeanStride]) -> Mapping[str, Any]:
    """Return the test of the mean angle with against without the device, as statistics.

    Strides with the device are those of unperturbed recordings. Both conditions are compared
    within session and side; a participant's differences are averaged. Empty without three people
    who have such a pair.
    """
    angles = {(m.participant, m.session, m.side, m.condition): m.angle for m in strides}
    pairs: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for (person, session, side, condition), angle in angles.items():
        without = angles.get((person, session, side, "no_device"))
        if condition == "unperturbed" and without is not None:
            pairs.setdefault(person, []).append((angle, without))
    if len(pairs) < _FEWEST_PEOPLE:
        return {}
    means = np.array([np.mean(own, axis=0) for own in pairs.values()])
    try:
        test = spm_paired_t(means[:, 0], means[:, 1])
    except DataError:  # such as the same curves twice
        return {}
    return {"device_effect": {"participants": list(pairs), "test": test.to_dict()}}


def stored_device_effect(statistics: Mapping[str, Any]) -> WaveformTest | None:
    """Return the test among the statistics of an analysis, None if there is none."""
    stored = statistics.get("device_effect")
    return WaveformTest.from_dict(stored["test"]) if stored else None
