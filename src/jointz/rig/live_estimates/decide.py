"""Decision by a live estimate: whether the pulses are enough, and where the next ones go."""

from typing import Final

from jointz.core.protocols.protocol_models import LiveSpec
from jointz.core.study import PlannedHalfWidths
from jointz.rig.experiment.decisions import Decision
from jointz.rig.live_estimates.live_estimate import LiveEstimate, LiveValue

#: Share of the pulses that goes to all timing points alike: none is left out.
_EVENLY: Final = 0.25
#: No value wants more than so many times its pulses, nor does one of unknown half-width.
_MOST_TIMES: Final = 4.0


def decide(estimate: LiveEstimate, live: LiveSpec, wishes: PlannedHalfWidths) -> Decision:
    """Stop if all wishes hold and every timing point has its pulses; else move the next pulses."""
    wished = [value for value in estimate.values if value.wish_pct is not None]
    all_there = len(wished) == sum(map(len, wishes.values()))
    missing: dict[str, float] = dict.fromkeys((v.timing_point for v in estimate.values), 0.0)
    for value in wished:
        point = value.timing_point
        missing[point] = max(missing[point], _pulses_missing(value, live.fewest_pulses))
    enough = all(v.holds and v.n_used >= live.fewest_pulses for v in estimate.values)
    shares: dict[str, float] = {}
    if "steer" in live.may and any(missing.values()):
        even, total = _EVENLY / len(missing), sum(missing.values())
        shares = {
            point: round(even + (1.0 - _EVENLY) * more / total, 4)
            for point, more in missing.items()
        }
    about = {
        "n_pulses": estimate.n_pulses,
        "values": [
            [v.timing_point, v.parameter, v.half_width_pct, v.least_pct, v.wish_pct, v.n_used]
            for v in wished
        ],
    }
    return Decision(all_there and enough and "stop" in live.may, shares, about)


def _pulses_missing(value: LiveValue, fewest: int) -> float:
    """Return how many more pulses a value wants; none where they would not fulfil its wish.

    The square of its half-width is that of the least one, and a part that falls with the pulses.
    """
    too_few = float(max(fewest - value.n_used, 0))
    if value.holds or value.out_of_reach:
        return too_few
    now, least, wish = value.half_width_pct, value.least_pct, value.wish_pct
    times = _MOST_TIMES
    if now is not None and least is not None and wish is not None:
        times = min((now**2 - least**2) / (wish**2 - least**2), _MOST_TIMES)
    return max(too_few, max(value.n_used, 1) * (times - 1.0))
