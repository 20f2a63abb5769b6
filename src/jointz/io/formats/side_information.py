"""One line of JSON in a Parquet file, for what its columns cannot hold."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup

_VERSION = 1
_OF_A_SAMPLE = 1e-3  # how far a time may be from that of the rate: as it was rounded


@dataclass(frozen=True, slots=True)
class SideInformation:
    """Everything of an acquisition of one group but its samples."""

    group: SignalGroup  # with names, units and descriptions of its signals, but no samples
    stamped: bool  # whether time stamps are its clock, instead of a rate or none
    events: tuple[Event, ...]
    metadata: dict[str, str]


def read_beside(text: str) -> SideInformation:
    """Read the line that earlier versions of jointz wrote."""
    try:
        content = json.loads(text)
        if content["version"] != _VERSION:
            raise ValueError(
                f"version {content['version']} of the jointz line, expected {_VERSION}"
            )
        return SideInformation(
            group=_group(content),
            stamped=bool(content["stamped"]),
            events=tuple(Event(float(t), str(name), float(d)) for t, name, d in content["events"]),
            metadata={str(k): str(v) for k, v in content["metadata"].items()},
        )
    except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as exc:
        raise ValueError(f"the jointz line is damaged ({type(exc).__name__}: {exc})") from exc


def _group(content: dict[str, Any]) -> SignalGroup:
    kinds = {True: object, False: np.float64}
    signals = tuple(
        Signal(str(name), np.empty(0, kinds[bool(text)]), str(unit), str(description))
        for name, unit, description, text in content["signals"]
    )
    rate = content["rate_hz"]
    return SignalGroup(
        str(content["group"]),
        signals,
        None if rate is None else float(rate),
        float(content["start_s"]),
    )


def filled(
    side: SideInformation,
    columns: Mapping[str, np.ndarray],
    stamps: np.ndarray | None,
    *,
    labels: Sequence[str],
) -> Acquisition:
    """Put samples into what was read beside them."""
    if list(columns) != list(labels):
        raise ValueError("the jointz line tells of other columns than the table has")
    kinds = [signal.is_text for signal in side.group.signals]
    if kinds != [values.dtype.kind == "O" for values in columns.values()]:
        raise ValueError("the jointz line tells of other columns of text than the table has")
    signals = tuple(
        replace(signal, values=values)
        for signal, values in zip(side.group.signals, columns.values(), strict=True)
    )
    _check_clock(side, stamps)
    group = replace(side.group, signals=signals, time_s=stamps if side.stamped else None)
    return Acquisition((group,), side.events, side.metadata)


def _check_clock(side: SideInformation, stamps: np.ndarray | None) -> None:
    """Refuse a column of time that is missing, or that another program changed."""
    rate, start = side.group.rate_hz, side.group.start_s
    if not side.stamped and rate is None:
        if stamps is not None:
            raise ValueError("the jointz line tells of no clock, the table has a column of time")
        return
    if stamps is None:
        raise ValueError("the jointz line tells of a clock, the table has no column of time")
    if side.stamped or rate is None:
        return
    at = _first_other_time(stamps, rate, start)
    if at is not None:
        raise ValueError(
            f"the jointz line tells of {rate:g} Hz, and sample {at + 1} is at {stamps[at]:.9g} s, "
            f"not at {start + at / rate if rate else np.nan:.9g} s"
        )


def _first_other_time(stamps: np.ndarray, rate_hz: float, start_s: float) -> int | None:
    """Return the first sample that is not where its rate puts it, but for rounding; else None."""
    with np.errstate(all="ignore"):
        times = start_s + np.arange(len(stamps)) / np.float64(rate_hz)
        same = (stamps == times) | (np.isnan(stamps) & np.isnan(times))
        same |= np.abs(stamps - times) * abs(rate_hz) <= _OF_A_SAMPLE
    return None if same.all() else int(np.flatnonzero(~same)[0])
