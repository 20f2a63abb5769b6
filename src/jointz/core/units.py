"""Units in the spellings of users, and their factors to SI.

The only module that knows pint. The vocabulary is small on purpose: pint's own
would read ``nm`` as nanometre and ``MA`` as megaampere without a word, holds an
angle for a pure number, and a torque for an energy. Here angle and energy are
dimensions of their own, so that a column in the wrong quantity is caught.
"""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from jointz.core.errors import UnitError

_DEFINITIONS = """
micro- = 1e-6 = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
second = [time] = s = sec
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d
nanosecond = 1e-9 * second = ns
meter = [length] = m = metre
inch = 0.0254 * meter = in
foot = 0.3048 * meter = ft = feet
gram = [mass] = g
pound = 453.59237 * gram = lb = lbm
ampere = [current] = A = amp
kelvin = [temperature]; offset: 0 = K
degree_Celsius = kelvin; offset: 273.15 = degC = celsius
radian = [angle] = rad
degree = 3.141592653589793 / 180 * radian = deg
turn = 2 * 3.141592653589793 * radian = rev = revolution
degree_per_second = degree / second = dps
joule = [energy] = J
percent = 0.01
standard_gravity = 9.80665 * meter / second ** 2 = g0
newton = kilogram * meter / second ** 2 = N
force_pound = pound * standard_gravity = lbf
force_ounce = force_pound / 16 = ozf
force_kilogram = kilogram * standard_gravity = kgf
hertz = 1 / second = Hz
revolutions_per_minute = turn / minute = rpm
revolutions_per_second = turn / second = rps
watt = joule / second = W
volt = watt / ampere = V
ohm = volt / ampere
pascal = newton / meter ** 2 = Pa
bar = 100000 * pascal
pound_per_square_inch = force_pound / inch ** 2 = psi
""".strip().splitlines()

#: SI unit -> what it measures, and how people write it.
_QUANTITIES: Mapping[str, tuple[str, str]] = {
    "1": ("a pure number", "1 or %"),
    "s": ("a time", "s or ms"),
    "rad": ("an angle", "rad or deg"),
    "rad/s": ("an angular velocity", "rad/s, deg/s or rpm"),
    "rad/s^2": ("an angular acceleration", "rad/s^2 or deg/s^2"),
    "N*m": ("a torque", "N*m, Nm or lbf*in"),
    "N*m/kg": ("a torque per body mass", "N*m/kg"),
    "N*m/rad": ("a stiffness", "N*m/rad or Nm/deg"),
    "N*m*s/rad": ("a damping", "N*m*s/rad or Nms/rad"),
    "kg*m^2": ("an inertia", "kg*m^2"),
    "N*m/A": ("a torque constant", "N*m/A"),
    "A": ("a current", "A or mA"),
    "V": ("a voltage", "V or mV"),
    "ohm": ("a resistance", "ohm"),
    "N": ("a force", "N or lbf"),
    "m/s^2": ("an acceleration", "m/s^2"),
    "kg": ("a mass", "kg"),
    "m": ("a length", "m or mm"),
    "m/s": ("a speed", "m/s"),
    "Pa": ("a pressure", "Pa or kPa"),
    "J": ("an energy", "J"),
    "W": ("a power", "W"),
    "Hz": ("a frequency", "Hz"),
    "K": ("a temperature", "K or degC"),
}
_EXAMPLES = "N*m, Nm/rad, deg, rad/s, rpm, mA, ms, mV, %"

