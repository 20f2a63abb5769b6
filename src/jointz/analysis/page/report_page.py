"""Report of an analysis: one HTML page that needs no other file."""

import hashlib
from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from jointz.analysis.page.caveats import caveats
from jointz.analysis.page.certificate_section import certificate_section
from jointz.analysis.page.figure_files import figures_by_section
from jointz.analysis.page.method_differences import differences_section
from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_section
from jointz.analysis.page.uncertainty_section import uncertainty_section
from jointz.analysis.paper.methods_text import methods_text
from jointz.analysis.summary import (
    fitted_signals,
    mean_over_people_note,
    pulse_counts,
    summary_paragraph,
)
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import ALL_POINTS
from jointz.report.html_page import render_template
from jointz.report.subjects import subjects, timing_points
from jointz.report.wording import (
    ALL_PARAMETERS,
    AT_ONSET,
    DASH,
    PARAMETERS,
    exclusion_meaning,
    format_estimate,
    format_integer,
    format_interval,
    format_number,
    format_signed,
    format_spread,
    format_vaf,
    onset_note,
    parameter_name,
    point_name,
    status_meaning,
)
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.run_report import RunReport
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

_FIRST_ROWS: Final = 12
_HASH_DIGITS: Final = 12

_Row = dict[str, Any]


def render_report(
    analysis: StudyAnalysis,
    figures: Mapping[str, str],
    *,
    title: str,
    truth: pd.DataFrame | None = None,
    run: RunReport | None = None,
) -> str:
    """Write the report as one HTML page with its figures and styles inside."""
    parameters = _parameters(analysis)
    columns = _columns(parameters)
    words = subjects(analysis)
    provenance, statistics = analysis.provenance, analysis.statistics
    inputs = _inputs(provenance)
    script = Markup(render_template("copy.js.j2"))
    return render_template(
        "report.html.j2",
        title=title,
        words=words,
        settings=analysis.settings,
        provenance=provenance,
        facts=_facts(analysis),
        summary=summary_paragraph(analysis),
        heads=[{"name": parameter_name(p), "unit": PARAMETER_UNITS[p]} for p in parameters],
        population=_population_rows(analysis, parameters),
        figures=figures_by_section(analysis, figures),
        columns=[[PARAMETER_UNITS[name] for name in c] for c in columns],
        column_names=[parameter_name(c[0]) for c in columns],
        people=_people(analysis, columns),
        onset_note=onset_note(parameters),
        statuses=_statuses(analysis),
        warnings=statistics.get("warnings", ()),
        notes=statistics.get("notes", ()),
        excluded=_excluded(analysis),
        names=_names(provenance),
        onsets=statistics.get("onset_accuracy", ()),
        recordings=_recordings(analysis),
        methods=methods_text(analysis, simulated=truth is not None),
        caveats=caveats(analysis),
        mean_note=mean_over_people_note(analysis),
        effects=effects_section(statistics),
        packages=_packages(provenance),
        inputs=inputs,
        study_hash=str(provenance.get("study_sha256", ""))[:_HASH_DIGITS],
        truth=None if truth is None else truth_section(truth),
        differences=differences_section(analysis),
        uncertainty=uncertainty_section(analysis),
        certificate=certificate_section(analysis.certificate),
        quasi_stiffness=quasi_stiffness_section(analysis),
        fitted=fitted_signals(analysis),
        run=None if run is None else run_section(run),
        sizes=any(row["size"] != DASH for row in inputs),
        script=script,
        script_hash=_script_hash(script),
    )


def _script_hash(script: str) -> str:
    """Return the hash that a Content-Security-Policy allows a script by."""
    return f"sha256-{b64encode(hashlib.sha256(script.encode()).digest()).decode()}"


def _parameters(analysis: StudyAnalysis) -> list[str]:
    present = {p.name for cell in analysis.cells for p in cell.parameters}
    return [name for name in ALL_PARAMETERS if name in present]


def _columns(parameters: Sequence[str]) -> list[tuple[str, ...]]:
    """Return parameters with their values per kg, which share a column of the long table."""
    pairs = (
        ("stiffness", "stiffness_per_mass"),
        ("damping", "damping_per_mass"),
        ("inertia",),
        *((name,) for name in AT_ONSET),
    )
    present = (tuple(name for name in pair if name in parameters) for pair in pairs)
    return [column for column in present if column]


def _facts(analysis: StudyAnalysis) -> list[tuple[str, str]]:
    """Return the numbers at the top of the page."""
    used, excluded = pulse_counts(analysis)
    total = sum(len(c.parameters) for c in analysis.cells)
    words = subjects(analysis)
    people = len({c.participant for c in analysis.cells})
    facts = [
        (str(people), words.one if people == 1 else words.many),
        (format_integer(used), f"pulses used, {format_integer(excluded)} excluded"),
        (f"{analysis.n_standing} of {total}", "estimates available"),
    ]
    vaf = analysis.statistics.get("vaf") or {}
    if vaf.get("mean_pct") is not None:
        facts.append((f"{format_vaf(vaf['mean_pct'])} %", "mean VAF (fit, not accuracy)"))
    return facts


