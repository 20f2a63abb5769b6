"""Reader of small JSON and TOML files that refuses damaged, special and oversized ones."""

import json
import math
import os
import tomllib
from pathlib import Path
from typing import Any, NoReturn

from jointz.core.errors import DataError, DeviceFileError, ProtocolError, StudyError
from jointz.io.file_kinds import special_kind

_INTEGERS = range(-(2**63), 2**63)  # those of TOML
_LARGEST_BYTES = 20_000_000
#: Of an analysis.json: every pulse of every person.
LARGEST_RESULTS = 1_000_000_000


def file_content(
    name: str | os.PathLike[str], *, absent: str, largest: int = _LARGEST_BYTES
) -> bytes:
    """Return the bytes of a regular file; ``absent`` is the message where there is none."""
    path = os.fspath(name)
    if (kind := special_kind(path)) not in ("", "a folder"):  # reading it may never end
        raise DataError(f"{path}: is {kind}; expected a file. Correct the name.", path=path)
    if not os.path.isfile(path):  # unlike Path.is_file it holds for names no system takes
        raise DataError(absent, path=path)
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(largest + 1)
    except OSError as exc:
        raise DataError(f"{path}: cannot be read ({exc.strerror}).", path=path) from exc
    if len(content) > largest:
        text = f"{path}: larger than {largest / 1e6:g} MB, which no such file is. Correct the name."
        raise DataError(text, path=path)
    return content


def read_json(
    name: str | os.PathLike[str], todo: str, *, largest: int = _LARGEST_BYTES, finite: bool = True
) -> dict[str, Any]:
    """Return the object in a JSON file; ``todo`` ends the message about any other file."""
    path = os.fspath(name)
    content = file_content(path, absent=f"{path}: no such file. {todo}", largest=largest)
    try:
        value = json.loads(
            content.decode("utf-8-sig"),
            parse_constant=_refused if finite else None,
            parse_float=_finite if finite else None,
            parse_int=_integer,
        )
    except (ValueError, RecursionError) as exc:
        raise DataError(f"{path}: cannot be read as JSON ({exc}). {todo}", path=path) from exc
    if not isinstance(value, dict):
        found = f"expected a JSON object, found {type(value).__name__}"
        raise DataError(f"{path}: cannot be read ({found}). {todo}", path=path)
    return value


def parse_toml(
    where: str,
    text: bytes,
    *,
    error: type[StudyError] | type[ProtocolError] | type[DeviceFileError],
) -> dict[str, Any]:
    """Parse a TOML file."""
    try:
        raw = tomllib.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as exc:
        raise error(where, [f"not valid TOML: {exc}"]) from exc
    if _holds_huge_integer(raw):
        raise error(where, ["not valid TOML: an integer has more than 64 bits."])
    return raw


def _holds_huge_integer(value: Any) -> bool:
    if isinstance(value, dict):
        return any(map(_holds_huge_integer, value.values()))
    if isinstance(value, list):
        return any(map(_holds_huge_integer, value))
    return isinstance(value, int) and value not in _INTEGERS


def _refused(text: str) -> NoReturn:
    raise ValueError(f"{text[:40]} is no number that a file may hold")


def _finite(text: str) -> float:
    return value if math.isfinite(value := float(text)) else _refused(text)


def _integer(text: str) -> int:
    return value if (value := int(text)) in _INTEGERS else _refused(text)