#: Signs that are not letters, rewritten; longer ones first.
_SPELLINGS: Mapping[str, str] = {
    **dict.fromkeys(("U/min", "Umdr/min", "tr/min", "giri/min", "omw/min"), "rpm"),
    **dict.fromkeys(("U/s", "Umdr/s", "tr/s"), "rps"),
    " per ": "/",
    "é": "e",
    "hh:mm:ss": "s",
    "°C": "degC",
    "**": "^",
    "⁻¹": "^-1",
    "⁻²": "^-2",
    "²": "^2",
    "³": "^3",
    "°": "deg",
    "%": "percent",
    "\N{MICRO SIGN}": "u",
    "\N{GREEK SMALL LETTER MU}": "u",
    "Ω": "ohm",
    "·": "*",
    "⋅": "*",
}
_TOKEN = re.compile(r"[A-Za-z]+|-?\d+|[*/.^()-]")
#: Words of other languages.
_WORDS: Mapping[str, str] = {
    **dict.fromkeys(("grad", "grados", "gradi", "graden", "degres"), "degree"),
    **dict.fromkeys(("sek", "sekunden", "secondes", "segundos", "secondi", "seconden"), "second"),
    **dict.fromkeys(("newtonmeter", "newtonmeters"), "Nm"),
}
#: A pound times a length is a torque; a mass times a length measures nothing here.
_POUND_LENGTH = re.compile(
    r"(?P<length>ft|in)[-. ]?lbf?s?|lbf?s?[-. ]?(?P<after>ft|in)", re.IGNORECASE
)
_POWER = re.compile(r"-?\d")
_COUNT = re.compile(r"[1-9]\d+")
_NEWTON_METER = re.compile(r"(?P<prefix>[mku]?)N(?P<meter>m|mm|cm)(?P<second>s?)")
_NEWTON_METER_SLIP = re.compile(r"[mk]?nm(?P<second>s?)", re.IGNORECASE)
_PREFIXES: Mapping[str, str] = {"": "", "m": "milli", "k": "kilo", "u": "micro"}
_METERS: Mapping[str, str] = {"m": "meter", "cm": "centimeter", "mm": "millimeter"}
_WRITTEN = (
    *("rad", "deg", "s", "ms", "min", "A", "mA", "V", "mV", "N", "kN", "rpm", "Hz", "kg", "m"),
    *("cm", "mm", "lbf", "in", "ft", "J", "W", "Pa", "kPa", "K", "degC", "newton", "meter"),
    *("degree", "radian", "second", "ampere", "volt", "percent", "rps"),
)
_SHORTEST_CAPITALS = 3  # DEG/SEC; "MA" may be mA, or a slip
_SHORTEST_PLURAL = 4  # "rads" and "degrees" are plurals; "Ns" and "As" are products


@dataclass(frozen=True, slots=True)
class _Unit:
    dimension: Mapping[str, float]  # base dimension -> power
    factor: float  # to pint's root units
    offset: float  # zero of the unit, in pint's root units


def conversion(unit: str, si_unit: str) -> tuple[float, float]:
    """Return factor and offset that take a unit to SI."""
    source, target = _parse(unit), _parse(si_unit)
    if si_unit == "rad/s" and source == _parse("1/min"):  # as the speed of a motor is written
        source = _parse("rpm")
    if source.dimension != target.dimension:
        what, examples = _QUANTITIES.get(si_unit, ("something else", si_unit))
        known_unit = _known_si(source.dimension)
        name = _QUANTITIES[known_unit][0].split(" ", 1)[1] if known_unit else ""
        measured = name or _base_si(source.dimension)
        hint = " A torque is written N*m, not J." if (known_unit, si_unit) == ("J", "N*m") else ""
        raise UnitError(
            f"'{unit}' measures {measured}, expected {what} such as {examples}."
            f"{hint} Correct the unit."
        )
    return source.factor / target.factor, source.offset


def si_unit_of(unit: str) -> tuple[str, float, float]:
    """Return the SI unit of the same quantity, with factor and offset to it."""
    source = _parse(unit)
    si_unit = _known_si(source.dimension) or _base_si(source.dimension)
    return si_unit, source.factor / _parse(si_unit).factor, source.offset


def _known_si(dimension: Mapping[str, float]) -> str | None:
    return next((si for si in _QUANTITIES if _parse(si).dimension == dimension), None)


def _base_si(dimension: Mapping[str, float]) -> str:
    """Write a quantity without a name of its own in base units."""
    names = {"[time]": "s", "[length]": "m", "[mass]": "kg", "[current]": "A"}
    names |= {"[temperature]": "K", "[angle]": "rad", "[energy]": "J"}
    powers = [(names[d], p) for d, p in dimension.items()]
    over = [_power(name, p) for name, p in powers if p > 0]
    under = [_power(name, -p) for name, p in powers if p < 0]
    return "/".join(["*".join(over) or "1", *under])


def _power(name: str, power: float) -> str:
    return name if power == 1 else f"{name}^{power:g}"


@cache
def _registry() -> Any:  # pint.UnitRegistry, whose own types hide that magnitudes are floats
    import pint

    registry: Any = pint.UnitRegistry(None)
    registry.load_definitions(_DEFINITIONS)
    return registry


