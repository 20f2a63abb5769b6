"""Facts that the template of the methods section puts into words."""

from collections import Counter
from collections.abc import Sequence
from itertools import chain
from typing import Any, Final

import numpy as np

from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_records
from jointz.analysis.paper.estimation_facts import interval_facts, method_facts
from jointz.analysis.paper.leg_facts import leg_facts
from jointz.analysis.paper.signal_facts import calibration_facts, signal_facts
from jointz.analysis.summary import SIMULATED, name_range
from jointz.core.channels import pretty_unit
from jointz.identify.over_cycle.stride_curves import NODES
from jointz.identify.prediction.unperturbed_prediction import FEWEST_STRIDES
from jointz.report.pulse_words import pulse_names, pulse_unit
from jointz.report.subjects import nobody_perturbed, study_spec, subjects
from jointz.report.wording import (
    format_integer,
    format_number,
    format_signed,
    format_span,
)
from jointz.results.statistics.quasi_stiffness_fit import STEP_PCT, WINDOW_PCT, QuasiStiffnessDoubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.study_counts import study_counts
from jointz.stats.description import onset_accuracy

_Facts = dict[str, Any]

_CONDITIONS: Final = ("no_device", "unperturbed", "perturbed")
_HASH_DIGITS: Final = 12
#: So many different sizes are listed, if each recurs so often.
_MOST_SIZES: Final = 4
_FEWEST_OF_SIZE: Final = 3


def methods_facts(analysis: StudyAnalysis) -> _Facts:
    """Return the facts of a study by their names in the template."""
    settings, method, counts = analysis.settings, method_facts(analysis), study_counts(analysis)
    names = ("positive", "method", "seed", "window_s", "cutoff_hz")
    return {
        "words": subjects(analysis),
        "settings": {
            "joint": settings.get("joint", "joint"),
            **{name: settings.get(name) for name in names},
        },
        "simulated": SIMULATED if analysis.simulated else "",
        "people": _people_facts(analysis),
        "conditions": _stride_durations(analysis),
        "pulses": _pulse_facts(analysis),
        "signals": signal_facts(analysis),
        "calibration": calibration_facts(analysis, posterior=method["posterior"]),
        "nuisance": _nuisance(analysis),
        "estimated": any(c.n_used for c in analysis.cells),
        "method": method,
        "fewest_strides": FEWEST_STRIDES,
        "leg": leg_facts(analysis) if method["posterior"] else None,
        "intervals": interval_facts(analysis),
        "quasi_stiffness": _quasi_stiffness_facts(analysis),
        "nobody_perturbed": nobody_perturbed(analysis),
        "changes": analysis.changes_text,
        "excluded_pulses": Counter(p.code for p in analysis.pulses if p.code),
        "strides": len(analysis.strides),
        "excluded_strides": Counter(s.code for s in analysis.strides if s.code),
        "pulses_found": counts.used + counts.excluded + counts.aborted,
        "pulses_used": counts.used,
        "statuses": counts.statuses,
        "software": _software_facts(analysis),
    }


def _people_facts(analysis: StudyAnalysis) -> _Facts:
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    stated = [p for p in study_spec(analysis).participants if p.id in people]
    loads = subjects(analysis).loads
    return {
        "total": len(people),
        "names": name_range(people),
        "all_perturbed": {c.participant for c in analysis.cells if c.n_used} == set(people),
        "separate": [k for k in ("session", "side") if any(getattr(c, k) for c in analysis.cells)],
        "mass": None if loads else _mean_and_sd([p.mass_kg for p in stated]),
        "height": None if loads else _mean_and_sd([p.height_m for p in stated]),
    }


def _mean_and_sd(values: Sequence[float | None]) -> _Facts | None:
    """Return mean and SD of the known values, without an SD if there is one only."""
    known = [float(v) for v in values if v is not None]
    if not known:
        return None
    mean = float(np.mean(known))
    sd = format_number(float(np.std(known, ddof=1)), like=mean) if len(known) > 1 else ""
    return {"n": len(known), "mean": format_number(mean), "sd": sd}


