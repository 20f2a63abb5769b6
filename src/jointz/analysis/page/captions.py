"""Captions of the figures of the report."""

from jointz.analysis.device_effect import stored_device_effect
from jointz.analysis.page.event_figures import BY_DESIGN, strides_with_pulse
from jointz.analysis.page.gait_figures import example_cell, shown_conditions
from jointz.analysis.page.impedance_figures import (
    mean_estimates,
    overview_marks,
    quantities_without_panel,
)
from jointz.analysis.summary import (
    counted_people,
    counted_people_and_pulses,
    fitted_signals,
    has_onsets,
    interval_methods,
    mean_interval,
    means_of_people_together,
)
from jointz.report.html_page import render_paragraphs
from jointz.report.subjects import shown_parameters, subjects
from jointz.report.wording import onset_note
from jointz.results.study_analysis import StudyAnalysis


def captions(analysis: StudyAnalysis) -> dict[str, str]:
    """Return the caption of each figure on the page."""
    words, walking = subjects(analysis), has_onsets(analysis)
    estimates = [p for c in analysis.cells for p in c.parameters]
    beside = overview_marks(analysis)
    paragraphs = render_paragraphs(
        "captions.txt.j2",
        words=words,
        walking=walking,
        where="over the gait cycle" if walking else f"at each {words.point}",
        overview={
            "means": mean_estimates(analysis, shown_parameters(analysis.cells)),
            "classical": any(beside.values()),
            "missing": quantities_without_panel(analysis, list(beside)),
        },
        intervals="; ".join(interval_methods(analysis)),
        means=any(m.n_participants > 1 for m in analysis.population),
        mean_interval=mean_interval(analysis),
        at_bound=any(p.status == "at_bound" for p in estimates),
        onset_note=onset_note(p.name for p in estimates),
        missing=quantities_without_panel(analysis),
        people=counted_people(analysis),
        people_and_pulses=counted_people_and_pulses(analysis),
        together=means_of_people_together(analysis),
        example=example_cell(analysis),
        several_shapes=any(c.other_shapes for c in analysis.cells),
        fitted=fitted_signals(analysis),
        several_strides=any(len(c.angle) > 1 for c in shown_conditions(analysis).values()),
        test=stored_device_effect(analysis.statistics),
        outside=sum(p.target_pct is not None and p.measured_pct is None for p in analysis.pulses),
        strides_excluded=any(s.code not in ("", BY_DESIGN) for s in analysis.strides),
        strides_with_pulse=strides_with_pulse(analysis),
        n_strides=len(analysis.strides),
    )
    parts = (paragraph.partition(":") for paragraph in paragraphs)
    return {name: caption.strip(" ") for name, _, caption in parts}
