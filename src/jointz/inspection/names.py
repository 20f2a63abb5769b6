"""Meaning of column names: words, units, joints, sides, and channels of a study."""

import re
import tomllib
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import pairwise

from jointz.core.channels import CHANNEL_UNITS
from jointz.core.units import si_unit_of
from jointz.io.text.column_names import is_unit, unit_in_name, written_unit

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


def word_set(text: str) -> frozenset[str]:
    """Return the words of a text as a set."""
    return frozenset(text.split())


_NO_UNIT_TEXTS = ("--", "na", "a.u.", "au", "bool", "counts", "text")
#: English word -> words of other languages for it.
_OTHER_LANGUAGES: Mapping[str, str] = tomllib.loads(
    files("jointz.inspection").joinpath("words.toml").read_text("utf-8")
)
_ENGLISH: Mapping[str, str] = {
    other: word for word, others in _OTHER_LANGUAGES.items() for other in others.split()
}
_SHORTEST_PART = 4  # of a word that stands in a longer one, as in Kniewinkel

JOINTS = ("knee", "ankle", "hip", "elbow", "wrist", "shoulder")
SIDES: Mapping[str, str] = {"right": "right", "left": "left", "r": "right", "l": "left"}
#: Words that name the positive direction.
DIRECTIONS = ("plantarflexion", "dorsiflexion", "flexion", "extension")
#: Words of names in recordings of walking.
GAIT_WORDS = word_set(
    "grf gait stride treadmill footswitch contact heel foot walk walking belt cop fsr stance"
)


@dataclass(frozen=True, slots=True)
class Words:
    """Words of a name, and their meaning; "" for none."""

    # single words and pairs of adjacent ones, in small letters
    found: frozenset[str] = field(default_factory=frozenset)
    joint: str = ""
    side: str = ""
    direction: str = ""
    unit: str = ""  # in a spelling that :mod:`jointz.core.units` reads


def words_of(name: str) -> Words:
    """Split a name into words."""
    parts = [word.casefold() for word in _WORD.findall(without_accents(name))]
    parts += [inner for part in parts for inner in _inner_words(part)]
    joined = [*parts, *(a + b for a, b in pairwise(parts))]
    found = frozenset([*joined, *(_ENGLISH[word] for word in joined if word in _ENGLISH)])
    return Words(
        found,
        joint=next((joint for joint in JOINTS if joint in found), ""),
        side=next((side for word, side in SIDES.items() if word in found), ""),
        direction=next((d for d in DIRECTIONS if d in found), ""),
        unit=written_unit(name),
    )


def is_of_strikes(name: str) -> bool:
    """Return whether a column or an event is called heel strikes."""
    return bool(words_of(name).found & _STRIKES)


def without_accents(text: str) -> str:
    """Return a text with plain letters."""
    letters = unicodedata.normalize("NFKD", text.replace("ß", "ss"))
    return "".join(c for c in letters if not unicodedata.combining(c))


def _inner_words(part: str) -> list[str]:
    """Return the known words at both ends of a compound."""
    if part in _ENGLISH:
        return []
    words = (*_ENGLISH, *_OTHER_LANGUAGES, "moment")
    known = (word for word in words if _SHORTEST_PART <= len(word) < len(part))
    return [word for word in known if part.startswith(word) or part.endswith(word)]


def unreadable_unit(name: str, stated: str) -> str:
    """Return the unit of a column that cannot be read, "" if there is none."""
    unit = (stated or unit_in_name(name)).strip()
    known = unit.isdecimal() or unit.casefold() in _NO_UNIT_TEXTS or is_unit(unit)
    return "" if known else unit


@dataclass(frozen=True, slots=True)
class _Rule:
    """Names of a channel: they have any of some words, and none of others."""

    channel: str
    any_of: frozenset[str]
    none_of: frozenset[str] = frozenset()
    and_of: frozenset[str] = frozenset()  # one of these is needed, too; empty: none
    score: int = 2

    def fits(self, words: frozenset[str]) -> bool:
        return bool(
            words & self.any_of
            and not words & self.none_of
            and (not self.and_of or words & self.and_of)
        )


