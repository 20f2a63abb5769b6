"""The pulses of a protocol drawn in text, for the terminal."""

from collections.abc import Iterator

from jointz.core.protocols.expected_displacement import (
    STEP_S,
    expected_displacement,
    torque_course,
)
from jointz.core.protocols.protocol_models import ProtocolFields
from jointz.core.protocols.pulse_models import Pulse, name_of

_COLUMNS = 48
_ROWS = 4  # on either side of zero
_DIRECTIONS = {
    "positive": "in the positive direction",
    "negative": "in the negative direction",
    "both": "in both directions",
}


def drawn_pulses(protocol: ProtocolFields) -> Iterator[str]:
    """Yield the lines that show every pulse, all on one scale of time."""
    longest_s = max((pulse.length_s for pulse in protocol.shapes), default=0.0)
    for pulse in protocol.shapes:
        yield _title(pulse)
        yield from _chart(pulse, longest_s)
        if protocol.expected_joint is not None:
            largest_nm = max(pulse.sizes_nm)
            moved_rad = (
                largest_nm * expected_displacement(pulse, protocol.expected_joint).largest_rad
            )
            yield (
                f"  {largest_nm:g} N*m move the expected joint by at most {moved_rad:.3f} rad "
                f"(limit {protocol.safety.displacement_rad:g} rad)"
            )


def _title(pulse: Pulse) -> str:
    sizes = " and ".join(f"{size:g}" for size in pulse.sizes_nm)
    name = name_of(pulse) or "pulse"
    return f"{name}: {sizes} N*m {_DIRECTIONS[pulse.direction]}, {1e3 * pulse.length_s:g} ms"


def _chart(pulse: Pulse, longest_s: float) -> Iterator[str]:
    """Yield rows of torque from the amplitude down, and the axis of time."""
    shares = torque_course(pulse.course)
    last = max(1, round(longest_s / STEP_S))
    columns = [
        shares[place] if (place := k * last // _COLUMNS) < len(shares) else 0.0
        for k in range(_COLUMNS)
    ]
    heights = [round(share * _ROWS) for share in columns]
    lowest = min(0, *heights)
    for row in range(max(heights), lowest - 1, -1):
        label = {
            _ROWS: f"{max(pulse.sizes_nm):g} N*m",
            0: "0",
            -_ROWS: f"-{max(pulse.sizes_nm):g} N*m",
        }
        cells = "".join(_cell(height, row) for height in heights).rstrip()
        yield f"{label.get(row, ''):>9} {cells}"
    yield f"{'':>9} 0 ms{f'{1e3 * longest_s:g} ms':>{_COLUMNS - 4}}"


def _cell(height: int, row: int) -> str:
    if row == 0:
        return "─"
    filled = 0 < row <= height or height <= row < 0
    return "█" if filled else " "
