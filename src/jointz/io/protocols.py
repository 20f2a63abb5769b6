"""Read protocols: those that come with jointz, and the user's own."""

import difflib
import os
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

from pydantic import ValidationError

from jointz.core.errors import ProtocolError
from jointz.core.protocols.protocol import Protocol
from jointz.io.small_files import file_content, parse_toml
from jointz.io.toml_problems import all_problems

_SUFFIX = ".toml"
#: Profile of a controller that comes with jointz; any other is a file.
PUBLISHED = "published"


@cache
def builtin_protocols() -> Mapping[str, str]:
    """Return name and title of every protocol that comes with jointz.

    Examples
    --------
    >>> list(builtin_protocols())[-2:]
    ['walking', 'walking-pilot']
    """
    folder = files("jointz.io") / "protocols_builtin"
    texts = {
        f.name.removesuffix(_SUFFIX): f.read_text("utf-8")
        for f in folder.iterdir()
        if f.name.endswith(_SUFFIX)
    }
    return MappingProxyType({name: tomllib.loads(texts[name])["title"] for name in sorted(texts)})


def protocol_text(name_or_path: str | os.PathLike[str]) -> str:
    """Return a protocol as it is written, comments included.

    Parameters
    ----------
    name_or_path : str or path
        Name of a built-in protocol, or a file.

    Raises
    ------
    DataError
        When there is no such protocol, or the file cannot be read.
    """
    return _content(name_or_path).decode("utf-8-sig", errors="replace")


def load_protocol(name_or_path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol and check everything that can be checked without a device.

    Parameters
    ----------
    name_or_path : str or path
        Name of a built-in protocol, or a file.

    Returns
    -------
    Protocol
        The protocol, ready for :func:`jointz.run`.

    Raises
    ------
    ProtocolError
        With every problem found, each with the key's full path.
    DataError
        When there is no such protocol, or the file cannot be read.

    Examples
    --------
    >>> load_protocol("walking").participants
    10
    """
    where = os.fspath(name_or_path)
    raw = parse_toml(where, _content(name_or_path), error=ProtocolError)
    try:
        protocol = Protocol.model_validate(raw)
    except ValidationError as exc:
        raise ProtocolError(where, all_problems(exc, Protocol, raw)) from exc
    return _with_absolute_profiles(protocol, Path(where).parent.absolute())


def _with_absolute_profiles(protocol: Protocol, folder: Path) -> Protocol:
    """Return a protocol whose profiles can be read from any working directory."""
    conditions = []
    for condition in protocol.conditions:
        spec = condition.controller
        if spec is not None and spec.profile not in (None, PUBLISHED):
            profile = os.path.normpath(folder / str(spec.profile))
            changed = {"controller": spec.model_copy(update={"profile": profile})}
            condition = condition.model_copy(update=changed)
        conditions.append(condition)
    return protocol.model_copy(update={"conditions": tuple(conditions)})


def _content(name_or_path: str | os.PathLike[str]) -> bytes:
    name = os.fspath(name_or_path)
    if isinstance(name_or_path, str) and name in builtin_protocols():
        return (files("jointz.io") / "protocols_builtin" / f"{name}{_SUFFIX}").read_bytes()
    return file_content(name, absent=_unknown(name))


def _unknown(name: str) -> str:
    known = sorted(builtin_protocols())
    close = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    return (
        f"'{name}': neither a protocol of jointz ({', '.join(known)}) nor a file.{hint} "
        "Correct the name; jointz protocols show NAME prints one to start from."
    )
