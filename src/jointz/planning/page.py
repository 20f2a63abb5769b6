"""Folder of a plan: page, table, JSON, figures and the protocol file."""

import json
import os
from collections.abc import Mapping
from math import ceil
from pathlib import Path
from typing import Any, Final

import numpy as np

from jointz.core.errors import DataError
from jointz.core.whole_file import refuse_existing
from jointz.io.new_folder import MARKER, new_folder, write_marker
from jointz.planning.plan_result import LETTERS, Plan, PlannedEstimate, PlannedMeasure, PlannedShape
from jointz.report.html_page import page_figures, render_template
from jointz.report.style import new_figure, to_svg
from jointz.report.wording import DASH, MINUS, point_name
from jointz.results.estimates import WIDEST
from jointz.results.figure_style import BLUE, VERMILION, Figure, figure_style

PAGE: Final = "plan.html"
PROTOCOL: Final = "protocol.toml"
_KIND: Final = "plan"
_HALF_WIDTHS_MM: Final = 78.0
_PULSES_MM: Final = 52.0
#: Numbers of people in the table, beside that of the plan.
_SHOWN_PEOPLE: Final = (4, 8, 12, 20, 40)


def write_plan(plan: Plan, out: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a plan to a folder.

    Parameters
    ----------
    plan : Plan
        The plan.
    out : path
        The folder: plan.html, plan.csv, plan.json, the figures as SVG, and protocol.toml unless
        the study was recorded already.
    overwrite : bool
        Whether to replace an earlier plan.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    DataError
        If wishes were refused, unless the study was recorded already.
    OutputError
        If the folder exists, or is not one of a plan.
    WriteError
        If it cannot be written.
    """
    path = Path(out)
    if plan.refused and not plan.recorded:
        raise DataError("plan: wishes were refused, nothing is written. " + " ".join(plan.refused))
    if not overwrite:
        refuse_existing(path, "folder")
    figures = plan_figures(plan)
    with new_folder(path, marker=MARKER, overwrite=overwrite, made_by=_KIND) as folder:
        for name, svg in figures.items():
            (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
        plan.to_frame().to_csv(folder / "plan.csv", index=False, float_format="%.6g")
        content = json.dumps(plan.to_dict(), indent=1, allow_nan=False)
        (folder / "plan.json").write_text(content + "\n", encoding="utf-8")
        if plan.protocol_text:
            (folder / PROTOCOL).write_text(plan.protocol_text, encoding="utf-8")
        (folder / PAGE).write_text(render_plan(plan, figures), encoding="utf-8")
        write_marker(folder, MARKER, {"made_by": _KIND, **plan.provenance})
    return path / PAGE


def plan_figures(plan: Plan) -> dict[str, str]:
    """Draw half-widths by timing point, and the pulses."""
    with figure_style():
        figure, pulses = new_figure(_HALF_WIDTHS_MM), new_figure(_PULSES_MM)
        for one in (figure, pulses):
            one.set_layout_engine("constrained")
        plan.plot(figure.subplots())
        _draw_pulses(plan, pulses)
        return {"half_widths": to_svg(figure), "pulses": to_svg(pulses)}


def _draw_pulses(plan: Plan, figure: "Figure") -> None:
    """Draw the torque of every shape over time, all sizes and directions."""
    courses = plan.courses
    together = len(courses) > _MOST_PANELS
    panels = figure.subplots(1, 1 if together else len(courses), sharey=True, squeeze=False)[0]
    for k, course in enumerate(courses):
        axes = panels[0 if together else k]
        times, shares = 1000.0 * np.asarray(course.times_s), np.asarray(course.shares)
        for size in course.amplitudes_nm:
            for sign in course.signs:
                colour = BLUE if sign > 0.0 else VERMILION
                axes.plot(times, sign * size * shares, color=colour)
        axes.set_title("all pulses" if together else course.name or "pulse", loc="left")
        axes.set_xlabel("time from the onset (ms)")
    panels[0].set_ylabel("torque (N·m)")


def render_plan(plan: Plan, figures: Mapping[str, str]) -> str:
    """Write a plan as one HTML page with its figures and styles inside."""
    share = f"{100.0 * float(plan.wishes.get('share', 0.8)):.0f}"
    wish = plan.wishes.get("half_width_pct")
    return render_template(
        "plan.html.j2",
        title=f"{'What this study could see' if plan.recorded else 'Plan'}: {plan.protocol}",
        about=[str(plan.provenance.get("created", ""))],
        pulses=plan.pulses,
        sensors=plan.sensors,
        window_ms=f"{1000.0 * plan.window_s:.0f}",
        walking=plan.walking,
        facts=_facts(plan),
        notes=plan.notes,
        share=share,
        figures=page_figures((name, svg, "", "") for name, svg in figures.items()),
        reached=bool(plan.reached),
        legs=plan.provenance.get("legs", ""),
        wish="" if wish is None else f"{wish:g}",
        letters=[LETTERS[name] for name in plan.wishes.get("parameters", ())],
        points=[_point(plan, e) for e in plan.estimates],
        source_names=list(next(iter(plan.sources.values()), {})),
        sources=[
            {"name": LETTERS[name], "shares": [_pct(100.0 * v) for v in shares.values()]}
            for name, shares in plan.sources.items()
        ],
        shapes=[
            {
                "name": s.name,
                "text": s.text,
                "peak": f"{s.peak_deg:.0f}",
                **_half_widths(s),
                "chosen": s.chosen,
                "remark": s.why_not or ("chosen" if s.chosen and not plan.recorded else ""),
            }
            for s in plan.shapes
        ],
        measures=[{"what": m.what, **_half_widths(m)} for m in plan.measures],
        people=[
            {
                "n": p.participants,
                "name": LETTERS[p.parameter],
                "mean": _pct(p.mean_pct) if p.mean_pct <= 100.0 * WIDEST else "undecided",
                "half": _pct(p.difference_half_width_pct),
                "paired": _pct(p.paired_pct),
                "groups": _pct(p.groups_pct),
                "chosen": p.participants == plan.participants,
            }
            for p in plan.people
            if p.participants in _SHOWN_PEOPLE or p.participants == plan.participants
        ],
        protocol=plan.protocol_text,
    )


def _facts(plan: Plan) -> list[tuple[str, str]]:
    facts = [
        (str(plan.participants), "participants"),
        (f"{ceil(plan.minutes)} min", "of walking each"),
        (f"{plan.peak_deg:.0f}°", "motion of the joint"),
    ]
    half_widths = (
        [e.half_width_pct for e in plan.estimates if e.parameter == name] for name in LETTERS
    )
    medians = ", ".join(f"{np.median(values):.0f}" for values in half_widths)
    return [*facts, (f"±{medians} %", "K, B, J of a typical leg")]


def _point(plan: Plan, estimate: PlannedEstimate) -> dict[str, Any]:
    first = estimate.parameter == "stiffness"
    reached = plan.reached.get(estimate.parameter, {}).get(estimate.timing_point)
    return {
        "point": f"{point_name(estimate.timing_point)}, {estimate.gait_pct:g} %" if first else "",
        "pulses": estimate.pulses if first else "",
        "name": LETTERS[estimate.parameter],
        "typical": _pct(estimate.half_width_pct),
        "reached": DASH if reached is None else _pct(reached),
        "assured": _pct(estimate.assured_pct),
        "endless": f"{_pct(estimate.endless_pct)}{'' if estimate.decidable else ', undecided'}",
        "decided": _pct(100.0 * estimate.decided_share),
        "bias": f"{estimate.reflex_bias_pct:+.0f} %".replace("-", MINUS),
    }


def _half_widths(row: PlannedShape | PlannedMeasure) -> dict[str, str]:
    values = row.stiffness_pct, row.damping_pct, row.inertia_pct
    return dict(zip("kbj", map(_pct, values), strict=True))


def _pct(value: float) -> str:
    """Return a percentage; large ones only say that they are large."""
    return "> 200 %" if value > _LARGE_PCT else f"{value:.0f} %"


_LARGE_PCT: Final = 200.0
#: More pulses are drawn in one panel.
_MOST_PANELS: Final = 3
