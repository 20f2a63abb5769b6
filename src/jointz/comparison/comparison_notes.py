"""What a reader of a comparison must know: who is missing, what is unlike, what stands beside."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from jointz.comparison.comparison_cells import comparison_cells, mean_of
from jointz.comparison.comparison_onsets import NOTED_PCT, onset_gaps
from jointz.comparison.comparison_result import Comparison
from jointz.comparison.comparison_sources import (
    PUBLISHED,
    Results,
    published_results,
)
from jointz.core.gait_phases import ALL_POINTS
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

#: Settings that decide on a value.
_DECISIVE = ("baseline", "window_s", "cutoff_hz", "timing_points")
#: A share of the variance over people that is worth a word.
_LARGE_SHARE = 0.25
#: Below this the differences of pairs vary too unlike for the F test.
_LOW_EPSILON = 0.75


def comparison_references(
    read: Sequence[Results], places: Sequence[tuple[str, str]]
) -> tuple[ReferenceRange, ...]:
    """Return published numbers of the knee that stand beside the means."""
    if {results.joint for results in read} != {"knee"}:
        return ()
    made = []
    if not any(results.source.published for results in read):
        shared = ("inertia", ALL_POINTS) in places
        made += [
            row for row in _published(shared=shared) if (row.parameter, row.timing_point) in places
        ]
    for parameter, point in places:
        for key, study in STUDIES.items() if parameter == "stiffness_per_mass" else ():
            if (stated := _stated(key, point)) is not None:
                words = "range that the dissertation states in words (4.4), not the study's values"
                made.append(ReferenceRange(study.name, parameter, point, None, *stated, words))
    return tuple(made)


def _stated(study: str, point: str) -> tuple[float, float] | None:
    try:
        return stated_stiffness_range(study, point)
    except KeyError:  # a timing point of the user's own
        return None


def _published(*, shared: bool) -> Iterator[ReferenceRange]:
    results = published_results()
    cells = dict(comparison_cells((results,)))
    if shared:
        people = results.source.participants
        cells["inertia", ALL_POINTS] = [
            {person: results.shared_inertia(person) for person in people}
        ]
    for place, row in cells.items():
        mean = mean_of(row[0], place)
        if mean.mean is not None and mean.ci_low is not None and mean.ci_high is not None:
            words = f"mean of the dissertation's {mean.n} people, 95 % interval over them"
            yield ReferenceRange(PUBLISHED, *place, mean.mean, mean.ci_low, mean.ci_high, words)


# --- notes ---------------------------------------------------------------------------------------


def comparison_notes(
    made: Comparison, read: Sequence[Results], designs: Mapping[tuple[str, str], str]
) -> tuple[str, ...]:
    """Return what a reader of the numbers must know."""
    return (
        *_people(read, designs),
        *_averaged(read),
        *_alike(read, apart=made.settings.get("paired") is False),
        *_unlike(read),
        *_masses(read, made.parameters),
        *_points(read),
        *_sphericity(made),
        *_inertia(read, made),
        *_missing(made),
        *_at_bound(made.at_bound),
        *_measurement(made.means),
        *(f"{test.parameter}: no mixed model over {test.factor.replace('_', ' ')}s: {test.reason}."
          for test in made.tests if test.fit is None),
    )  # fmt: skip


def _people(read: Sequence[Results], designs: Mapping[tuple[str, str], str]) -> Iterator[str]:
    for one, other in combinations(read, 2):
        a, b = one.source, other.source
        mine, theirs = set(a.participants), set(b.participants)
        both, lone = mine & theirs, sorted(mine ^ theirs)
        if designs[a.name, b.name] == PAIRED:
            left = f"; left out, as in one only: {', '.join(lone)}" if lone else ""
            yield (
                f"{a.name} and {b.name} have {len(both)} participants of the same id, who are "
                f"compared with themselves (--groups where they are different people){left}."
            )
        elif both and not (a.published or b.published):
            yield (
                f"{a.name} and {b.name} are compared as different people, though "
                f"{len(both)} ids are the same."
            )
    if GROUPS in designs.values():
        yield (
            "Groups differ in more than their name: age, mass, speed, device and method are in "
            "their differences too."
        )


def _averaged(read: Sequence[Results]) -> Iterator[str]:
    for results in read:
        if results.averaged:
            yield (
                f"{results.source.name}: values are means over the sessions and sides of "
                f"{', '.join(results.averaged)}: the person is the unit of analysis."
            )


def _alike(read: Sequence[Results], *, apart: bool) -> Iterator[str]:
    """Name ids that a reader takes for one person, and this does not."""
    own = [set(results.source.participants) for results in read if not results.source.published]
    groups = [group for people in (own if apart else [set().union(*own)])
              for group in alike_labels(sorted(people))]  # fmt: skip
    if groups:
        told = ", ".join(" and ".join(group) for group in dict.fromkeys(groups))
        yield (
            "WARNING: ids that are the same but for case, leading zeros or how a number is "
            f"written are taken as different people: {told}. Write them alike in study.toml where "
            "they are one person."
        )


def _unlike(read: Sequence[Results]) -> Iterator[str]:
    methods = {results.source.name: " and ".join(results.source.methods) for results in read}
    if len(set(methods.values())) > 1:
        told = "; ".join(f"{name} by {method}" for name, method in methods.items())
        yield (
            f"WARNING: estimates by unlike methods ({told}): a difference may be the method's. "
            "Analyse both by one method before you compare people or conditions."
        )
    versions = {r.source.name: r.version for r in read if r.version}
    if len(set(versions.values())) > 1:
        told = "; ".join(f"{name} by {version}" for name, version in versions.items())
        yield (
            f"WARNING: estimates by unlike versions of jointz ({told}): a difference may be the "
            "version's. Analyse all by one."
        )
    for one, other in combinations(read, 2):
        if one.recordings and one.recordings == other.recordings:
            yield (
                f"WARNING: {one.source.name} and {other.source.name} are analyses of the same "
                "recordings: their difference is that of the analysis, not of two measurements."
            )
        unlike = [key for key in _DECISIVE if one.settings.get(key) != other.settings.get(key)]
        unlike = unlike if one.settings and other.settings else []
        if unlike:
            yield (
                f"WARNING: {one.source.name} and {other.source.name} were analysed with unlike "
                f"settings: {', '.join(unlike)}."
            )


def _masses(read: Sequence[Results], parameters: Sequence[str]) -> Iterator[str]:
    without = [r.source.name for r in read if not r.per_mass]
    if not without:
        return
    names = " and ".join(without)
    if "stiffness" in parameters:
        yield (
            f"{names}: no values per kg of body mass (mass_kg in study.toml); stiffness and "
            "damping are compared as they are, and heavier people are stiffer."
        )
    else:
        yield (
            f"WARNING: {names}: no values per kg of body mass. The published stiffness and damping "
            "are per kg only: inertia alone is compared. Give mass_kg in study.toml."
        )


def _points(read: Sequence[Results]) -> Iterator[str]:
    common = [p for p in read[0].points if all(p in results.points for results in read)]
    for results in read:
        own = [point for point in results.points if point not in common]
        if own:
            yield f"{results.source.name} alone has {', '.join(own)}: no difference there."
    gaps = onset_gaps(read)
    if gaps:
        yield (
            f"timing points of one name are more than {NOTED_PCT:g} % of the gait cycle apart: "
            f"{'; '.join(map(str, gaps))}. Where impedance changes fast, the difference may be "
            "that of the onset."
        )


def _sphericity(made: Comparison) -> Iterator[str]:
    """Say where pairs do not vary alike, which the F test assumes."""
    for test in made.tests:
        sphericity = None if test.fit is None else test.fit.repeated_measures
        if sphericity is None or sphericity.epsilon >= _LOW_EPSILON:
            continue
        pooled = any(d.design == POOLED and d.parameter == test.parameter for d in made.differences)
        of = f"conditions at {test.where}"
        if test.factor == "timing_point":
            of = f"timing points of {test.where}"
        told = (
            f"{test.parameter}, {of}: differences of pairs do not vary alike (Greenhouse-Geisser "
            f"epsilon {sphericity.epsilon:.2f}), which the F test of the mixed model assumes. Read "
            f"p {sphericity.p_epsilon:.2g}, after Greenhouse and Geisser."
        )
        pooled = any(d.design == POOLED and d.parameter == test.parameter for d in made.differences)
        if pooled:
            told = f"WARNING: {told} Pairs by pooled error assume it too: leave out --error pooled."
        yield told


def _inertia(read: Sequence[Results], made: Comparison) -> Iterator[str]:
    averaged = {
        v.source: sum(w.source == v.source and w.status == v.status for w in made.values)
        for v in made.values
        if v.status == "mean_over_points"
    }
    for name, n in averaged.items():
        yield (
            f"inertia: {name} has one a timing point, another has one of all: compared is the "
            f"mean over the timing points of each of {n} participants."
        )
    lacking = [v for v in made.values if v.n_lacking]
    if lacking:
        named = ", ".join(
            f"{v.source} {v.participant} (of {v.n_points} of {v.n_points + v.n_lacking})"
            for v in lacking
        )
        yield (
            f"inertia: means over fewer timing points, as values are missing: {named}. They are "
            "of other parts of the gait cycle than those of the others."
        )
    drawn = [r.source.name for r in read if "recommended" in r.source.methods]
    if drawn:
        yield (
            "inertia: the recommended method draws the inertias of a person's timing points "
            f"towards one ({', '.join(drawn)}: constant_inertia_probability in models.csv). That "
            "they are alike is its assumption as much as a finding, and rows of several timing "
            "points tell the same thing again."
        )
    if any(r.source.published for r in read) or any(x.name == PUBLISHED for x in made.references):
        yield "inertia: the published one is that of device and joint together."


def _missing(made: Comparison) -> Iterator[str]:
    empty = {s.name for s in made.sources} - {v.source for v in made.values if v.value is not None}
    for name in (s.name for s in made.sources if s.name in empty):
        found = Counter(v.status for v in made.values if v.source == name)
        told = ", ".join(f"{n} {status}" for status, n in found.items())
        yield f"WARNING: {name}: no value stands ({told or 'nothing is there'}): see its report."
    values = [v for v in made.missing if v.source not in empty]
    if values:
        count = "1 value is" if len(values) == 1 else f"{len(values)} values are"
        yield f"{count} missing, the others of these people are used: {_named(values)}."


def _at_bound(values: Sequence[PersonValue]) -> Iterator[str]:
    if values:
        count = "1 value stands at its bound and is used as it is"
        if len(values) > 1:
            count = f"{len(values)} values stand at their bound and are used as they are"
        yield (
            f"{count}, which draws means towards it and makes spreads too small: {_named(values)}."
        )


def _named(values: Sequence[PersonValue]) -> str:
    groups: dict[tuple[str, str, str], list[str]] = {}
    for v in values:
        groups.setdefault((v.source, v.parameter, v.status), []).append(
            f"{v.participant} {v.timing_point}"
            + (f" ({v.n_bounded} of {v.n_points} at bound)" if v.n_bounded else "")
        )
    return "; ".join(
        f"{source} {parameter} ({status}): {', '.join(where)}"
        for (source, parameter, status), where in groups.items()
    )


def _measurement(means: Sequence[SourceMean]) -> Iterator[str]:
    """Say where people look unlike because they were measured badly."""
    for source, parameter in dict.fromkeys((m.source, m.parameter) for m in means):
        told = [
            f"{m.timing_point} {100.0 * share:.0f} %"
            for m in means
            if (m.source, m.parameter) == (source, parameter)
            and m.error_sd is not None
            and m.sd
            and (share := (m.error_sd / m.sd) ** 2) > _LARGE_SHARE
        ]
        if told:
            yield (
                f"{source} {parameter}: errors of the estimates are a large share of the variance "
                f"over people ({', '.join(told)}): people differ less than it seems, and effect "
                "sizes are too small. More pulses help here, not only more people."
            )
