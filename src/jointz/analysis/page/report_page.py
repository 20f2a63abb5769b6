"""Report of an analysis: one HTML page that needs no other file."""

import hashlib
from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from jointz.analysis.page.certificate_section import certificate_section
from jointz.analysis.page.figure_files import figures_by_section
from jointz.analysis.page.first_page import first_page
from jointz.analysis.page.level_tests_section import device_effect_section, level_tests_section
from jointz.analysis.page.method_differences import differences_section
from jointz.analysis.page.next_measures import instrument_shares
from jointz.analysis.page.published_values import published_section
from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_section
from jointz.analysis.page.uncertainty_section import grouped, uncertainty_section
from jointz.analysis.page.value_tables import (
    Row,
    cells_by_person,
    mean_rows,
    mean_text,
    point_order,
    short_status,
)
from jointz.analysis.paper.methods_text import methods_text
from jointz.analysis.summary import (
    fitted_signals,
    mean_over_people_note,
    stiffness_extremes,
    used_coupling,
)
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.grouping import by_key
from jointz.core.method_names import WITH_POSTERIOR
from jointz.report.html_page import render_template
from jointz.report.subjects import subjects
from jointz.report.wording import (
    ABSOLUTE,
    ALL_PARAMETERS,
    AT_ONSET,
    DASH,
    PARAMETERS,
    format_estimate,
    format_number,
    format_span,
    format_spread,
    format_vaf,
    onset_note,
    parameter_name,
    point_name,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import NO_MEANS_ON_A_BENCH, PopulationEstimate, StudyAnalysis
from jointz.results.study_counts import study_counts

#: Longer tables are replaced by a summary and the name of the file with all rows.
_FIRST_ROWS: Final = 6
_HASH_DIGITS: Final = 12

#: From this many participants on, the table has values only, with timing points side by side.
_MANY_PEOPLE: Final = 5
_MOST_COLUMNS: Final = 8
_COUNTS: Final = ("n_strikes", "n_accepted", "n_rejected", "n_gaps")


def render_report(
    analysis: StudyAnalysis,
    figures: Mapping[str, str],
    *,
    title: str,
    truth: pd.DataFrame | None = None,
    accuracy: pd.DataFrame | None = None,
) -> str:
    """Write the report as one HTML page with its figures and styles inside."""
    parameters = _parameters(analysis)
    columns = [name for name in (*ABSOLUTE, *AT_ONSET) if name in parameters]
    words, run = subjects(analysis), analysis.run
    provenance, statistics = analysis.provenance, analysis.statistics
    inputs = _inputs(provenance)
    averaged = [p for p in parameters if f"{p}_per_mass" not in parameters]
    matrix = _matrix(analysis, columns)
    recordings, uncertainty = _recordings(analysis), uncertainty_section(analysis)
    script = Markup(render_template("copy.js.j2") + render_template("fold.js.j2"))
    return render_template(
        "report.html.j2",
        title=title,
        words=words,
        settings={k: v for k, v in analysis.settings.items() if v not in (None, "", {})},
        provenance=provenance,
        first=first_page(analysis),
        extremes=stiffness_extremes(analysis.population),
        no_means=NO_MEANS_ON_A_BENCH,
        averaged=averaged,
        units=PARAMETER_UNITS,
        population=_population_rows(analysis, averaged),
        figures=figures_by_section(analysis, _without_repeats(figures, run)),
        columns=columns,
        vaf=(statistics.get("vaf") or {}).get("mean_pct"),
        people=[]
        if matrix
        else [
            {"id": person, "rows": [_cell_row(c, columns) for c in cells]}
            for person, cells in cells_by_person(analysis.cells).items()
        ],
        matrix=matrix,
        onset_note=onset_note(parameters),
        statuses=study_counts(analysis).statuses,
        warnings=statistics.get("warnings", ()),
        notes=statistics.get("notes", ()),
        excluded=_excluded(analysis),
        names=_names(provenance),
        onsets=statistics.get("onset_accuracy", ()),
        recordings=recordings if len(recordings) <= _FIRST_ROWS else [],
        conditions=_conditions(recordings) if len(recordings) > _FIRST_ROWS else [],
        methods=methods_text(analysis),
        posterior=not words.bench and any(c.method in WITH_POSTERIOR for c in analysis.cells),
        strap=used_coupling(analysis).is_strap,
        common_number=_common_number(analysis),
        mean_note=mean_over_people_note(analysis),
        effects=effects_section(statistics),
        tests=level_tests_section(statistics),
        device_effect=device_effect_section(analysis),
        packages=_packages(provenance),
        inputs=inputs if len(inputs) <= _FIRST_ROWS else [],
        n_inputs=len(inputs),
        study_hash=str(provenance.get("study_sha256", ""))[:_HASH_DIGITS],
        truth=None if truth is None else truth_section(truth, accuracy),
        differences=differences_section(analysis),
        published=published_section(analysis),
        uncertainty=uncertainty,
        instruments=instrument_shares(analysis),
        undecided=grouped(uncertainty["undecided"]) if uncertainty else [],
        certificate=certificate_section(analysis.certificate),
        planned=planned_section(statistics),
        quasi_stiffness=quasi_stiffness_section(analysis),
        fitted=fitted_signals(analysis),
        run=None if run is None else run_section(run),
        sizes=any(row["size"] != DASH for row in inputs),
        script=script,
        script_hash=_script_hash(script),
    )


def _without_repeats(figures: Mapping[str, str], run: RunReport | None) -> dict[str, str]:
    """Leave out the figure of the onsets if the report of the experiment has them in a table."""
    left_out = "onset_accuracy" if run is not None and run.onsets else ""
    return {name: svg for name, svg in figures.items() if name != left_out}


def _script_hash(script: str) -> str:
    """Return the hash that a Content-Security-Policy allows a script by."""
    return f"sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}"


def _parameters(analysis: StudyAnalysis) -> list[str]:
    present = {p.name for cell in analysis.cells for p in cell.parameters}
    return [name for name in ALL_PARAMETERS if name in present]


def _population_rows(analysis: StudyAnalysis, parameters: Sequence[str]) -> list[Row]:
    if not any(m.n_participants > 1 for m in analysis.population):
        return []
    write = partial(_mean_cell, with_n=_common_number(analysis) is None)
    return mean_rows(analysis.cells, analysis.population, parameters, write)


def _common_number(analysis: StudyAnalysis) -> int | None:
    """Return the number of participants that all means share, None if it differs."""
    numbers = {m.n_participants for m in analysis.population if m.value is not None}
    return numbers.pop() if len(numbers) == 1 else None


def _mean_cell(mean: PopulationEstimate | None, *, with_n: bool) -> Row:
    if mean is None:
        return {"text": "", "note": ""}
    text = mean_text(mean)
    if mean.value is None:
        # The table of statuses explains it; in every cell the sentence makes the table too wide.
        return {"text": text, "note": "" if text == "undecided" else status_meaning(mean.status)}
    shown = (mean.value, mean.ci_low, mean.ci_high)
    sd = f"SD {format_spread(mean.sd, *shown)}" if mean.sd is not None else ""
    if mean.sample_sd not in (None, mean.sd):
        sd += f" (sample {format_spread(mean.sample_sd, *shown)})"
    n = f"n {mean.n_participants}" if with_n else ""
    return {"text": text, "note": ", ".join(x for x in (sd, n) if x)}


def _matrix(analysis: StudyAnalysis, columns: Sequence[str]) -> Row | None:
    """Return values of many people with the timing points side by side, None for few people."""
    cells = {(c.label, c.timing_point): c for c in analysis.cells}
    names = [n for n in point_order(analysis.cells) if any(point == n for _, point in cells)]
    people = list(dict.fromkeys(c.label for c in analysis.cells))
    if len(people) < _MANY_PEOPLE or len(names) > _MOST_COLUMNS:
        return None
    return {
        "points": [point_name(n) for n in names],
        "people": [
            {
                "id": person,
                "rows": [
                    {"name": p, "cells": [_matrix_cell(cells.get((person, n)), p) for n in names]}
                    for p in columns
                ],
            }
            for person in people
        ],
    }


def _matrix_cell(cell: CellEstimate | None, name: str) -> str:
    """Return a value without its interval, which the figure shows."""
    estimate = None if cell is None else cell.parameter(name)
    if estimate is None:
        return ""
    if estimate.status == "ok":
        return format_number(estimate.value)
    if estimate.status == "at_bound":
        return f"at most {format_number(estimate.ci_high)}"
    return short_status(estimate.status)


def _cell_row(cell: CellEstimate, columns: Sequence[str]) -> Row:
    estimates = [cell.parameter(name) for name in columns]
    statuses = {p.status for p in estimates if p is not None}
    # If everything failed for one reason, one sentence replaces three dashes.
    common = statuses.pop() if len(statuses) == 1 else ""
    return {
        "name": point_name(cell.timing_point),
        "cells": [None if p is None else _estimate_cell(p) for p in estimates],
        "failure": common if common.startswith("failed") else "",
        "vaf": format_vaf(cell.vaf_pct),
        "n_used": cell.n_used,
        "n": cell.n_used + cell.n_excluded,
    }


def _estimate_cell(estimate: ParameterEstimate) -> Row:
    text = format_estimate(estimate)
    # A dash before the badge would add nothing.
    return {"text": "" if text == DASH else text, "status": estimate.status}


def _excluded(analysis: StudyAnalysis) -> Row:
    frame = analysis.excluded_frame()
    counts = Counter(zip(frame["kind"], frame["code"], strict=True))
    return {
        "counts": [
            {"kind": kind, "code": code, "count": count}
            for (kind, code), count in sorted(counts.items(), key=lambda i: (i[0][0], -i[1]))
        ],
        "first": frame.head(_FIRST_ROWS).to_dict("records") if len(frame) <= _FIRST_ROWS else [],
        "total": len(frame),
    }


def _recordings(analysis: StudyAnalysis) -> list[Row]:
    """Return strides and gaps of each recording; without strides, its gaps only."""
    rows = [dict(row) for row in analysis.statistics.get("strides", ())]
    if rows:
        return rows
    gaps = by_key(((gap.participant, gap.recording), gap.duration_s) for gap in analysis.gaps)
    return [
        {"participant": p, "recording": r, "n_gaps": len(own), "longest_gap_s": max(own)}
        for (p, r), own in gaps.items()
    ]


def _conditions(recordings: Sequence[Row]) -> list[Row]:
    """Return a row for each condition with the totals of its recordings."""
    rows = by_key((str(row.get("condition") or DASH), row) for row in recordings)
    return [
        {
            "condition": condition,
            "n": len(own),
            **{key: sum(r.get(key) or 0 for r in own) for key in _COUNTS},
            "longest_gap_s": max((r.get("longest_gap_s") or 0.0 for r in own), default=0.0),
            "stride": _spanned([r["mean_s"] for r in own if r.get("mean_s")]),
            "sd": _spanned([r["sd_s"] for r in own if r.get("sd_s")]),
        }
        for condition, own in rows.items()
    ]


def _spanned(values: Sequence[float]) -> str:
    return format_span(values, "{:.3f}".format) if values else DASH


def _packages(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    first = [(name, provenance[name]) for name in ("jointz", "python") if provenance.get(name)]
    return first + sorted((provenance.get("packages") or {}).items())


def _names(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Return the name to show of each file, by its name in the study."""
    inputs = provenance.get("inputs") or ()
    return {entry["file"]: entry["name"] for entry in inputs if entry.get("name")}


def _inputs(provenance: Mapping[str, Any]) -> list[Row]:
    return [
        {
            "file": entry.get("name") or entry.get("file", DASH),
            "sha256": str(entry.get("sha256", ""))[:_HASH_DIGITS],
            "size": _size(entry.get("size_bytes")),
        }
        for entry in provenance.get("inputs") or ()
    ]


def _size(size_bytes: float | None) -> str:
    if size_bytes is None:
        return DASH
    for factor, unit in ((1e6, "MB"), (1e3, "kB")):
        if size_bytes >= factor:
            return f"{size_bytes / factor:.1f} {unit}"
    return f"{size_bytes:.0f} B"


def run_section(run: RunReport) -> dict[str, Any]:
    """Return what the page shows of a run: pulses, onsets and timing of the control loop."""
    return {
        "rows": [{**row, "name": n} for n, row in run.pooled_onsets().to_dict("index").items()],
        "planned": run.n_planned,
        "gaps": run.gaps
        and {
            "fewest": min(g["fewest"] for g in run.gaps),
            "most": max(g["most"] for g in run.gaps),
            "longer": sum(g["longer_than_planned"] for g in run.gaps),
        },
        "changes": run.changes_text,
        **{
            key: sum(t[key] for t in run.timing)
            for key in ("ticks", "missed_slots", "clamped_ticks")
        },
    }


_METHODS: Final = {
    "dissertation": "least squares over the response (2.2.3)",
    "pulse_likelihood": "errors-in-variables likelihood over 250 ms",
}
_EFFECTS: Final = {"type": "type", "direction": "direction", "joint": "type or direction"}
_EFFECT_KEYS: Final = ("case", "trajectory", "response", "effect")


def planned_section(statistics: Mapping[str, Any]) -> list[dict[str, Any]] | None:
    """Return planned and reached half-widths by timing point, None without a plan."""
    rows = statistics.get("planned_half_widths")
    if not rows:
        return None
    by_point: dict[str, dict[str, str]] = {}
    for row in rows:
        reached = row["reached_pct"]
        text = "undecided" if reached is None else f"{reached:.0f} %"
        by_point.setdefault(row["timing_point"], {})[row["parameter"]] = (
            f"{row['planned_pct']:.0f} %, {text}"
        )
    return [
        {"name": point_name(point), "cells": [own.get(name, DASH) for name in ABSOLUTE]}
        for point, own in by_point.items()
    ]


def effects_section(statistics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return rows and notes of the table, None if pulses had one direction only."""
    effects = statistics.get("pulse_effects")
    if not effects:
        return None
    tests: dict[tuple[str, ...], dict[str, Mapping[str, Any]]] = {}
    for test in effects["tests"]:
        if test["effect"] in _EFFECTS:
            key = tuple(str(test[k]) for k in _EFFECT_KEYS)
            tests.setdefault(key, {})[test["analysis"]] = test
    return {
        "rows": [
            dict(zip(_EFFECT_KEYS, key, strict=True))
            | {
                "effect": _EFFECTS[key[-1]],
                "one_way": own.get("one_way"),
                "mixed": own.get("mixed"),
            }
            for key, own in tests.items()
        ],
        "methods": [_METHODS.get(n, n) for n in effects.get("methods") or ["dissertation"]],
        "alpha": effects["alpha"],
        "notes": effects["notes"],
    }


def truth_section(truth: pd.DataFrame, accuracy: pd.DataFrame | None = None) -> Row:
    """Return errors and coverage of the intervals by parameter, and what each protocol decides."""
    known = truth.dropna(subset=["truth", "estimate"])
    summary = []
    for name in PARAMETERS:
        rows = known[known["parameter"] == name]
        errors = rows["error_pct"].to_numpy(float)
        errors = errors[np.isfinite(errors)]  # a truth of zero has no error in %
        if errors.size:
            summary.append(
                {
                    "name": parameter_name(name),
                    "rms_pct": float(np.sqrt(np.mean(errors**2))),
                    "bias_pct": float(errors.mean()),
                    "covered": int(rows["covered"].astype(bool).sum()),
                    "n": len(rows),
                }
            )
    protocols = [] if accuracy is None else accuracy.to_dict("records")
    return {"summary": summary, "protocols": protocols}
