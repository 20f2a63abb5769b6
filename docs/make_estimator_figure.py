"""Draw images/estimator.svg: ``python docs/make_estimator_figure.py STUDY`` (rigid coupling)."""

import sys
from pathlib import Path

import numpy as np

import jointz
from jointz.core.study import Study
from jointz.identify.prediction.unperturbed_prediction import UnperturbedPredictor
from jointz.identify.preparation.assignment import Candidate, assign_pulses
from jointz.identify.preparation.raw_signals import RAW_ANGLE, raw_signals
from jointz.identify.preparation.sources import (
    ParticipantSettings,
    RecordingInput,
    Source,
    prepare_sources,
)
from jointz.identify.study_kinds import WALKING
from jointz.io.recordings import read_pulse_table, read_recording
from jointz.report.style import (
    legend_line,
    new_figure,
    panel_heading,
    place_axes,
    place_legend,
    to_svg,
)
from jointz.results.estimates import CellEstimate
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, SKY, VERMILION, figure_style

IMAGE = Path(__file__).parent / "images" / "estimator.svg"
POINT = "ISW"
BEFORE_S, WINDOW_S = 0.3, 0.12
WORDS = {"pulses": "twice the pulses", "strap": "goniometer's mount", "gain": "gains"}


def candidates_of(study: Study, person: str) -> tuple[list[Candidate], list[Source]]:
    """Return the pulses of a timing point of a participant, and the recordings."""
    spec = study.spec
    inputs = []
    for entry in (r for r in spec.recordings if r.participant == person):
        (recording,) = read_recording(study, entry)
        inputs.append(
            RecordingInput(recording, spec.calibration_of(entry), read_pulse_table(study, entry))
        )
    settings = ParticipantSettings(
        kind=WALKING,
        perturbations=spec.perturbations,
        group_edges=study.group_edges,
        torque_model=spec.torque_model,
        methods=("bayesian",),
        n_resamples=2,
        seed=0,
        mass_kg=spec.participant(person).mass_kg,
    )
    sources = prepare_sources(inputs, settings)
    found = assign_pulses(person, sources, settings, baseline="predicted", alone=True)
    mine = [c for c in found if c.record.timing_point == POINT and not c.record.code]
    return mine, sources


def draw_pulse(axes, candidates, source) -> None:
    """Draw one pulse: what was measured, and what would have been without it."""
    signals = raw_signals(source)
    predicted = UnperturbedPredictor(source, signals, window_s=WINDOW_S).predict(candidates)
    number = next(k for k, code in enumerate(predicted.codes) if not code)
    onset = np.array([candidates[number].pulse.onset_s])
    n = predicted.responses.shape[2]
    after, _ = signals.cut(onset, before_s=0.0, after_s=n / signals.rate_hz)
    before, _ = signals.cut(onset, before_s=BEFORE_S, after_s=0.0)
    past, measured = np.degrees(before[0, RAW_ANGLE]), np.degrees(after[0, RAW_ANGLE])
    without = measured - np.degrees(predicted.responses[0, 0]) * candidates[number].pulse.sign
    reach = 1.96 * np.degrees(predicted.prediction_errors[:, 0].std(axis=0))
    time = 1e3 * np.arange(n) / signals.rate_hz
    axes.fill_between(time, without - reach, without + reach, color=SKY, alpha=0.5, linewidth=0)
    axes.plot(time, without, color=BLUE)
    axes.plot(1e3 * (np.arange(past.size) - past.size) / signals.rate_hz, past, color=INK)
    axes.plot(time, measured, color=INK)
    axes.axvline(0.0, color=FAINT, linewidth=0.6)
    axes.set_xlabel("Time from the onset (ms)")
    axes.set_ylabel("Angle (deg)")
    panel_heading(axes, "1  One pulse")


def draw_response(axes, cell: CellEstimate) -> None:
    """Draw the average response and its fit."""
    shown = cell.response
    axes.plot(1e3 * shown.time_s, np.degrees(shown.angle), color=INK)
    axes.plot(
        1e3 * shown.time_s, np.degrees(shown.fitted_angle), color=VERMILION, dashes=(2.5, 1.5)
    )
    axes.set_xlabel("Time from the onset (ms)")
    axes.set_ylabel("Response (deg)")
    panel_heading(axes, f"2  Average of {cell.n_used} pulses")


def draw_sources(axes, cell: CellEstimate) -> None:
    """Draw how much of the interval of the stiffness would vanish if a source were known."""
    half = 0.5 * (cell.parameter("stiffness").ci_high - cell.parameter("stiffness").ci_low)
    shares = {
        name: 100.0 * (1.0 - np.sqrt(max(1.0 - (1.96 * part / half) ** 2, 0.0)))
        for name, part in cell.through_instruments["stiffness"].items()
    }
    names = sorted(shares, key=shares.__getitem__)[-5:]
    axes.barh(range(len(names)), [shares[name] for name in names], color=SKY, height=0.5)
    for at, name in enumerate(names):
        axes.text(0.0, at + 0.3, WORDS.get(name, name), fontsize=6.0, color=MUTED, va="bottom")
    axes.set_yticks([])
    axes.set_ylim(-0.5, len(names) - 0.2)
    axes.set_xlabel("Narrower if known (%)")
    panel_heading(axes, "3  The interval of K")


def main(folder: str) -> None:
    """Draw the figure of a study."""
    study = jointz.open_study(folder)
    person = study.spec.participants[0].id
    candidates, sources = candidates_of(study, person)
    analysis = jointz.analyze(study, resamples=2)
    cell = next(c for c in analysis.cells if (c.participant, c.timing_point) == (person, POINT))
    with figure_style():
        figure = new_figure(62.0)
        panels = [
            place_axes(figure, left, 13.0, width_mm=44.0, height_mm=38.0) for left in (14, 75, 134)
        ]
        draw_pulse(panels[0], candidates, sources[candidates[0].source])
        draw_response(panels[1], cell)
        draw_sources(panels[2], cell)
        legend = [
            legend_line("measured", INK),
            legend_line("predicted without the pulse, and 95 % of its errors", BLUE),
            legend_line("simulated from the measured torque", VERMILION, dashes=(2.5, 1.5)),
        ]
        place_legend(figure, legend)
        IMAGE.write_text(to_svg(figure) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
