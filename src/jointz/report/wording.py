"""Words and numbers as people read them: names, units, significant digits, codes."""

import math
import re
from collections.abc import Callable, Mapping
from typing import Final

from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Exclusion, Failure
from jointz.core.gait_phases import ALL_POINTS
from jointz.results.estimates import ParameterEstimate

DASH: Final = "\N{EN DASH}"
MINUS: Final = "\N{MINUS SIGN}"
TIMES: Final = "\N{MULTIPLICATION SIGN}"

#: Parameter -> (name in words, symbol), in the order of tables and figures.
PARAMETERS: Final[Mapping[str, tuple[str, str]]] = {
    "stiffness_per_mass": ("Stiffness per body mass", "K/m"),
    "stiffness": ("Stiffness", "K"),
    "damping_per_mass": ("Damping per body mass", "B/m"),
    "damping": ("Damping", "B"),
    "inertia": ("Inertia", "J"),
}

_METHOD_NAMES: Final[Mapping[str, str]] = {
    "full_record": "whole trials",
    "pre_pulse": "level before the pulse",
    "errors_in_variables": "errors in variables",
}

# Below this nothing in SI that a joint has is a quantity; it is rounding, such as 2e-14.
_NEGLIGIBLE = 1e-9
_SMALLEST_PLAIN = 1e-4
_DIGITS = 3
#: An end that is so small beside the others is as good as zero.
_MOST_DIGITS = 6
_ALMOST_ALL_PCT = 99.9
#: A group by a channel, as its edges name it.
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
    """Write a number that was set, not estimated, with the digits it has."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    power = f" {TIMES} 10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if exponent else ""
    return _signed(mantissa) + power


def format_with_sd(value: float, sd: float, unit: str = "") -> str:
    """Write a value with its standard deviation, to two digits of the latter."""
    behind = f" {unit}" if unit else ""
    if sd <= 0.0:
        return f"{format_exact(value)}{behind} (taken for exact)"
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
    """Write an SD with the decimals of the value and the interval that it stands beside."""
    if not sd or value is None or low is None or high is None:
        return format_number(sd, like=value)
    like, digits = _extent(value, low, high)
    return format_number(sd, like=like, digits=max(digits, _places_between(like, sd) + 2))


def _extent(*numbers: float) -> tuple[float, int]:
    """Return the largest of numbers, and the digits of it by which none but zero is shown as 0."""
    sizes = [abs(x) for x in numbers]
    told = [x for x in sizes if x >= _NEGLIGIBLE]
    like = max(sizes)
    needed = _places_between(like, min(told)) + 1 if told else 0
    return like, needed if _DIGITS < needed <= _MOST_DIGITS else _DIGITS


def _places_between(large: float, small: float) -> int:
    return math.floor(math.log10(large)) - math.floor(math.log10(small))


def format_estimate(estimate: ParameterEstimate) -> str:
    """Write an estimate as it may be read: a value, a bound, or a dash."""
    if not estimate.stands:
        return DASH
    if estimate.status == "at_bound":
        bound = format_number(estimate.ci_low if estimate.ci_low is not None else estimate.value)
        limit = estimate.ci_high
        return f"{bound} (at most {format_number(limit)})" if limit is not None else bound
    return format_interval(estimate.value, estimate.ci_low, estimate.ci_high)


def format_vaf(vaf_pct: float | None) -> str:
    """Write a variance accounted for without its unit; never as 100 what is less."""
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


def format_signed(value: float, *, decimals: int) -> str:
    """Write a number with its sign, as an error is written."""
    return f"{value:+.{decimals}f}".replace("-", MINUS) if math.isfinite(value) else DASH


def pretty_unit(unit: str) -> str:
    """Write a unit with dots and superscripts."""
    return unit.replace("*", "·").replace("^2", "²")


def method_name(method: str) -> str:
    """Return a method as people say it."""
    return _METHOD_NAMES.get(method, method.replace("_", " "))


def parameter_name(parameter: str) -> str:
    """Return the name of a parameter in words."""
    return PARAMETERS[parameter][0]


def point_name(timing_point: str) -> str:
    """Return a timing point as tables name it."""
    if timing_point == ALL_POINTS:
        return "all points"
    edges = _EDGES.fullmatch(timing_point)
    if edges is None:
        return timing_point
    low, high, unit = edges.groups()
    return f"{format_exact(float(low))} to {format_exact(float(high))}{unit or ''}"


def parameter_label(parameter: str) -> str:
    """Return symbol and unit, for axes and column heads."""
    return f"{PARAMETERS[parameter][1]} ({pretty_unit(PARAMETER_UNITS[parameter])})"


def status_meaning(status: str) -> str:
    """Explain a status of ``estimates.csv`` in one sentence."""
    known = {
        "ok": "the estimate and its two-sided interval stand",
        "at_bound": "the data do not tell the value from its bound: only an upper limit stands",
        "undecided": "the data do not decide on a value, so none is given",
    }
    if status in known:
        return known[status]
    code = status.removeprefix("failed:")
    return _meaning(code, lambda text: Failure(text).meaning)


def exclusion_meaning(code: str) -> str:
    """Explain why a stride or a pulse was left out."""
    return _meaning(code, lambda text: Exclusion(text).meaning)


def _meaning(code: str, look_up: Callable[[str], str]) -> str:
    # Results of a newer version may hold codes that this one does not know.
    try:
        return look_up(code)
    except ValueError:
        return code.replace("_", " ")


def _signed(text: str) -> str:
    bare = text.lstrip("-")
    is_zero = not bare.strip("0.")
    return bare if is_zero else text.replace("-", MINUS)
