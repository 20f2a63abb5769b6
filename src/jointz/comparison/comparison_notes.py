"""Notes and published references of a comparison."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import combinations

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
from jointz.core.method_names import RIGID, WITH_POSTERIOR
from jointz.reference.literature import STUDIES, stated_stiffness_range
from jointz.results.statistics.comparison_labels import alike_labels
from jointz.results.statistics.comparison_rows import (
    GROUPS,
    PAIRED,
    POOLED,
    PersonValue,
    ReferenceRange,
    SourceMean,
)

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
    return (
        *_designs(results, designs),
        *_together(results, together, comparison),
        *_averaged(results),
        *_alike_ids(results, separate=comparison.settings.get("paired") is False),
        *_different_analyses(results),
        *_masses(results, comparison.parameters),
        *_points(results),
        *_sphericity(comparison),
        *_inertia(results, comparison),
        *_missing(comparison),
        *_at_bound(comparison.at_bound),
        *_measurement_error(comparison.means),
        *(
            f"{test.parameter}: no mixed model over {test.factor.replace('_', ' ')}s: "
            f"{test.reason}."
            for test in comparison.tests
            if test.fit is None
        ),
    )


def _designs(results: Sequence[Results], designs: Designs) -> Iterator[str]:
    for a, b in combinations((result.source for result in results), 2):
        ids, other_ids = set(a.participants), set(b.participants)
        shared, lone = ids & other_ids, sorted(ids ^ other_ids)
        if designs[a.name, b.name] == PAIRED:
            excluded = f"; excluded, as in one only: {', '.join(lone)}" if lone else ""
            yield (
                f"{a.name} and {b.name} have {len(shared)} participants of the same id, who are "
                "compared with themselves (use --groups if they are different people)"
                f"{excluded}."
            )
        elif shared and not (a.published or b.published):
            yield (
                f"{a.name} and {b.name} are compared as different people, although "
                f"{len(shared)} ids are the same."
            )
    if GROUPS in designs.values():
        yield (
            "Differences between groups also include differences of age, mass, speed, device and "
            "method."
        )


def _together(
    results: Sequence[Results], together: Sequence[str], comparison: Comparison
) -> Iterator[str]:
    """Yield which means are from the model of all people, and how the others are tested."""
    if together:
        yield (
            f"{' and '.join(together)}: means are of all participants together, each by what the "
            "data say, undecided ones included; errors of calibration and method that all share "
            "are in the intervals."
        )
        effects = {d.effect for d in comparison.differences}
        if effects & {"d", "d_z"}:
            yield (
                "differences with the effect d or d_z are of the same model; errors that all share "
                "cancel between conditions of the same people. Other differences are t tests of "
                "decided values."
            )
        if any(test.fit is not None for test in comparison.tests):
            yield (
                "the mixed model is of decided values only and does not know their errors: prefer "
                "the differences."
            )
    for result in results:
        if result.source.name in together or result.source.published:
            continue
        reason = (
            f"{ANALYSIS_FILE} is not there or states no errors"
            if not _WITH_ERRORS.isdisjoint(result.source.methods)
            else "the method states no errors that a model of people could use"
        )
        yield f"{result.source.name}: means and t tests of decided values ({reason})."


def _averaged(results: Sequence[Results]) -> Iterator[str]:
    for result in results:
        if result.averaged:
            yield (
                f"{result.source.name}: values are means over the sessions and sides of "
                f"{', '.join(result.averaged)}, as the person is the unit of analysis."
            )


def _alike_ids(results: Sequence[Results], *, separate: bool) -> Iterator[str]:
    """Name ids that a reader would take for one person."""
    people = [set(result.source.participants) for result in results if not result.source.published]
    people = people if separate else [set().union(*people)]
    groups = [group for ids in people for group in alike_labels(sorted(ids))]
    if groups:
        names = ", ".join(" and ".join(group) for group in dict.fromkeys(groups))
        yield (
            "WARNING: ids that are the same except for case, leading zeros or the format of "
            f"numbers are taken as different people: {names}. Write them alike in study.toml if "
            "they are one person."
        )


def _different_analyses(results: Sequence[Results]) -> Iterator[str]:
    methods = {result.source.name: _methods(result) for result in results}
    if len(set(methods.values())) > 1:
        yield (
            f"WARNING: different methods ({_assignments(methods)}) may cause a difference. Analyse "
            "both by one method before you compare people or conditions."
        )
    versions = {r.source.name: r.version for r in results if r.version}
    if len(set(versions.values())) > 1:
        yield (
            f"WARNING: different versions of jointz ({_assignments(versions)}) may cause a "
            "difference. Analyse all with one version."
        )
    for a, b in combinations(results, 2):
        names = f"{a.source.name} and {b.source.name}"
        if a.recordings and a.recordings == b.recordings:
            yield (
                f"WARNING: {names} are analyses of the same recordings, so their difference is one "
                "of the analyses, not of two measurements."
            )
        different = [key for key in _DECISIVE if a.settings.get(key) != b.settings.get(key)]
        if different and a.settings and b.settings:
            yield f"WARNING: {names} were analysed with different settings: {', '.join(different)}."


def _methods(result: Results) -> str:
    """Return the methods of a source, with the coupling of device and leg that they assume."""
    methods, coupling = " and ".join(result.source.methods), result.settings.get("coupling")
    return f"{methods} with the coupling {coupling}" if coupling else methods


def _assignments(values: Mapping[str, str]) -> str:
    return "; ".join(f"{name} by {value}" for name, value in values.items())


def _masses(results: Sequence[Results], parameters: Sequence[str]) -> Iterator[str]:
    names = " and ".join(r.source.name for r in results if not r.per_mass)
    if not names:
        return
    if "stiffness" in parameters:
        yield (
            f"{names}: no values per kg of body mass (mass_kg in study.toml); absolute stiffness "
            "and damping are compared, which are larger in heavier people."
        )
    else:
        yield (
            f"WARNING: {names}: no values per kg of body mass. The published stiffness and damping "
            "are per kg only, so only inertia is compared. Give mass_kg in study.toml."
        )


def _points(results: Sequence[Results]) -> Iterator[str]:
    common = [p for p in results[0].points if all(p in result.points for result in results)]
    for result in results:
        lone = [point for point in result.points if point not in common]
        if lone:
            yield (
                f"{result.source.name} has {', '.join(lone)}, which another result lacks: no "
                "difference between these two."
            )
    gaps = onset_gaps(results)
    if gaps:
        yield (
            f"timing points of one name are more than {NOTED_PCT:g} % of the gait cycle apart: "
            f"{'; '.join(map(str, gaps))}. If impedance changes fast there, the shift may cause "
            "the difference."
        )


def _sphericity(comparison: Comparison) -> Iterator[str]:
    """Name the tests whose pairs have unequal variances, which the F test assumes equal."""
    for test in comparison.tests:
        sphericity = None if test.fit is None else test.fit.repeated_measures
        if sphericity is None or sphericity.epsilon >= _LOW_EPSILON:
            continue
        levels = (
            f"timing points of {test.where}"
            if test.factor == "timing_point"
            else f"conditions at {test.where}"
        )
        text = (
            f"{test.parameter}, {levels}: differences of pairs have unequal variances "
            f"(Greenhouse-Geisser epsilon {sphericity.epsilon:.2f}), but the F test of the mixed "
            f"model assumes equal ones. Use p {sphericity.p_epsilon:.2g}, after Greenhouse and "
            "Geisser."
        )
        if any(
            d.design == POOLED and d.parameter == test.parameter for d in comparison.differences
        ):
            text = f"WARNING: {text} Pairs by pooled error assume it too: leave out --error pooled."
        yield text


def _inertia(results: Sequence[Results], comparison: Comparison) -> Iterator[str]:
    averaged = Counter(v.source for v in comparison.values if v.status == "mean_over_points")
    for name, n in averaged.items():
        yield (
            f"inertia: {name} has a value for each timing point, another result has one for all. "
            f"The mean over the timing points of each of {n} participants is compared."
        )
    incomplete = ", ".join(
        f"{v.source} {v.participant} (of {v.n_points} of {v.n_points + v.n_lacking})"
        for v in comparison.values
        if v.n_lacking
    )
    if incomplete:
        yield (
            f"inertia: means over fewer timing points, as values are missing: {incomplete}. They "
            "represent other parts of the gait cycle than the means of the others."
        )
    shrunk = [r.source.name for r in results if not _WITH_ERRORS.isdisjoint(r.source.methods)]
    if shrunk:
        yield (
            "inertia: the prior draws the inertias of a person's timing points towards one "
            f"({', '.join(shrunk)}). Their similarity is partly assumed, and rows of several "
            "timing points are not independent."
        )
    published = any(r.source.published for r in results)
    if published or any(r.name == PUBLISHED for r in comparison.references):
        yield "inertia: the published value is that of device and joint together."


def _missing(comparison: Comparison) -> Iterator[str]:
    with_values = {v.source for v in comparison.values if v.value is not None}
    for source in comparison.sources:
        if source.name not in with_values:
            statuses = Counter(v.status for v in comparison.values if v.source == source.name)
            counts = ", ".join(f"{n} {status}" for status, n in statuses.items())
            yield (
                f"WARNING: {source.name}: no value is available ({counts or 'no rows'}); see its "
                "report."
            )
    values = [v for v in comparison.missing if v.source in with_values]
    if n := sum(m.n_missing for m in comparison.means if m.source in with_values):
        count = "1 value is" if n == 1 else f"{n} values are"
        yield f"{count} missing and not in the means: {_named(values)}."


def _at_bound(values: Sequence[PersonValue]) -> Iterator[str]:
    if values:
        count = "1 value is at its bound and is used as it is"
        if len(values) > 1:
            count = f"{len(values)} values are at their bound and are used as they are"
        yield f"{count}, which biases means towards it and reduces spreads: {_named(values)}."


def _named(values: Sequence[PersonValue]) -> str:
    groups: dict[tuple[str, str, str], list[str]] = {}
    for v in values:
        at_bound = f" ({v.n_bounded} of {v.n_points} at bound)" if v.n_bounded else ""
        groups.setdefault((v.source, v.parameter, v.status), []).append(
            f"{v.participant} {v.timing_point}{at_bound}"
        )
    return "; ".join(
        f"{source} {parameter} ({status}): {', '.join(names)}"
        for (source, parameter, status), names in groups.items()
    )


def _measurement_error(means: Sequence[SourceMean]) -> Iterator[str]:
    """Name the means with a large share of measurement error in the between-subject variance."""
    shares: dict[tuple[str, str], list[str]] = {}
    for m in means:
        large = shares.setdefault((m.source, m.parameter), [])
        share = (m.error_sd / m.sd) ** 2 if m.error_sd is not None and m.sd else 0.0
        if share > _LARGE_SHARE:
            large.append(f"{m.timing_point} {100.0 * share:.0f} %")
    for (source, parameter), large in shares.items():
        if not large:
            continue
        yield (
            f"{source} {parameter}: measurement error is a large share of the between-subject "
            f"variance ({', '.join(large)}). It inflates this variance and reduces effect sizes. "
            "More pulses help here, not only more people."
        )
