"""What a methods section says of people, protocol, signals and data: all of it as found."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_calibration import calibration_sentences
from jointz.core.channels import is_turned
from jointz.core.events import PulseRecord
from jointz.report.pulse_words import pulse_names, pulse_unit
from jointz.report.subjects import subjects
from jointz.report.wording import (
    exclusion_meaning,
    format_count,
    format_exact,
    format_integer,
    format_number,
    format_signed,
    format_with_sd,
    pretty_unit,
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


def people_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say who was measured."""
    people = list(dict.fromkeys(c.participant for c in analysis.cells))
    if not people:
        return ["No impedance was estimated: the study holds nobody and nothing with pulses."]
    words = subjects(analysis)
    names = ", ".join(people) if len(people) <= 3 else f"{people[0]} to {people[-1]}"
    joint = "" if words.loads else f"the {analysis.settings.get('joint', 'joint')} of "
    served = {c.participant for c in analysis.cells if c.n_used}
    lead = "Impedance was measured of" if served == set(people) else "Recordings are of"
    apart = [key for key in ("session", "side") if any(getattr(c, key) for c in analysis.cells)]
    return [
        f"{lead} {joint}{words.counted(len(people))} ({names}).",
        *[
            f"Each {' and '.join(apart)} was analysed separately; {words.many} are the unit of "
            "analysis."
        ]
        * bool(apart),
    ] + [
        f"{name.capitalize()}: {_spread(values, unit)} ({len(values)} of {len(people)})."
        for name, key, unit in (("body mass", "mass_kg", "kg"), ("body height", "height_m", "m"))
        if not words.loads and (values := _known(analysis, people, key))
    ]


def protocol_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say in which conditions, and with which pulses, as they were found."""
    return [*_condition_sentences(analysis), *_pulse_sentences(analysis)]


def signal_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how torque came about, at which rate, and what is known of the instruments."""
    study = analysis.provenance.get("study") or {}
    worn = wore_device(analysis)
    sentences = _torque_sentences(study) if worn else []
    for lead, rates in (
        ("Recordings have", sorted(recorded_rates(analysis).values())),
        ("Responses were analysed at", sorted(response_rates(analysis).values())),
    ):
        if rates:
            several = f" to {format_exact(rates[-1])}" if rates[-1] > rates[0] else ""
            told = f"{format_exact(rates[0])}{several} samples a second"
            sentences.append(f"{lead} {told}.")
    if analysis.settings.get("positive"):
        sentences.append(f"Angle and torque are positive in {analysis.settings['positive']}.")
    if worn:
        sentences += calibration_sentences(analysis)
    return [*sentences, *_lag_sentences(analysis), *_friction_sentences(analysis)]


def exclusion_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how many pulses and strides were left out, by code."""
    sentences = []
    for one, records in (("pulse", analysis.pulses), ("stride", analysis.strides)):
        counts = Counter(r.code for r in records if r.code)
        if not counts:
            continue
        each = "; ".join(
            f"{format_integer(n)} {code} ({exclusion_meaning(code)})"
            for code, n in counts.most_common()
        )
        total = f"{format_integer(counts.total())} of {format_count(len(records), one)}"
        sentences.append(f"Left out were {total}: {each}.")
    return sentences


def _known(analysis: StudyAnalysis, people: Iterable[str], key: str) -> list[float]:
    own = (analysis.provenance.get("study") or {}).get("participants") or ()
    values = {str(p.get("id")): p.get(key) for p in own}
    return [float(v) for p in people if (v := values.get(p)) is not None]


def _spread(values: Sequence[float], unit: str) -> str:
    """Write mean and SD, or the one value there is."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return f"{format_number(mean)} {unit}"
    sd = format_number(float(np.std(values, ddof=1)), like=mean)
    return f"{format_number(mean)} ± {sd} {unit}, mean ± SD"


def _condition_sentences(analysis: StudyAnalysis) -> list[str]:
    if not analysis.strides:
        return []
    found = Counter(s.condition for s in analysis.strides if not s.code)
    times: dict[str, list[float]] = {}
    for stride in analysis.strides:
        if not stride.code:
            times.setdefault(stride.condition, []).append(stride.duration_s)
    order = list(dict.fromkeys([*_CONDITIONS, *found]))
    bench = subjects(analysis).bench
    one = "cycle" if bench else "stride"
    parts = [
        f"{_CONDITIONS.get(name, name)}, {format_count(count, one)} accepted of "
        f"{_spread(times[name], 's')}"
        for name, count in sorted(found.items(), key=lambda item: order.index(item[0]))
    ]
    lead = "Cycles were found" if bench else "Walking was recorded"
    return [f"{lead} {'; '.join(parts)}."] if parts else []


def _pulse_sentences(analysis: StudyAnalysis) -> list[str]:
    pulses = analysis.pulses
    if not pulses:
        return []
    unit = pulse_unit(analysis)
    one, many = pulse_names(analysis)
    found = format_count(len(pulses), f"{one} was", f"{many} were")
    sizes = [abs(p.amplitude) for p in pulses if p.amplitude is not None]
    lengths = [1e3 * p.duration_s for p in pulses if p.duration_s is not None]
    size = f"size {_range(sizes, unit)}" if sizes else "size not recorded"
    length = f"length {_range(lengths, 'ms')}" if lengths else "length not recorded"
    signs = [np.sign(p.amplitude) for p in pulses if p.amplitude]
    turned = f"; {format_integer(signs.count(1))} positive, {format_integer(signs.count(-1))} "
    sentence = f"{found} found ({size}, {length}{f'{turned}negative' if signs else ''})."
    return [sentence, *_onset_sentences(pulses)]


