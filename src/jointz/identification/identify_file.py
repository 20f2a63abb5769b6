"""Identify one recording that stands in a file by itself."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jointz.core.errors import DataError
from jointz.identify.actuators.actuator import identify_actuator
from jointz.identify.actuators.bandwidth import identify_bandwidth
from jointz.identify.series.joint import identify_joint
from jointz.io.one_recording import read_channels
from jointz.io.text.column_arguments import Column
from jointz.results.bench.actuator_fit import ActuatorFit
from jointz.results.bench.bandwidth_fit import BandwidthFit
from jointz.results.series.frequency_response_fit import FrequencyResponseFit
from jointz.results.series.impulse_response_fit import ImpulseResponseFit
from jointz.results.series.joint_fit import JointFit
from jointz.results.series.reflex_fit import ReflexFit


def identify_joint_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[JointFit | ImpulseResponseFit | FrequencyResponseFit | ReflexFit, dict[str, Column]]:
    """Identify a joint from one time series in a file."""
    _check_time_or_rate(columns, rate_hz)
    recording, parsed = read_channels(file, columns, files)
    with _named(file, parsed):
        return identify_joint(recording, rate_hz=rate_hz, **settings), parsed


def identify_bandwidth_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[BandwidthFit, dict[str, Column]]:
    """Find the torque bandwidth in one time series in a file."""
    _check_time_or_rate(columns, rate_hz)
    recording, parsed = read_channels(file, columns, files)
    with _named(file, parsed):
        return identify_bandwidth(recording, rate_hz=rate_hz, **settings), parsed


def identify_actuator_file(
    file: Path,
    columns: Mapping[str, str],
    *,
    files: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    **settings: Any,
) -> tuple[ActuatorFit, dict[str, Column]]:
    """Fit a torque model to one bench record in a file."""
    if "time" in columns and rate_hz is not None:
        raise DataError("Give --time COL[:unit] or --rate HZ or neither, not both.")
    recording, parsed = read_channels(file, columns, files)
    with _named(file, parsed):
        return identify_actuator(recording, rate_hz=rate_hz, **settings), parsed


def _check_time_or_rate(columns: Mapping[str, str], rate_hz: float | None) -> None:
    if ("time" in columns) == (rate_hz is not None):
        raise DataError("Give either --time COL[:unit] or --rate HZ, one of them.")


@contextmanager
def _named(file: Path, columns: Mapping[str, Column]) -> Iterator[None]:
    """Say in which file, and in which of its columns, the samples cannot be trusted."""
    try:
        yield
    except DataError as exc:
        where, column = file.name, columns.get(exc.channel or "")
        if column is not None:
            where += f", column '{column.name}'"
        channel = column.name if column is not None else exc.channel
        raise DataError(f"{where}: {exc}", path=str(file), channel=channel, row=exc.row) from exc

