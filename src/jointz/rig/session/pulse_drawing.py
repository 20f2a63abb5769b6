"""The pulses of a protocol drawn in text, for the terminal."""

from collections.abc import Iterator
from textwrap import wrap

from jointz.core.protocols.expected_displacement import largest_displacement_rad
from jointz.core.protocols.protocol_models import ProtocolFields
from jointz.core.protocols.pulse_models import Pulse, TorquePart, name_of

_COLUMNS = 48
_WIDTH = 90
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
        yield from wrap(_title(pulse), _WIDTH, subsequent_indent="  ")
        yield from _chart(pulse, longest_s)
        if protocol.expected_joint is not None:
            largest_nm = max(pulse.sizes_nm)
            moved_rad = largest_nm * largest_displacement_rad(pulse, protocol.expected_joint)
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
    columns = [_largest_share(pulse.course, k, longest_s / _COLUMNS) for k in range(_COLUMNS)]
    heights = [round(share * _ROWS) for share in columns]
    for row in range(max(0, *heights), min(0, *heights) - 1, -1):
        label = {
            _ROWS: f"{max(pulse.sizes_nm):g} N*m",
            0: "0",
            -_ROWS: f"-{max(pulse.sizes_nm):g} N*m",
        }
        cells = "".join(_cell(height, row) for height in heights).rstrip()
        yield f"{label.get(row, ''):>9} {cells}"
    yield f"{'':>9} 0 ms{f'{1e3 * longest_s:g} ms':>{_COLUMNS - 4}}"


def _largest_share(course: tuple[TorquePart, ...], column: int, width_s: float) -> float:
    """Return the largest share in a column: a part narrower than it shows, too."""
    begin_s, end_s = column * width_s, (column + 1) * width_s
    largest, part_begin_s = 0.0, 0.0
    for part in course:
        first_s, last_s = max(begin_s, part_begin_s), min(end_s, part_begin_s + part.duration_s)
        if last_s - first_s > 1e-6 * width_s:
            slope = (part.end - part.begin) / part.duration_s
            ends = [part.begin + slope * (at_s - part_begin_s) for at_s in (first_s, last_s)]
            largest = max([largest, *ends], key=abs)
        part_begin_s += part.duration_s
    return largest


def _cell(height: int, row: int) -> str:
    if row == 0:
        return "─"
    filled = 0 < row <= height or height <= row < 0
    return "█" if filled else " "