def _population_rows(analysis: StudyAnalysis, parameters: Sequence[str]) -> list[_Row]:
    if not any(m.n_participants > 1 for m in analysis.population):
        return []
    by_place = {(m.timing_point, m.parameter): m for m in analysis.population}
    rows = []
    for name in (*timing_points(analysis.cells), ALL_POINTS):
        means = [by_place.get((name, p)) for p in parameters]
        if any(means):
            rows.append({"name": point_name(name), "cells": [_mean_cell(m) for m in means]})
    return rows


def _mean_cell(mean: PopulationEstimate | None) -> _Row:
    if mean is None:
        return {"text": "", "note": ""}
    if mean.value is None:
        # The table of statuses explains it; in every cell the sentence makes the table too wide.
        undecided = mean.status == "undecided"
        return {"text": DASH, "note": mean.status if undecided else status_meaning(mean.status)}
    shown = (mean.value, mean.ci_low, mean.ci_high)
    sd = f"SD {format_spread(mean.sd, *shown)}, " if mean.sd is not None else ""
    return {"text": format_interval(*shown), "note": f"{sd}n {mean.n_participants}"}


def _people(analysis: StudyAnalysis, columns: Sequence[tuple[str, ...]]) -> list[_Row]:
    """Return participants, each with a row for each timing point in the order of the cycle."""
    order = {name: i for i, name in enumerate([*timing_points(analysis.cells), ALL_POINTS])}
    by_person: dict[str, list[CellEstimate]] = {}
    for cell in analysis.cells:
        by_person.setdefault(cell.label, []).append(cell)
    return [
        {
            "id": person,
            "rows": [
                _cell_row(c, columns) for c in sorted(cells, key=lambda c: order[c.timing_point])
            ],
        }
        for person, cells in by_person.items()
    ]


def _cell_row(cell: CellEstimate, columns: Sequence[tuple[str, ...]]) -> _Row:
    shown = [p for names in columns for n in names if (p := cell.parameter(n)) is not None]
    statuses = {p.status for p in shown}
    # If everything failed for one reason, one sentence replaces five dashes.
    common = statuses.pop() if len(statuses) == 1 else ""
    shift = cell.displacement_rad
    return {
        "name": point_name(cell.timing_point),
        "onset": DASH if cell.onset_gait_pct is None else f"{cell.onset_gait_pct:.1f}",
        "cells": [_column_cells(cell, column) for column in columns],
        "failure": _badge(common) if common.startswith("failed") else None,
        "vaf": format_vaf(cell.vaf_pct),
        "displacement": DASH if shift is None else f"{np.degrees(shift):.1f}",
        "n_used": cell.n_used,
        "n_excluded": cell.n_excluded,
    }


def _column_cells(cell: CellEstimate, names: Sequence[str]) -> list[_Row]:
    estimates = [p for name in names if (p := cell.parameter(name)) is not None]
    rows = [_estimate_cell(p) for p in estimates]
    for row, estimate in zip(rows[1:], estimates[1:], strict=True):
        if estimate.status == estimates[0].status:
            row["badge"] = None
    # A second dash for the same reason would add nothing.
    return rows if rows and rows[0]["text"] != DASH else rows[:1]


def _estimate_cell(estimate: ParameterEstimate) -> _Row:
    badge = None if estimate.status == "ok" else _badge(estimate.status)
    return {"text": format_estimate(estimate), "badge": badge}


def _badge(status: str) -> _Row:
    kind = status.split(":")[0]
    return {"kind": kind, "text": kind.replace("_", " "), "meaning": status_meaning(status)}


def _statuses(analysis: StudyAnalysis) -> list[_Row]:
    counts = Counter(p.status for c in analysis.cells for p in c.parameters)
    return [
        {**_badge(status), "status": status, "count": count}
        for status, count in sorted(counts.items(), key=lambda item: -item[1])
    ]


def _excluded(analysis: StudyAnalysis) -> _Row:
    frame = analysis.excluded_frame()
    counts = Counter(zip(frame["kind"], frame["code"], strict=True))
    return {
        "counts": [
            {"kind": kind, "code": code, "count": count, "meaning": exclusion_meaning(code)}
            for (kind, code), count in sorted(counts.items(), key=lambda i: (i[0][0], -i[1]))
        ],
        "first": frame.head(_FIRST_ROWS).to_dict("records"),
        "total": len(frame),
    }


def _recordings(analysis: StudyAnalysis) -> list[_Row]:
    """Return strides and gaps of each recording; without strides, its gaps only."""
    rows = [dict(row) for row in analysis.statistics.get("strides", ())]
    if rows:
        return rows
    gaps: dict[tuple[str, str], list[float]] = {}
    for gap in analysis.gaps:
        gaps.setdefault((gap.participant, gap.recording), []).append(gap.duration_s)
    return [
        {"participant": p, "recording": r, "n_gaps": len(own), "longest_gap_s": max(own)}
        for (p, r), own in gaps.items()
    ]


