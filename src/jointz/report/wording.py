"""Names, numbers, units and codes as text."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from jointz.core.channels import PARAMETER_NAMES
from jointz.core.codes import Exclusion, Failure
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.estimates import ParameterEstimate

DASH: Final = "\N{EN DASH}"
MINUS: Final = "\N{MINUS SIGN}"
TIMES: Final = "\N{MULTIPLICATION SIGN}"

#: What every method estimates, its symbols, the values per kg of body mass, those at the onset.
ABSOLUTE: Final = ("stiffness", "damping", "inertia")
SYMBOLS: Final = tuple(PARAMETER_NAMES[name][1] for name in ABSOLUTE)
PER_MASS: Final = ("stiffness_per_mass", "damping_per_mass")
AT_ONSET: Final = ("stiffness_onset", "damping_onset")
#: Parameter -> (name in words, symbol), of those that every method has.
PARAMETERS: Final = {n: words for n, words in PARAMETER_NAMES.items() if n not in AT_ONSET}
#: The same with the parameters that only some methods have.
ALL_PARAMETERS: Final = PARAMETER_NAMES
_WHICH_IS_WHICH: Final = (
    "Stiffness, damping and inertia are those along the measured motion in the window; stiffness "
    "and damping at the onset are those of small displacements at the onset of the pulse."
)

_STATUS_MEANINGS: Final[Mapping[str, str]] = {
    "ok": "the estimate and its two-sided interval are available",
    "at_bound": "the value cannot be told from its bound; only an upper limit is available",
    "undecided": "the data do not decide on a value, so none is given",
}
_METHOD_NAMES: Final[Mapping[str, str]] = {
    "full_record": "whole trials",
    "pre_pulse": "level before the pulse",
}

# No quantity of a joint is this small in SI units; such numbers, as 2e-14, are rounding errors.
_NEGLIGIBLE = 1e-9
_SMALLEST_PLAIN = 1e-4
_DIGITS = 3
#: An end that needs more digits than this beside the others is practically zero.
_MOST_DIGITS = 6
_ALMOST_ALL_PCT = 99.9
#: Name of a group by a channel: its edges.
_NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_EDGES: Final = re.compile(rf"({_NUMBER})\.\.({_NUMBER})( .*)?")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def format_number(value: float | None, *, like: float | None = None, digits: int = _DIGITS) -> str:
    """Write a number with sensible significant digits and no exponent notation."""
    if value is None or not math.isfinite(value):
        return DASH
    reference = abs(value if like is None else like)
    if reference < _NEGLIGIBLE:
        return "0"
    exponent = math.floor(math.log10(reference))
    if reference < _SMALLEST_PLAIN:
        mantissa = value / 10.0**exponent
        power = str(exponent).translate(_SUPERSCRIPTS)
        return _signed(f"{mantissa:.{digits - 1}f}") + f" {TIMES} 10{power}"
    text = f"{value:,.{max(0, digits - 1 - exponent)}f}"
    return _signed(text.replace(",", "\N{NARROW NO-BREAK SPACE}"))


def format_exact(value: float) -> str:
    """Write a setting, with all its digits."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    power = f" {TIMES} 10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return _signed(mantissa) + power


def format_with_sd(value: float, sd: float, unit: str = "") -> str:
    """Write a value with its standard deviation, which has two digits."""
    behind = f" {unit}" if unit else ""
    if sd <= 0.0:
        return f"{format_exact(value)}{behind} (taken as exact)"
    like = max(abs(value), sd)
    digits = 2 + math.floor(math.log10(like)) - math.floor(math.log10(sd))
    texts = (format_number(x, like=like, digits=digits) for x in (value, sd))
    return f"{' ± '.join(texts)}{behind}"


def format_interval(value: float | None, low: float | None, high: float | None) -> str:
    """Write a value and its interval with the same decimals: ``3.02 [2.81, 3.24]``."""
    if value is None or low is None or high is None:
        return format_number(value)
    like, digits = _extent(value, low, high)
    texts = [format_number(x, like=like, digits=digits) for x in (value, low, high)]
    return f"{texts[0]} [{texts[1]}, {texts[2]}]"


