"""Notes and published references of a comparison."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import combinations
from typing import Any

from jointz.comparison.comparison_cells import (
    NOTED_PCT,
    Designs,
    Place,
    comparison_cells,
    onset_gaps,
    source_mean,
)
from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_sources import (
    ANALYSIS_FILE,
    PUBLISHED,
    Results,
    published_results,
)
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.grouping import by_key
from jointz.core.method_names import RIGID, WITH_POSTERIOR
from jointz.reference.literature import STUDIES, stated_stiffness_range
from jointz.report.html_page import render_paragraphs
from jointz.results.statistics.comparison_labels import alike_labels
from jointz.results.statistics.comparison_rows import (
    GROUPS,
    PAIRED,
    POOLED,
    FactorTest,
    PersonValue,
    ReferenceRange,
    SourceMean,
)
from jointz.results.statistics.mixed_model_fit import RepeatedMeasuresTest

#: Settings that affect the values.
_DECISIVE = ("baseline", "window_s", "cutoff_hz", "timing_points")
#: Methods with errors, whose prior makes a person's inertias alike; ``rigid`` is an earlier one.
_WITH_ERRORS = WITH_POSTERIOR | {RIGID}
#: A share of the variance between people that is noted.
_LARGE_SHARE = 0.25
#: Below this the variances of the pairs are too unequal for the F test.
_LOW_EPSILON = 0.75


def comparison_references(
    results: Sequence[Results], places: Sequence[Place]
) -> tuple[ReferenceRange, ...]:
    """Return published numbers of the knee for the places of the comparison."""
    if {result.joint for result in results} != {"knee"}:
        return ()
    references: list[ReferenceRange] = []
    if not any(result.source.published for result in results):
        shared = ("inertia", ALL_POINTS) in places
        references += [
            row for row in _published(shared=shared) if (row.parameter, row.timing_point) in places
        ]
    words = "range that the dissertation states in words (4.4), not the study's values"
    for parameter, point in places:
        for key, study in STUDIES.items() if parameter == "stiffness_per_mass" else ():
            with suppress(KeyError):  # a timing point of the user's own
                if stated := stated_stiffness_range(key, point):
                    references.append(ReferenceRange(study, parameter, point, None, *stated, words))
    return tuple(references)


def _published(*, shared: bool) -> Iterator[ReferenceRange]:
    published = published_results()
    cells = dict(comparison_cells((published,)))
    if shared:
        people = published.source.participants
        cells["inertia", ALL_POINTS] = [
            {person: published.shared_inertia(person) for person in people}
        ]
    for place, (values,) in cells.items():
        mean = source_mean(values, place)
        if mean.mean is not None and mean.ci_low is not None and mean.ci_high is not None:
            words = f"mean of the dissertation's {mean.n} people, 95 % interval over them"
            yield ReferenceRange(PUBLISHED, *place, mean.mean, mean.ci_low, mean.ci_high, words)


# --- notes ---------------------------------------------------------------------------------------


def comparison_notes(
    comparison: Comparison, results: Sequence[Results], designs: Designs, together: Sequence[str]
) -> tuple[str, ...]:
    """Return what a reader of the numbers should know."""
    values, common = comparison.values, _common_points(results)
    with_values = {v.source for v in values if v.value is not None}
    published = [result.source.name for result in results if result.source.published]
    notes = render_paragraphs(
        "comparison_notes.txt.j2",
        comparison=comparison,
        results=results,
        together=together,
        analysis_file=ANALYSIS_FILE,
        pairs=[_pair(a, b, designs) for a, b in combinations(results, 2)],
        groups=GROUPS in designs.values(),
        with_errors=[
            r.source.name for r in results if not _WITH_ERRORS.isdisjoint(r.source.methods)
        ],
        alike=_alike_ids(results, separate=comparison.settings.get("paired") is False),
        methods=_different({r.source.name: _methods(r) for r in results}),
        versions=_different({r.source.name: r.version for r in results if r.version}),
        massless=" and ".join(r.source.name for r in results if not r.per_mass),
        lone_points={r.source.name: [p for p in r.points if p not in common] for r in results},
        onset_gaps=onset_gaps(results),
        noted_pct=f"{NOTED_PCT:g}",
        unequal=list(_unequal_variances(comparison)),
        averaged_inertia=Counter(v.source for v in values if v.status == "mean_over_points"),
        incomplete=", ".join(
            f"{v.source} {v.participant} (of {v.n_points} of {v.n_points + v.n_lacking})"
            for v in values
            if v.n_lacking
        ),
        published_inertia=published or any(r.name == PUBLISHED for r in comparison.references),
        empty={
            source.name: _statuses(v for v in values if v.source == source.name)
            for source in comparison.sources
            if source.name not in with_values
        },
        n_missing=sum(m.n_missing for m in comparison.means if m.source in with_values),
        missing=_named([v for v in comparison.missing if v.source in with_values]),
        at_bound=_named(comparison.at_bound),
        error_shares=_error_shares(comparison.means),
    )
    return tuple(notes)


def _pair(first: Results, second: Results, designs: Designs) -> dict[str, Any]:
    """Return what two sources have in common, and how their analyses differ."""
    a, b = first.source, second.source
    ids, other_ids = set(a.participants), set(b.participants)
    settings, other_settings = first.settings, second.settings
    return {
        "names": f"{a.name} and {b.name}",
        "paired": designs[a.name, b.name] == PAIRED,
        "published": a.published or b.published,
        "n_shared": len(ids & other_ids),
        "lone": sorted(ids ^ other_ids),
        "same_recordings": first.recordings and first.recordings == second.recordings,
        "settings": [key for key in _DECISIVE if settings.get(key) != other_settings.get(key)]
        if settings and other_settings
        else [],
    }


def _alike_ids(results: Sequence[Results], *, separate: bool) -> list[str]:
    """Name ids that a reader would take for one person."""
    people = [set(result.source.participants) for result in results if not result.source.published]
    people = people if separate else [set().union(*people)]
    groups = [group for ids in people for group in alike_labels(sorted(ids))]
    return [" and ".join(group) for group in dict.fromkeys(groups)]


def _different(values: Mapping[str, str]) -> str:
    """Say what each source has, if they differ."""
    text = "; ".join(f"{name} by {value}" for name, value in values.items())
    return text if len(set(values.values())) > 1 else ""


def _methods(result: Results) -> str:
    """Return the methods of a source, with the coupling of device and leg that they assume."""
    methods, coupling = " and ".join(result.source.methods), result.settings.get("coupling")
    return f"{methods} with the coupling {coupling}" if coupling else methods


def _common_points(results: Sequence[Results]) -> set[str]:
    return set(results[0].points).intersection(*(result.points for result in results))


def _unequal_variances(
    comparison: Comparison,
) -> Iterator[tuple[FactorTest, RepeatedMeasuresTest, bool]]:
    """Yield tests whose pairs have unequal variances, and whether a pooled error assumes others."""
    pooled = {d.parameter for d in comparison.differences if d.design == POOLED}
    for test in comparison.tests:
        sphericity = None if test.fit is None else test.fit.repeated_measures
        if sphericity is not None and sphericity.epsilon < _LOW_EPSILON:
            yield test, sphericity, test.parameter in pooled


def _statuses(values: Iterable[PersonValue]) -> str:
    return ", ".join(f"{n} {status}" for status, n in Counter(v.status for v in values).items())


def _named(values: Sequence[PersonValue]) -> str:
    groups = by_key(((v.source, v.parameter, v.status), _name(v)) for v in values)
    return "; ".join(
        f"{source} {parameter} ({status}): {', '.join(names)}"
        for (source, parameter, status), names in groups.items()
    )


def _name(v: PersonValue) -> str:
    at_bound = f" ({v.n_bounded} of {v.n_points} at bound)" if v.n_bounded else ""
    return f"{v.participant} {v.timing_point}{at_bound}"


def _error_shares(means: Sequence[SourceMean]) -> dict[tuple[str, str], list[str]]:
    """Return the means with a large share of measurement error in the between-subject variance."""
    shares: dict[tuple[str, str], list[str]] = {}
    for m in means:
        large = shares.setdefault((m.source, m.parameter), [])
        share = (m.error_sd / m.sd) ** 2 if m.error_sd is not None and m.sd else 0.0
        if share > _LARGE_SHARE:
            large.append(f"{m.timing_point} {100.0 * share:.0f} %")
    return shares
