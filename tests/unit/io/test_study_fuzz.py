"""Whatever stands in study.toml: a study, or an error that says what is wrong."""

import copy
import tomllib
from collections.abc import Mapping
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jointz.core.errors import DataError
from jointz.core.study import Study
from jointz.io.study_reader import open_study
from jointz.io.toml_text import written_key, written_text

fuzz = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80
)

# --- a TOML writer as small as the tests need ----------------------------------------------------


def toml_value(value: Any) -> str:
    """Write one value; tables inline, so that any value may stand anywhere."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)  # inf and nan are TOML too
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        return written_text(value)
    if isinstance(value, (date, datetime, time)):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{" + toml_text(value, end=",").removesuffix(",") + "}"
    return "[" + ", ".join(map(toml_value, value)) + "]"


def toml_text(document: Mapping[str, Any], end: str = "\n") -> str:
    return "".join(f"{written_key(k)} = {toml_value(v)}{end}" for k, v in document.items())


def test_the_writer_writes_what_toml_reads(study):
    document = tomllib.loads(study.text) | {'odd "key"\n': [1, {"a": "\t\\"}, True, -0.5]}

    assert tomllib.loads(toml_text(document)) == document


# --- spoiling a document -------------------------------------------------------------------------

TEXTS = st.one_of(
    st.text(st.characters(codec="utf-8"), max_size=12),
    st.sampled_from(["", " ", "rad", "N*m", "deg", "knee", "perturbed", "nan", "0", "1e5"]),
    st.sampled_from(["command", "angle", "S01", "S02", "S01_enp.csv", "../", "a/b.csv", "é.csv"]),
    st.sampled_from(["$NO_SUCH", "${NO_SUCH:-x}", "\0", "dorsiflexion", "extension", "device"]),
    st.sampled_from(["x" * 300, "x" * 5000 + ".csv", "S01_enp.csv/x", "((((", "N*m" * 50, "."]),
)
SCALARS = st.one_of(
    TEXTS,
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from([10**400, -(10**400), 2**63, 0, -1, 1e308, 1e-308]),
    st.sampled_from([date(2020, 1, 2), datetime(2020, 1, 2, 3, 4), time(3, 4)]),  # noqa: DTZ001
)
KEYS = st.one_of(
    st.text(st.characters(codec="utf-8"), max_size=6),
    st.sampled_from(["unit", "values", "kind", "positive", "condition", "trial", "torque", "id"]),
    st.sampled_from(
        ["sd", "value", "calibration", "angle_gain", "torque_model", "session", "side"]
    ),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=5,
)


def places(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place below a node, each as the keys that lead to it."""
    keys = (
        list(node) if isinstance(node, dict) else range(len(node) if isinstance(node, list) else 0)
    )
    return [p for key in keys for p in ((*path, key), *places(node[key], (*path, key)))]


def at(document: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        document = document[key]
    return document


@st.composite
def spoiled(draw: st.DrawFn, good: dict[str, Any]) -> dict[str, Any]:
    document = copy.deepcopy(good)
    for _ in range(draw(st.integers(1, 3))):
        everywhere = places(document)
        if not everywhere:
            break
        path = draw(st.sampled_from(everywhere))
        parent, key = at(document, path[:-1]), path[-1]
        action = draw(st.sampled_from(["replace", "delete", "add", "repeat", "swap"]))
        if action == "delete":
            del parent[key]
        elif action == "add":
            target = at(document, path) if isinstance(at(document, path), dict) else document
            target[draw(KEYS)] = draw(VALUES)
        elif action == "repeat" and isinstance(parent, list):
            parent.append(copy.deepcopy(parent[key]))
        elif action == "swap":
            parent[key] = copy.deepcopy(at(document, draw(st.sampled_from(everywhere))))
        else:
            parent[key] = draw(VALUES)
    return document


def open_or_refuse(root: Path, content: bytes) -> None:
    """Open a study; anything but a study or a telling error fails the test."""
    (root / "study.toml").write_bytes(content)
    try:
        outcome: Study | DataError = open_study(root)
    except DataError as exc:
        outcome = exc
    if isinstance(outcome, DataError):
        problems = getattr(outcome, "problems", (str(outcome),))
        assert problems
        assert all(problem.strip() for problem in problems)


RICH = """
[channels.current]
column = 3
unit = "mA"
positive = "extension"
[channels.condition]
column = "footswitch"
values = { "0" = "unperturbed", "1" = "perturbed" }
[torque_model]
gear_ratio = 50.0
torque_constant = 0.1
[calibration]
angle_lag_s = { value = 0.0065, sd = 0.0005 }
torque_gain = { value = 1.02, sd = 0.01 }
"""


@fuzz
@given(data=st.data())
def test_a_spoiled_study_opens_or_says_why_not(study, data):
    good = tomllib.loads(study.text + RICH)
    document = data.draw(spoiled(good))

    open_or_refuse(study.root, toml_text(document).encode())


@fuzz
@given(
    start=st.integers(0, 2500),
    length=st.integers(0, 40),
    inserted=st.one_of(
        st.binary(max_size=8),
        st.text(max_size=8).map(lambda s: s.encode("utf-8", "surrogatepass")),
        st.sampled_from([b"[", b"]", b'"', b"=", b"\n", b"{", b"[[", b"9" * 5000, b"[" * 3000]),
    ),
)
def test_damaged_text_opens_or_says_why_not(study, start, length, inserted):
    text = study.text.encode()

    open_or_refuse(study.root, text[:start] + inserted + text[start + length :])
