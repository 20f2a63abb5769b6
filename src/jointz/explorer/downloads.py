"""Downloads of the explorer: tables, figures, and traces of a participant's pulses."""

import io
import re
from collections.abc import Mapping

import numpy as np
import xarray as xr

from jointz.analysis.page.figure_files import FIGURES, draw_figure
from jointz.analysis.results_folder import csv_bytes
from jointz.explorer.traces import PulseKey, PulseTrace, Window
from jointz.results.study_analysis import StudyAnalysis

#: Tables to download, as in a results folder.
TABLES = ("estimates", "comparison", "population", "pulses", "excluded")
_ROWS = {
    "angle": ("rad", "as the method sees it"),
    "torque": ("N*m", "as the method sees it"),
    "baseline_angle": ("rad", "predicted without the pulse"),
    "baseline_torque": ("N*m", "predicted without the pulse"),
    "response_angle": ("rad", "measured minus baseline, times the sign"),
    "response_torque": ("N*m", "measured minus baseline, times the sign"),
}


def table_csv(analysis: StudyAnalysis, name: str) -> bytes:
    """Return a table as ``jointz analyze`` writes it."""
    frames = {
        "estimates": analysis.to_frame,
        "comparison": analysis.comparison_frame,
        "population": analysis.population_frame,
        "pulses": analysis.pulses_frame,
        "excluded": analysis.excluded_frame,
    }
    return csv_bytes(frames[name]())


def figure_svg(analysis: StudyAnalysis, name: str) -> bytes | None:
    """Return a figure of the report, None where the analysis has no data for it."""
    if name not in FIGURES:
        raise ValueError(f"name: expected one of {', '.join(FIGURES)}; got {name!r}.")
    svg = draw_figure(analysis, name)
    return None if svg is None else svg.encode("utf-8")


def traces_netcdf(
    analysis: StudyAnalysis, label: str, traces: Mapping[PulseKey, PulseTrace]
) -> bytes:
    """Return a participant's pulses with baseline, response, fit and residual, as netCDF.

    Dimensions are ``pulse`` and, for each method, ``time_METHOD``. Pulses that a method does not
    use are NaN.
    """
    records = [p for p in analysis.pulses if p.label == label]
    of_pulses = [traces.get(PulseKey.of(p)) for p in records]
    dataset = xr.Dataset(
        {
            "onset_s": ("pulse", [p.onset_s for p in records], {"units": "s"}),
            "recording": ("pulse", [p.recording for p in records]),
            "timing_point": ("pulse", [p.timing_point for p in records]),
            "amplitude": ("pulse", [_number(p.amplitude) for p in records]),
            "measured_pct": ("pulse", [_number(p.measured_pct) for p in records]),
            "code": ("pulse", [p.code for p in records], {"long_name": "reason of exclusion"}),
        },
        attrs={"participant": label, "jointz": str(analysis.provenance.get("jointz", ""))},
    )
    methods = dict.fromkeys(name for trace in of_pulses if trace for name in trace.windows)
    for method in methods:
        windows = [trace.windows.get(method) if trace else None for trace in of_pulses]
        dataset = dataset.assign(_of_method(method, windows))
    file = io.BytesIO()
    dataset.to_netcdf(file, engine="h5netcdf")
    return file.getvalue()


_Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]


def _of_method(method: str, windows: list[Window | None]) -> dict[str, _Variable]:
    first = next(w for w in windows if w is not None)
    dim = f"time_{method}"
    time = {"units": "s", "long_name": "time from the onset"}
    variables: dict[str, _Variable] = {dim: ((dim,), first.time_s, time)}
    unit = "rad" if first.fits == "angle" else "N*m"
    fit = f"{first.fits} of the model fitted to the average of the timing point"
    residual = f"{first.fits} response of the pulse minus the fit"
    signals = _ROWS | {"fitted": (unit, fit), "residual": (unit, residual)}
    for name, (unit, meaning) in signals.items():
        rows = np.full((len(windows), first.time_s.size), np.nan)
        for row, window in zip(rows, windows, strict=True):
            values = None if window is None else getattr(window, name)
            if values is not None:  # a pulse of a slower recording has fewer samples
                n = min(row.size, values.size)
                row[:n] = values[:n]
        about = {"units": unit, "long_name": meaning}
        variables[f"{method}_{name}"] = (("pulse", dim), rows, about)
    return variables


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def file_name(*parts: str) -> str:
    """Return a file name that is valid on every system."""
    *words, ending = parts
    safe = [re.sub(r"[^\w.-]+", "_", word).strip("._") or "unnamed" for word in words]
    return f"{'_'.join(safe)}.{ending}"
