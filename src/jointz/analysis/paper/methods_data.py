"""Sentences of a methods section about people, protocol, signals and exclusions."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_calibration import calibration_sentences
from jointz.analysis.summary import name_range
from jointz.core.channels import is_turned, pretty_unit
from jointz.core.events import PulseRecord
from jointz.core.study import StudySpec
from jointz.report.pulse_words import pulse_names, pulse_unit
from jointz.report.subjects import study_spec, subjects
from jointz.report.wording import (
    exclusion_meaning,
    format_count,
    format_exact,
    format_integer,
    format_number,
    format_signed,
    format_span,
)
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.description import onset_accuracy

_CONDITIONS: Final[Mapping[str, str]] = {
    "no_device": "without the device",
    "unperturbed": "with the device and no pulses",
    "perturbed": "with pulses",
}
#: Field of ``[torque_model]`` -> (in words, unit).
_TORQUE_MODEL: Final[Mapping[str, tuple[str, str]]] = {
    "gear_ratio": ("gear ratio", ""),
    "torque_constant": ("torque constant", "N·m/A"),
    "bias": ("bias", "N·m"),
    "viscous_friction": ("viscous friction", "N·m·s/rad"),
    "coulomb_friction": ("Coulomb friction", "N·m"),
    "gear_friction": ("friction of the gear", "N·m/A"),
    "rotor_inertia": ("rotor inertia", "kg·m²"),
}

#: So many different sizes are listed, if each recurs so often.
_MOST_SIZES: Final = 4
_FEWEST_OF_SIZE: Final = 3


def people_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe the participants."""
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    if not people:
        return ["No impedance was estimated: the study has no participants and no pulses."]
    words = subjects(analysis)
    joint = "" if words.loads else f"the {analysis.settings.get('joint', 'joint')} of "
    with_pulses = {c.participant for c in analysis.cells if c.n_used}
    verb = "estimated" if words.simulated else "measured"
    lead = f"Impedance was {verb} in" if with_pulses == set(people) else "Recordings are of"
    sentences = [f"{lead} {joint}{words.counted(len(people))} ({name_range(people)})."]
    separate = [key for key in ("session", "side") if any(getattr(c, key) for c in analysis.cells)]
    if separate:
        sentences.append(
            f"Each {' and '.join(separate)} was analysed separately; {words.many} are the unit of "
            "analysis."
        )
    quantities = (("Body mass", "mass_kg", "kg"), ("Body height", "height_m", "m"))
    for name, key, unit in () if words.loads else quantities:
        if values := _known(analysis, people, key):
            count = f"{len(values)} of {len(people)}"
            sentences.append(f"{name}: {_mean_and_sd(values, unit)} ({count}).")
    return sentences


def protocol_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe conditions and pulses, as detected in the recordings."""
    return [*_condition_sentences(analysis), *_pulse_sentences(analysis)]


def signal_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe the source of the torque, the sampling rates and the calibration."""
    worn = wore_device(analysis)
    sentences = _torque_sentences(study_spec(analysis)) if worn else []
    for lead, rates in (
        ("Recordings have", recorded_rates(analysis)),
        ("Responses were analysed at", response_rates(analysis)),
    ):
        if rates:
            span = format_span(rates.values(), format_exact)
            sentences.append(f"{lead} {span} samples per second.")
    if analysis.settings.get("positive"):
        sentences.append(f"Angle and torque are positive in {analysis.settings['positive']}.")
    if worn:
        sentences += calibration_sentences(analysis)
    return [*sentences, *_nuisance_sentences(analysis)]