def format_spread(
    sd: float | None, value: float | None, low: float | None, high: float | None
) -> str:
    """Write an SD with the decimals of its value and interval."""
    if not sd or value is None or low is None or high is None:
        return format_number(sd, like=value)
    like, digits = _extent(value, low, high)
    return format_number(sd, like=like, digits=max(digits, _places_between(like, sd) + 2))


def _extent(*numbers: float) -> tuple[float, int]:
    """Return the largest number, and its digits if only zero may be shown as 0."""
    sizes = [abs(x) for x in numbers]
    nonzero = [x for x in sizes if x >= _NEGLIGIBLE]
    like = max(sizes)
    needed = _places_between(like, min(nonzero)) + 1 if nonzero else 0
    return like, needed if _DIGITS < needed <= _MOST_DIGITS else _DIGITS


def _places_between(large: float, small: float) -> int:
    return math.floor(math.log10(large)) - math.floor(math.log10(small))


def format_estimate(estimate: ParameterEstimate) -> str:
    """Write an estimate: a value with its interval, a bound with its limit, or a dash."""
    if not estimate.available:
        return DASH
    if estimate.status == "at_bound":
        bound = format_number(estimate.ci_low if estimate.ci_low is not None else estimate.value)
        limit = estimate.ci_high
        return f"{bound} (at most {format_number(limit)})" if limit is not None else bound
    return format_interval(estimate.value, estimate.ci_low, estimate.ci_high)


def format_vaf(vaf_pct: float | None) -> str:
    """Write a variance accounted for without its unit; values below 100 are never rounded to it."""
    if vaf_pct is None:
        return DASH
    return f"> {_ALMOST_ALL_PCT}" if vaf_pct > _ALMOST_ALL_PCT else _signed(f"{vaf_pct:.1f}")


def format_count(count: int, singular: str, plural: str | None = None) -> str:
    """Write a count with its noun: ``1 pulse``, ``2 pulses``."""
    noun = singular if count == 1 else (plural or f"{singular}s")
    return f"{format_integer(count)} {noun}"


def format_integer(count: int) -> str:
    """Write an integer with narrow spaces between thousands."""
    return f"{count:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def format_span(values: Iterable[float], write: Callable[[Any], str]) -> str:
    """Write the smallest and the largest value, or the one value if both are written alike."""
    known = list(values)
    low, high = write(min(known)), write(max(known))
    return low if low == high else f"{low} to {high}"


def joined(texts: Sequence[str]) -> str:
    """Join texts as a list in a sentence: ``a, b and c``."""
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def format_signed(value: float, *, decimals: int) -> str:
    """Write a number with its sign, as for an error."""
    return f"{value:+.{decimals}f}".replace("-", MINUS) if math.isfinite(value) else DASH


def method_name(method: str) -> str:
    """Return the name of a method in words."""
    return _METHOD_NAMES.get(method, method.replace("_", " "))


def parameter_name(parameter: str) -> str:
    """Return the name of a parameter in words."""
    return ALL_PARAMETERS[parameter][0]


def onset_note(parameters: Iterable[str]) -> str:
    """Say which stiffness and damping is which; "" without values at the onset."""
    return "" if set(AT_ONSET).isdisjoint(parameters) else _WHICH_IS_WHICH


def point_name(timing_point: str) -> str:
    """Return the name of a timing point for tables."""
    if timing_point == ALL_POINTS:
        return "all points"
    edges = _EDGES.fullmatch(timing_point)
    if edges is None:
        return timing_point
    low, high, unit = edges.groups()
    return f"{format_exact(float(low))} to {format_exact(float(high))}{unit or ''}"


def status_meaning(status: str) -> str:
    """Explain a status of ``estimates.csv`` in one sentence."""
    code = status.removeprefix("failed:")
    return _STATUS_MEANINGS.get(status) or _meaning(code, Failure)


def exclusion_meaning(code: str) -> str:
    """Explain why a stride or a pulse was excluded."""
    return _meaning(code, Exclusion)


def _meaning(code: str, codes: type[Exclusion] | type[Failure]) -> str:
    """Return the meaning of a code; results of a newer version may have unknown ones."""
    try:
        return codes(code).meaning
    except ValueError:
        return code.replace("_", " ")


def _signed(text: str) -> str:
    bare = text.lstrip("-")
    is_zero = not bare.strip("0.")
    return bare if is_zero else text.replace("-", MINUS)