#: Words of heel strikes as times.
_STRIKES = word_set(
    "heelstrike heelstrikes footstrike footstrikes strike strikes initialcontact hs rhs lhs"
)
_AXES = word_set("posx posy posz x y z com cop")
_TORQUES = word_set("torque moment tau trq")
_ANGLES = word_set("angle ang position pos theta goniometer gonio encoder enc q")
_BENDS = word_set("flexion extension")  # a torque has such a direction, too
_COMMANDED = word_set("command cmd commanded desired des setpoint target demand")
_MOTOR = word_set("motor mot act actuator")  # codespell:ignore mot
_RATES = word_set("velocity vel speed rate omega acceleration acc accel")
_GYROSCOPE = word_set("gyro gyroscope gyr angularvelocity velocity vel rate omega")
#: Which of three axes is the joint's no name tells.
_NOT_SENSED = _COMMANDED | _AXES | word_set("acceleration acc accel accelerometer mag")
_RULES = (
    _Rule("time", word_set("time t timestamp stamp sec seconds clock s micros millis xvalue"),
          word_set("point to lag")),
    _Rule("trial", word_set("trial run rep repetition block trialno"), score=3),
    _Rule("cycle", word_set("stride strideno cyclenumber stridenumber"), score=2),
    _Rule("condition", word_set("condition cond phase mode perturbed"),
          _ANGLES | _TORQUES),
    _Rule("contact", word_set("contact footswitch fsr heelswitch stance switch fs"), score=3),
    _Rule("ground_reaction_force", word_set("grf vgrf fz fory forz groundreaction loadcellz"),
          _TORQUES, score=3),
    _Rule("trigger", word_set("trigger trig ttl pulse pulses"),
          _TORQUES | _ANGLES | _COMMANDED | word_set("count rate width no"), score=3),
    _Rule("command", _COMMANDED | word_set("perturbation pert reference ref"),
          _ANGLES | word_set("current response"), _TORQUES, 4),
    _Rule("command", word_set("command cmd commanded"),
          _ANGLES | word_set("current speed velocity")),
    _Rule("reference", word_set("reference ref") | _COMMANDED, word_set("current"), _ANGLES, 4),
    _Rule("current", word_set("current curr cur amps iq"), _COMMANDED, score=3),
    _Rule("motor_velocity", _MOTOR, _TORQUES | _COMMANDED,
          word_set("speed velocity vel omega"), 4),
    _Rule("motor_acceleration", _MOTOR, _TORQUES | _COMMANDED,
          word_set("acceleration acc accel"), 4),
    _Rule("motor_angle", _MOTOR, _TORQUES | _COMMANDED, _ANGLES, 4),
    _Rule("shank_velocity", word_set("shank tibia calf shin"), _NOT_SENSED, _GYROSCOPE, 4),
    _Rule("thigh_velocity", word_set("thigh femur"), _NOT_SENSED, _GYROSCOPE, 4),
    _Rule("joint_encoder", word_set("encoder enc"), _MOTOR | _TORQUES | _NOT_SENSED | _RATES,
          score=3),
    _Rule("torque", _TORQUES, _COMMANDED | _AXES | word_set("momx momy momz motor"), score=3),
    _Rule("velocity", word_set("velocity vel omega angularvelocity"),
          word_set("belt treadmill motor com walking gait") | _AXES),
    _Rule("angle", _ANGLES | _BENDS, _TORQUES | _COMMANDED | _AXES | word_set(
          "motor scheduling reference ref velocity vel speed rate acceleration sd toe"), score=3),
)  # fmt: skip
#: Words of columns of uncertainty, which are no signals.
_UNCERTAINTIES = word_set("cov covar covariance sigma variance p00 p11 p12 p21 p22 p33")
#: Words of columns that are no channel of the joint, whatever their unit.
_NOT_JOINT = _MOTOR | _UNCERTAINTIES | word_set("scheduling reference ref sd std error")
_INSOLE = word_set("heel foot toe insole sole")
#: Words that raise or lower the score of a column.
_PREFERRED = word_set("measured sensor adc loadcell joint exo actual knee filtered")
_AVOIDED = word_set("raw estimated model calc calculated error sd std var perkg encoder enc")


def channel_scores(words: Words) -> dict[str, int]:
    """Return the channels of a study that fit a name, with scores."""
    scores: dict[str, int] = {}
    for rule in () if words.found & _UNCERTAINTIES else _RULES:
        if rule.fits(words.found):
            more = bool(words.found & _PREFERRED) - bool(words.found & _AVOIDED)
            scores[rule.channel] = max(scores.get(rule.channel, 0), 2 * rule.score + more)
    for channel in _by_unit(words):
        scores.setdefault(channel, 1)
    return {c: s for c, s in scores.items() if _unit_allows(c, words.unit)}


def _by_unit(words: Words) -> list[str]:
    """Return the channels that fit a unit, if no words do: ``Knee_deg``, ``M_Nm``."""
    if words.found & (_COMMANDED | _AXES | _NOT_JOINT):
        return []
    si_unit = si_unit_of(words.unit)[0] if words.unit else ""
    found = ["angle"] if si_unit == "rad" and words.joint else []
    found += ["torque"] if si_unit == "N*m" else []
    return found + (["contact"] if words.found & _INSOLE else [])


def _unit_allows(channel: str, unit: str) -> bool:
    """Tell whether a unit fits a channel, per body mass or not."""
    if not unit or channel not in CHANNEL_UNITS:
        return True
    si_unit = si_unit_of(unit)[0]
    return si_unit.removesuffix("/kg") in CHANNEL_UNITS[channel] or (
        channel == "ground_reaction_force" and si_unit in ("N", "m/s^2")  # N/kg
    )