def _stride_durations(analysis: StudyAnalysis) -> dict[str, _Facts | None]:
    """Return the duration of the accepted strides of each condition."""
    durations: dict[str, list[float]] = {name: [] for name in _CONDITIONS}
    for stride in analysis.strides:
        if not stride.code:
            durations.setdefault(stride.condition, []).append(stride.duration_s)
    return {name: _mean_and_sd(values) for name, values in durations.items() if values}


def _pulse_facts(analysis: StudyAnalysis) -> _Facts:
    pulses = analysis.pulses
    name, plural = pulse_names(analysis)
    amplitudes = [p.amplitude for p in pulses if p.amplitude is not None]
    return {
        "total": len(pulses),
        "name": name,
        "plural": plural,
        "unit": pulse_unit(analysis),
        "amplitudes": _range([abs(a) for a in amplitudes]),
        "durations": _range([1e3 * p.duration_s for p in pulses if p.duration_s is not None]),
        "positive": sum(a > 0 for a in amplitudes),
        "negative": sum(a < 0 for a in amplitudes),
        "onsets": [_onset_facts(row) for row in onset_accuracy(pulses)],
    }


def _onset_facts(row: _Facts) -> _Facts:
    """Return the planned onset of a timing point and the error of the measured ones."""
    mean, sd = row["mean_pct"], row["sd_pct"]
    return {
        **row,
        "error": "" if mean is None else format_signed(mean - row["target_pct"], decimals=2),
        "sd": "" if sd is None else f"{sd:.2f}",
    }


def _range(values: Sequence[float]) -> _Facts | None:
    """Return up to four values that recur, or the smallest, the largest and the median."""
    if not values:
        return None
    counts = Counter(map(format_number, sorted(values)))
    recur = len(counts) <= _MOST_SIZES and min(counts.values()) >= _FEWEST_OF_SIZE
    return {
        "n": len(values),
        "sizes": list(counts) if recur or len(counts) == 1 else [],
        "low": format_number(min(values)),
        "high": format_number(max(values)),
        "median": format_number(float(np.median(values))),
    }


def _nuisance(analysis: StudyAnalysis) -> list[tuple[str, str, _Facts | None]]:
    """Return what was estimated beside the impedance of each case: name, unit and values."""
    estimates: dict[tuple[str, str], list[float]] = {}
    for p in chain.from_iterable(c.nuisance for c in analysis.cells):
        if p.value is not None:
            unit = "" if p.unit == "1" else pretty_unit(p.unit)
            estimates.setdefault((p.name.replace("_", " "), unit), []).append(p.value)
    return [(name, unit, _range(values)) for (name, unit), values in estimates.items()]


def _quasi_stiffness_facts(analysis: StudyAnalysis) -> _Facts | None:
    rows = quasi_stiffness_records(analysis)
    if not rows:
        return None
    strides = {
        (r["participant"], r.get("session", ""), r["side"]): int(r["n_strides"]) for r in rows
    }
    known = [r for r in rows if r["value"] is not None]
    levels = [f"{100 * r['ci_level']:g}" for r in known if r["ci_low"] is not None]
    doubts = Counter(d for r in rows for d in r["doubts"].split())
    return {
        "total": len(rows),
        "people": list(dict.fromkeys(str(r["participant"]) for r in rows)),
        "strides": format_span(strides.values(), format_integer),
        "sides": any(side for *_, side in strides),
        "nodes": NODES,
        "step_pct": f"{STEP_PCT:g}",
        "window_pct": f"{WINDOW_PCT:g}",
        "level": levels[0] if levels else "",
        "without_interval": len(known) - len(levels),
        "statuses": Counter(r["status"] for r in rows),
        "doubts": [(QuasiStiffnessDoubt(d).meaning, n) for d, n in doubts.most_common()],
    }


def _software_facts(analysis: StudyAnalysis) -> _Facts:
    provenance = analysis.provenance
    packages = provenance.get("packages") or {}
    versions = {"Python": provenance.get("python"), **packages}
    return {
        "jointz": provenance.get("jointz"),
        "others": [f"{n} {versions[n]}" for n in ("Python", "numpy", "scipy") if versions.get(n)],
        "digest": str(provenance.get("study_sha256", ""))[:_HASH_DIGITS],
    }
