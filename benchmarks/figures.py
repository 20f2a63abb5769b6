"""What the benchmarks measured, beside whom, and what was asked: collected, and kept as JSON."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jointz.core.provenance import software
from jointz.core.whole_file import whole_file

SCHEMA = "jointz.benchmarks/1"
LEAST, MOST = "at least", "at most"


@dataclass(frozen=True, slots=True)
class Peer:
    """Who else does the same.

    Parameters
    ----------
    name : str
        Function of another program; or a bound, or the same work done otherwise.
    version : str
        The program and its version; "" where it is no program.
    """

    name: str
    version: str = ""


def of_package(name: str, package: str) -> Peer:
    """Return a function of an installed package as a peer.

    Parameters
    ----------
    name, package : str
        Of the function, and of the package.
    """
    return Peer(name, f"{package} {version(package)}")


@dataclass(frozen=True, slots=True)
class Asked:
    """What a figure is held against.

    Parameters
    ----------
    value : float
        Of the figure; beside a peer, of the ratio.
    sense : str
        ``at least`` or ``at most``. A ratio is at least so many times (theirs / ours, as for
        speed), or at most so many (ours / theirs, as for errors).
    """

    value: float
    sense: str


def at_least(value: float) -> Asked:
    """Ask for a figure, or for theirs / ours, from a value on.

    Parameters
    ----------
    value : float
        The least.
    """
    return Asked(value, LEAST)


def at_most(value: float) -> Asked:
    """Ask for a figure, or for ours / theirs, up to a value.

    Parameters
    ----------
    value : float
        The most.
    """
    return Asked(value, MOST)


def efficiency(one: Mapping[str, Any], serial: Mapping[str, Any]) -> float:
    """Return the serial time over workers and time of another engine for the same work.

    Parameters
    ----------
    one, serial : mapping
        What ``benchmarks.scale`` measured.
    """
    return float(serial["wall_s"] / one["workers"] / one["wall_s"])


@dataclass(frozen=True, slots=True)
class Figure:
    """One thing that was measured.

    Parameters
    ----------
    what : str
        In words, with the work it was measured on.
    ours : float
        What was measured.
    unit : str
        Of it.
    peer : Peer or None
        Who stands beside it.
    theirs : float or None
        The peer's, in the same unit.
    asked : Asked or None
        What is asked for.
    note : str
        What else there is to say.
    """

    what: str
    ours: float
    unit: str
    peer: Peer | None = None
    theirs: float | None = None
    asked: Asked | None = None
    note: str = ""

    @property
    def ratio_is(self) -> str:
        """Which way round the ratio is; "" without a peer."""
        if self.theirs is None:
            return ""
        return "ours / peer" if self.asked and self.asked.sense == MOST else "peer / ours"

    @property
    def ratio(self) -> float | None:
        """The ratio; None without a peer, or by zero."""
        if self.theirs is None:
            return None
        over, under = self.ours, self.theirs
        if self.ratio_is == "peer / ours":
            over, under = under, over
        return over / under if under else None

    @property
    def met(self) -> bool | None:
        """Whether it is what was asked for; None where nothing was."""
        if self.asked is None:
            return None
        limit = self.asked.value
        if self.theirs is None:
            return self.ours >= limit if self.asked.sense == LEAST else self.ours <= limit
        if self.asked.sense == LEAST:
            return self.theirs >= limit * self.ours
        return self.ours <= limit * self.theirs

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, with what follows from it."""
        follows = {"ratio": self.ratio, "ratio_is": self.ratio_is, "met": self.met}
        return {**asdict(self), **follows}

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> "Figure":
        """Return it from what :meth:`to_dict` returned.

        Parameters
        ----------
        found : mapping
            From JSON.
        """
        given = {name: found[name] for name in ("what", "ours", "unit", "theirs", "note")}
        peer = Peer(**found["peer"]) if found["peer"] else None
        asked = Asked(**found["asked"]) if found["asked"] else None
        return cls(**given, peer=peer, asked=asked)


class Figures:
    """Collects what the benchmarks of a session measure."""

    def __init__(self) -> None:
        self._rows: list[Figure] = []
        self._timings: list[dict[str, Any]] = []
        self._left_out: list[dict[str, str]] = []
        self._failed: list[str] = []

    def alone(self, what: str, ours: float, unit: str, *, asked: Asked | None = None) -> None:
        """Take a figure that nobody stands beside.

        Parameters
        ----------
        what, ours, unit, asked
            As those of a :class:`Figure`.
        """
        self._rows.append(Figure(what, float(ours), unit, asked=asked))

    def beside(
        self,
        what: str,
        peer: Peer,
        times: tuple[float, float],
        unit: str,
        *,
        asked: Asked | None = None,
        note: str = "",
    ) -> None:
        """Take a figure and its peer's.

        Parameters
        ----------
        what, peer, unit, asked, note
            As those of a :class:`Figure`.
        times : tuple of float
            Ours and theirs.
        """
        ours, theirs = map(float, times)
        self._rows.append(Figure(what, ours, unit, peer, theirs, asked, note))

    def left_out(self, what: str, why: str) -> None:
        """Take note of what was not measured, such as a peer that is absent.

        Parameters
        ----------
        what, why : str
            In words.
        """
        self._left_out.append({"what": what, "why": why})

    def timed(self, what: str, stats: Mapping[str, Any]) -> None:
        """Take what pytest-benchmark measured.

        Parameters
        ----------
        what : str
            The test.
        stats : mapping
            Of pytest-benchmark, s.
        """
        kept = {f"{name}_s": float(stats[name]) for name in ("min", "median", "iqr")}
        self._timings.append({"test": what, **kept, "rounds": int(stats["rounds"])})

    def failed(self, test: str) -> None:
        """Take note of a test that did not pass.

        Parameters
        ----------
        test : str
            Its name.
        """
        self._failed.append(test)

    def __bool__(self) -> bool:
        """Tell whether there is anything to write."""
        return bool(self._rows or self._timings or self._left_out or self._failed)

    def to_dict(self) -> dict[str, Any]:
        """Return all of it for JSON, with versions."""
        return {
            "schema": SCHEMA,
            "versions": software(),
            "figures": [row.to_dict() for row in self._rows],
            "timings": self._timings,
            "left_out": self._left_out,
            "failed": self._failed,
        }


def write_json(found: Mapping[str, Any], file: Path) -> None:
    """Write a file of JSON, whole or not at all.

    Parameters
    ----------
    found : mapping
        What stands in it.
    file : pathlib.Path
        Where; its folder is made.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(file) as partial:
        partial.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