def _onset_sentences(pulses: Sequence[PulseRecord]) -> list[str]:
    """State planned onsets and their errors."""
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
    """Write the one value there is, or smallest, largest and median."""
    low, high = min(values), max(values)
    if format_number(low) == format_number(high):
        return f"{format_number(low)} {unit}"
    middle = format_number(float(np.median(values)))
    return f"{format_number(low)} to {format_number(high)} {unit}, median {middle}"


def torque_is_from_current(analysis: StudyAnalysis) -> bool:
    """Tell whether torque was computed from the current of a motor, friction and all."""
    channels = (analysis.provenance.get("study") or {}).get("channels") or {}
    return "current" in channels and "torque" not in channels


def torque_is_turned(study: Mapping[str, Any]) -> bool:
    """Tell whether the sign of a torque that was measured was turned on reading."""
    own = ((study.get("channels") or {}).get("torque") or {}).get("positive")
    on_device = study.get("torque_acts_on") == "device"
    return is_turned(own, study.get("positive"), on_device=on_device)


def _torque_sentences(study: Mapping[str, Any]) -> list[str]:
    """Say where torque came from; nothing where a study says nothing."""
    channels, model = study.get("channels") or {}, study.get("torque_model")
    if "torque" in channels:
        return [_measured_torque(study)]
    if "current" not in channels or not model:
        return []
    known = ", ".join(
        f"{name} {format_exact(model[key])}{f' {unit}' if unit else ''}"
        for key, (name, unit) in _TORQUE_MODEL.items()
        if model.get(key)
    )
    law = f"equation 4.1 {cite('dissertation')}; {known}"
    return [
        f"Torque was computed from the current of the motor by {law}, and is the torque on the "
        "joint."
    ]


def _measured_torque(study: Mapping[str, Any]) -> str:
    turned = torque_is_turned(study)
    if study.get("torque_acts_on") != "device":
        sign = ", its sign turned" if turned else ""
        return f"Torque was measured and is the torque on the joint{sign}."
    how = (
        "and its sign turned to that of the torque on the joint"
        if turned
        else "positive the other way, and is the torque on the joint as it stands"
    )
    return f"Torque was measured on the device, {how}."


def wore_device(analysis: StudyAnalysis) -> bool:
    """Tell whether there is a recording with a device, as far as anything tells."""
    study = analysis.provenance.get("study") or {}
    told = {r.get("condition") for r in study.get("recordings") or ()} - {None}
    return (told | {s.condition for s in analysis.strides}) != {"no_device"}


def recorded_rates(analysis: StudyAnalysis) -> dict[tuple[str, str], float]:
    """Return participant and recording -> samples a second as recorded, with a device."""
    rows = analysis.statistics.get("sampling") or ()
    worn = wore_device(analysis)
    return {
        (r["participant"], r["recording"]): round(r["rate_hz"], 2)
        for r in rows
        if r["condition"] != "no_device" or not worn
    }


def response_rates(analysis: StudyAnalysis) -> dict[str, float]:
    """Return participant -> samples a second of the responses that were analysed."""
    rates = ((c.participant, _rate_hz(c.response)) for c in analysis.cells)
    return {person: rate for person, rate in rates if rate is not None}


def _rate_hz(response: Any) -> float | None:
    """Return the rate of a response, to a thousandth."""
    if response is None or len(response.time_s) < 2:
        return None
    return round(1.0 / float(np.median(np.diff(response.time_s))), 3)


def _lag_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say which lag and friction the data themselves told of."""
    lags = [(1e3 * m.lag_s, 1e3 * m.lag_sd_s) for m in analysis.models]
    if not lags:
        return _nuisance_sentences(analysis)
    each = ", ".join(
        f"{m.label} {lag:.1f} ± {sd:.1f}"
        for m, (lag, sd) in zip(analysis.models, lags, strict=True)
    )
    return [f"The angle was found to lag the torque by, in ms ± SD: {each}."]


def _friction_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say what was found of the friction, where the torque is that of a motor's current."""
    if not torque_is_from_current(analysis) or not analysis.models:
        return []
    each = ", ".join(
        f"{m.label} {format_with_sd(m.friction_gain, m.friction_gain_sd)}" for m in analysis.models
    )
    return [f"True over stated friction of the actuator was found to be, ± SD: {each}."]


def _nuisance_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say what was estimated beside the impedance of each case, where that was."""
    found: dict[tuple[str, str], list[float]] = {}
    for cell in analysis.cells:
        for p in cell.nuisance:
            if p.value is not None:
                key = (p.name.replace("_", " "), pretty_unit(p.unit))
                found.setdefault(key, []).append(p.value)
    parts = [
        f"{name} {_range(values, unit if unit != '1' else '').strip()} (n {len(values)})"
        for (name, unit), values in found.items()
    ]
    return [f"Estimated beside the impedance: {'; '.join(parts)}."] if parts else []