def exclusion_sentences(analysis: StudyAnalysis) -> list[str]:
    """Count the withdrawn pulses, and the excluded pulses and strides by code."""
    sentences = [analysis.withdrawn_text] if analysis.withdrawn_text else []
    for one, records in (("pulse", analysis.pulses), ("stride", analysis.strides)):
        counts = Counter(r.code for r in records if r.code)
        if not counts:
            continue
        each = "; ".join(
            f"{format_integer(n)} {code} ({exclusion_meaning(code)})"
            for code, n in counts.most_common()
        )
        total = f"{format_integer(counts.total())} of {format_count(len(records), one)}"
        sentences.append(f"Excluded were {total}: {each}.")
    return sentences


def _known(analysis: StudyAnalysis, people: Iterable[str], key: str) -> list[float]:
    values = {p.id: getattr(p, key) for p in study_spec(analysis).participants}
    return [float(v) for p in people if (v := values.get(p)) is not None]


def _mean_and_sd(values: Sequence[float], unit: str) -> str:
    """Write mean and SD, or the only value."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return f"{format_number(mean)} {unit}"
    sd = format_number(float(np.std(values, ddof=1)), like=mean)
    return f"{format_number(mean)} ± {sd} {unit}, mean ± SD"


def _condition_sentences(analysis: StudyAnalysis) -> list[str]:
    times: dict[str, list[float]] = {}
    for stride in analysis.strides:
        if not stride.code:
            times.setdefault(stride.condition, []).append(stride.duration_s)
    if not times:
        return []
    bench = subjects(analysis).bench
    noun = "cycle" if bench else "stride"
    conditions = [name for name in (*_CONDITIONS, *times) if name in times]
    parts = [
        f"{_CONDITIONS.get(name, name)}, {format_count(len(times[name]), noun)} accepted of "
        f"{_mean_and_sd(times[name], 's')}"
        for name in dict.fromkeys(conditions)
    ]
    lead = "Cycles were detected" if bench else "Walking was recorded"
    return [f"{lead} {'; '.join(parts)}."]


def _pulse_sentences(analysis: StudyAnalysis) -> list[str]:
    pulses = analysis.pulses
    if not pulses:
        return []
    singular, plural = pulse_names(analysis)
    count = format_count(len(pulses), f"{singular} was", f"{plural} were")
    sizes = [abs(p.amplitude) for p in pulses if p.amplitude is not None]
    lengths = [1e3 * p.duration_s for p in pulses if p.duration_s is not None]
    parts = [
        f"amplitude {_range(sizes, pulse_unit(analysis))}" if sizes else "amplitude not recorded",
        f"duration {_range(lengths, 'ms')}" if lengths else "duration not recorded",
    ]
    signs = [np.sign(p.amplitude) for p in pulses if p.amplitude]
    positive, negative = (format_integer(signs.count(sign)) for sign in (1, -1))
    signed = f"; {positive} positive, {negative} negative" if signs else ""
    sentence = f"{count} detected ({', '.join(parts)}{signed})."
    return [sentence, *_onset_sentences(pulses)]


def _onset_sentences(pulses: Sequence[PulseRecord]) -> list[str]:
    """Give the planned onsets and their errors."""
    parts = []
    for row in onset_accuracy(pulses):
        counts = f"n {row['n']}" + (f", {row['n_missing']} missing" if row["n_missing"] else "")
        if row["n"]:
            error = format_signed(row["mean_pct"] - row["target_pct"], decimals=2)
            sd = "" if row["sd_pct"] is None else f" ± {row['sd_pct']:.2f}"
            counts = f"{error}{sd} %, {counts}"
        parts.append(f"{row['timing_point']} at {format_exact(row['target_pct'])} % ({counts})")
    lead = (
        "Planned onset in % of the gait cycle and error of the measured onset, which is the time "
        "since the heel strike over the duration of the same stride (mean ± SD; missing: pulses "
        "outside accepted strides)"
    )
    return [f"{lead}: {', '.join(parts)}."] if parts else []


def _range(values: Sequence[float], unit: str) -> str:
    """Write up to four values that recur, or the smallest, the largest and the median."""
    low, high = min(values), max(values)
    if format_number(low) == format_number(high):
        return f"{format_number(low)} {unit}"
    counts = Counter(map(format_number, sorted(values)))
    if len(counts) <= _MOST_SIZES and min(counts.values()) >= _FEWEST_OF_SIZE:
        *most, last = counts
        return f"{', '.join(most)} and {last} {unit}"
    middle = format_number(float(np.median(values)))
    return f"{format_number(low)} to {format_number(high)} {unit}, median {middle}"


def torque_is_from_current(analysis: StudyAnalysis) -> bool:
    """Return whether torque was calculated from the current of a motor, including friction."""
    channels = study_spec(analysis).channels
    return "current" in channels and "torque" not in channels


def torque_is_inverted(study: StudySpec) -> bool:
    """Return whether the sign of the measured torque was inverted on reading."""
    torque = study.channels.get("torque")
    on_device = study.torque_acts_on == "device"
    return is_turned(torque.positive if torque else None, study.positive, on_device=on_device)


def _torque_sentences(study: StudySpec) -> list[str]:
    """Describe the source of the torque, if the study names it."""
    channels, model = study.channels, study.torque_model
    if "torque" in channels:
        return [_measured_torque(study)]
    if "current" not in channels or not model:
        return []
    parameters = ", ".join(
        f"{name} {format_exact(value)}{f' {unit}' if unit else ''}"
        for key, (name, unit) in _TORQUE_MODEL.items()
        if (value := getattr(model, key))
    )
    return [
        "Torque was calculated from the current of the motor by equation 4.1 "
        f"{cite('dissertation')} with {parameters}. It is the torque on the joint."
    ]


def _measured_torque(study: StudySpec) -> str:
    turned = torque_is_inverted(study)
    if study.torque_acts_on != "device":
        sign = ", with its sign inverted" if turned else ""
        return f"Torque was measured and is the torque on the joint{sign}."
    treatment = (
        "and its sign inverted to give the torque on the joint"
        if turned
        else "with the opposite positive direction, so that it equals the torque on the joint"
    )
    return f"Torque was measured on the device, {treatment}."


def wore_device(analysis: StudyAnalysis) -> bool:
    """Return whether any recording is with a device; unknown counts as yes."""
    conditions = {r.condition for r in study_spec(analysis).recordings} - {None}
    return (conditions | {s.condition for s in analysis.strides}) != {"no_device"}


def recorded_rates(analysis: StudyAnalysis) -> dict[tuple[str, str], float]:
    """Return the sampling rate of each participant and recording, with a device if any is."""
    rows = analysis.statistics.get("sampling") or ()
    worn = wore_device(analysis)
    return {
        (r["participant"], r["recording"]): round(r["rate_hz"], 2)
        for r in rows
        if r["condition"] != "no_device" or not worn
    }


def response_rates(analysis: StudyAnalysis) -> dict[str, float]:
    """Return the sampling rate of each participant's responses."""
    rates = ((c.participant, _rate_hz(c.response)) for c in analysis.cells)
    return {person: rate for person, rate in rates if rate is not None}


def _rate_hz(response: Any) -> float | None:
    """Return the sampling rate of a response, rounded to 0.001 Hz."""
    if response is None or len(response.time_s) < 2:
        return None
    return round(1.0 / float(np.median(np.diff(response.time_s))), 3)


def _nuisance_sentences(analysis: StudyAnalysis) -> list[str]:
    """Give what was estimated beside the impedance of each case."""
    estimates: dict[tuple[str, str], list[float]] = {}
    for cell in analysis.cells:
        for p in cell.nuisance:
            if p.value is not None:
                key = (p.name.replace("_", " "), pretty_unit(p.unit))
                estimates.setdefault(key, []).append(p.value)
    parts = [
        f"{name} {_range(values, unit if unit != '1' else '').strip()} (n {len(values)})"
        for (name, unit), values in estimates.items()
    ]
    return [f"Estimated beside the impedance: {'; '.join(parts)}."] if parts else []