@cache
def _parse(unit: str) -> _Unit:
    import pint

    registry = _registry()
    units = _Parser(unit).units()
    factor, _ = registry.get_root_units(units, check_nonmult=False)
    try:
        offset = registry.Quantity(0.0, units).to_root_units().magnitude
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError) as exc:  # degC/s
        raise _unreadable(unit, "K") from exc
    dimension = {str(name): float(power) for name, power in units.dimensionality.items()}
    return _Unit(dimension, float(factor), float(offset))


class _Parser:
    """Reads ``product := power (["*" | "."| "-" | "/"] power)*``, ``power := atom [["^"] int]``."""

    def __init__(self, unit: str) -> None:
        self.unit = unit
        text = unit.strip()
        for spelled, plain in _SPELLINGS.items():
            text = text.replace(spelled, plain)
        if pound := _POUND_LENGTH.fullmatch(text):
            text = f"lbf*{(pound['length'] or pound['after']).lower()}"
        self.tokens = _TOKEN.findall(text)
        if "".join(self.tokens) != re.sub(r"\s", "", text):
            raise _unreadable(unit)

    def units(self) -> Any:
        product = self._product() if self.tokens else _registry().Unit("")
        if self.tokens:
            raise _unreadable(self.unit)
        return product

    def _product(self) -> Any:
        product = self._power()
        while self.tokens and self.tokens[0] != ")":
            operator = self.tokens.pop(0) if self.tokens[0] in "*./-" else "*"
            if operator == "/" and self.tokens and _COUNT.fullmatch(self.tokens[0]):
                product = product / _count(self.tokens.pop(0))  # turn/16384: a tick of an encoder
            else:
                product = product / self._power() if operator == "/" else product * self._power()
        return product

    def _power(self) -> Any:
        atom = self._atom()
        marked = self._next_is("^")
        if self.tokens and _POWER.fullmatch(self.tokens[0]):
            return atom ** int(self.tokens.pop(0))
        if marked:
            raise _unreadable(self.unit)
        return atom

    def _atom(self) -> Any:
        token = self.tokens.pop(0) if self.tokens else ""
        if token == "(":
            inner = self._product()
            if not self._next_is(")"):
                raise _unreadable(self.unit)
            return inner
        if token == "1":
            return _registry().Unit("")
        if not token.isalpha():
            raise _unreadable(self.unit)
        return _registry().Unit(_resolved(self.unit, token))

    def _next_is(self, token: str) -> bool:
        if self.tokens and self.tokens[0] == token:
            self.tokens.pop(0)
            return True
        return False


def _count(number: str) -> Any:
    name = f"count_{number}"
    if name not in _registry():
        _registry().define(f"{name} = {number}")
    return _registry().Unit(name)


def _resolved(unit: str, name: str) -> str:
    name = _WORDS.get(name.casefold(), name)
    if compact := _NEWTON_METER.fullmatch(name):
        seconds = "*second" if compact["second"] else ""
        return f"{_PREFIXES[compact['prefix']]}newton*{_METERS[compact['meter']]}{seconds}"
    if slip := _NEWTON_METER_SLIP.fullmatch(name):
        raise _unreadable(unit, "N*m*s" if slip["second"] else "N*m")
    candidates = [
        (prefix, whole)
        for prefix, whole, plural in _registry().parse_unit_name(name)
        if not plural or len(name) >= _SHORTEST_PLURAL
    ]
    if not candidates and name.isupper() and len(name) >= _SHORTEST_CAPITALS:
        return _resolved(unit, name.lower())
    if not candidates:
        raise _unreadable(unit, _guess(name))
    prefix, whole = min(candidates, key=lambda c: len(c[0]))  # "min" is no milli-inch
    return f"{prefix}{whole}"


def _guess(name: str) -> str | None:
    same = [w for w in _WRITTEN if w.casefold() == name.casefold().removesuffix("s")]
    same = [w for w in _WRITTEN if w.casefold() == name.casefold()] or same
    return next(iter(same or difflib.get_close_matches(name, _WRITTEN, n=1)), None)


def _unreadable(unit: str, guess: str | None = None) -> UnitError:
    hint = f" Did you mean {guess}?" if guess else ""
    return UnitError(
        f"'{unit}' is not a unit that can be read; expected one such as {_EXAMPLES}.{hint}"
    )