def _packages(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    first = [(name, provenance[name]) for name in ("jointz", "python") if provenance.get(name)]
    return first + sorted((provenance.get("packages") or {}).items())


def _names(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Return the name to show of each file, by its name in the study."""
    inputs = provenance.get("inputs") or ()
    return {entry["file"]: entry["name"] for entry in inputs if entry.get("name")}


def _inputs(provenance: Mapping[str, Any]) -> list[_Row]:
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
    rows = [{**row, "name": name} for name, row in run.pooled_onsets().to_dict("index").items()]
    return {"rows": rows, "gaps": _gaps(run), "timing": _timing(run)}


def _gaps(run: RunReport) -> str:
    if not run.gaps:
        return ""
    fewest, most = min(g["fewest"] for g in run.gaps), max(g["most"] for g in run.gaps)
    longer = sum(g["longer_than_planned"] for g in run.gaps)
    text = f"Pulses were {fewest} to {most} strides apart"
    if not longer:
        return f"{text}, as planned."
    return f"{text}; {longer} came later than planned because the pulse before was missed."


def _timing(run: RunReport) -> str:
    ticks, missed, limited = (
        sum(t[key] for t in run.timing) for key in ("ticks", "missed_slots", "clamped_ticks")
    )
    text = (
        f"The control loop ran {format_integer(ticks)} ticks, missed {format_integer(missed)} slots"
    )
    if not limited:
        return f"{text} and limited no torque."
    return f"{text}, and sent less torque than commanded in {format_integer(limited)} ticks."


_METHODS: Final = {
    "dissertation": "least squares over the response (2.2.3)",
    "pulse_likelihood": "errors-in-variables likelihood over 250 ms",
}
_SMALLEST_P: Final = 1e-4
_EFFECTS: Final = {
    "type": "type",
    "direction": "direction",
    "joint": "type or direction",
}


def effects_section(statistics: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return rows and notes of the table, None if pulses had one direction only."""
    effects = statistics.get("pulse_effects")
    if not effects:
        return None
    tests: dict[tuple[str, ...], dict[str, Mapping[str, Any]]] = {}
    for test in effects["tests"]:
        if test["effect"] in _EFFECTS:
            key = tuple(str(test[k]) for k in ("case", "trajectory", "response", "effect"))
            tests.setdefault(key, {})[test["analysis"]] = test
    methods = effects.get("methods") or ["dissertation"]
    return {
        "rows": [_row(key, pair, effects["alpha"]) for key, pair in tests.items()],
        "methods": " and ".join(_METHODS.get(name, name) for name in methods),
        "notes": effects["notes"],
    }


def _row(
    key: tuple[str, ...], tests: Mapping[str, Mapping[str, Any]], alpha: float
) -> dict[str, Any]:
    case, trajectory, response, effect = key
    p_holm = tests.get("mixed", {}).get("p_holm")
    return {
        "case": case,
        "trajectory": trajectory,
        "response": response,
        "effect": _EFFECTS[effect],
        **{name: _test(tests.get(name, {})) for name in ("one_way", "mixed")},
        "p_holm": _p(p_holm),
        "matters": p_holm is not None and p_holm < alpha,
    }


def _test(test: Mapping[str, Any]) -> dict[str, str]:
    if not test:
        return {"f": "", "p": ""}
    if test.get("p") is None:
        return {"f": str(test.get("code", "")).replace("_", " "), "p": DASH}
    degrees = f"({test['df_num']:.0f}, {test['df_den']:.3g})"
    return {"f": f"{format_number(test['statistic'])} {degrees}", "p": _p(test["p"])}


def _p(value: float | None) -> str:
    if value is None:
        return DASH
    return f"{value:.2g}" if value >= _SMALLEST_P else f"< {_SMALLEST_P:.4f}"


def truth_section(truth: pd.DataFrame) -> _Row:
    """Return errors and coverage by parameter, and every estimate beside its truth."""
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
    return {"summary": summary, "rows": [_truth_row(row) for row in truth.to_dict("records")]}


def _truth_row(row: dict[Any, Any]) -> _Row:
    numbers = (row[key] for key in ("estimate", "ci_low", "ci_high"))
    finite = (None if x is None or not np.isfinite(x) else float(x) for x in numbers)
    return {
        "participant": row["participant"],
        "name": point_name(str(row["timing_point"])),
        "parameter": parameter_name(row["parameter"]),
        "unit": PARAMETER_UNITS[row["parameter"]],
        "truth": format_number(row["truth"]),
        "estimate": format_interval(*finite),
        "error": f"{format_signed(row['error_pct'], decimals=1)} %",
        "covered": "yes" if row["covered"] is True or row["covered"] == 1 else "no",
    }
