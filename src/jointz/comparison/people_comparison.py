"""Means and differences by the model of all people, for results that state their errors."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from jointz.comparison.comparison_cells import Designs, PersonValues, Place
from jointz.comparison.comparison_sources import Results
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.codes import Failure
from jointz.results.statistics.comparison_rows import PAIRED, UNDECIDED, Difference, SourceMean
from jointz.stats.people_likelihoods import PeopleResults
from jointz.stats.people_together import PeopleDifference, PopulationModel
from jointz.stats.population import people_models

#: Timing point and parameter of a source, by its place among the compared ones.
_Element = tuple[int, tuple[str, str]]


class ComparedPeople:
    """Sources and their pairs, each as one model of people."""

    def __init__(
        self, results: Sequence[Results], designs: Designs, parameters: Sequence[str]
    ) -> None:
        self._populations = {result.source.name: result.population for result in results}
        self._sources = {
            result.source.name: people_models([result.people], parameters=parameters)
            for result in results
            if result.people is not None
        }
        self._pairs = {
            (a.source.name, b.source.name): _pair(
                a, b, parameters, paired=designs[a.source.name, b.source.name] == PAIRED
            )
            for a, b in combinations(results, 2)
        }

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources with a model of all people."""
        return tuple(name for name, models in self._sources.items() if models)

    def mean(self, row: SourceMean) -> SourceMean:
        """Return the mean of a source as its folder has it; without one, the row as it is."""
        mean = self._populations[row.source].get((row.timing_point, row.parameter))
        if mean is None:
            return row
        n, names = mean.n_participants, ("sd", "ci_low", "ci_high", "status", "sample_sd")
        numbers = {name: getattr(mean, name) for name in names}
        error_sd = None if self._sources.get(row.source) else row.error_sd
        missing = row.n + row.n_missing - n
        return replace(row, n=n, n_missing=missing, mean=mean.value, error_sd=error_sd, **numbers)

    def _mean(self, source: str, model: PopulationModel, element: _Element, n: int) -> float | None:
        """Return a mean as its folder has it; of some of its people only, that of their model."""
        of_folder = self._populations[source].get(element[1])
        if of_folder is not None and of_folder.n_participants == n:
            return of_folder.value
        mean = model.mean(*element)
        return mean.value if mean and mean.decided else None

    def between_sources(
        self,
        place: Place,
        first: PersonValues,
        second: PersonValues,
        *,
        design: str,
        margin_pct: float | None,
    ) -> Difference | None:
        """Return a difference of two sources; None where errors are not stated."""
        names = tuple(next(iter(values.values())).source for values in (first, second))
        people = self._pairs[names[0], names[1]].get(place[::-1])
        elements: tuple[_Element, _Element] = ((0, place[::-1]), (1, place[::-1]))
        if people is None or not set(elements) <= set(people.elements):
            return None
        share = None if margin_pct is None else margin_pct / 100.0
        difference = people.difference(*elements, margin_share=share)
        row = _row(place, names, design, (first, second))
        row = self._filled(row, names, people, elements, difference)
        mean = row.mean_second
        return replace(row, margin=None if share is None or mean is None else share * abs(mean))

    def between_points(
        self, parameter: str, points: Sequence[str], cells: Mapping[Place, Sequence[PersonValues]]
    ) -> list[Difference] | None:
        """Return the differences of all pairs of timing points of one source."""
        ((source, models),) = self._sources.items() or (("", {}),)
        modelled = [point for point in points if (point, parameter) in models]
        if not modelled:
            return None
        people = models[modelled[0], parameter]
        rows = []
        for a, b in combinations(modelled, 2):
            elements: tuple[_Element, _Element] = ((0, (a, parameter)), (0, (b, parameter)))
            values = (cells[parameter, a][0], cells[parameter, b][0])
            row = _row((parameter, ""), (a, b), PAIRED, values)
            difference = people.difference(*elements)
            rows.append(self._filled(row, (source, source), people, elements, difference))
        return rows

    def _filled(
        self,
        row: Difference,
        sources: Sequence[str],
        people: PopulationModel,
        elements: tuple[_Element, _Element],
        difference: PeopleDifference | None,
    ) -> Difference:
        """Return a row with a difference of the model; without a value if it is undecided."""
        if difference is None:
            return replace(row, status=Failure.TOO_FEW_PARTICIPANTS.status)
        # An undecided difference keeps p: the adjustment must not count significant ones only.
        row = replace(row, n_first=difference.n_first, n_second=difference.n_second, p=difference.p)
        if not difference.decided:
            return replace(row, status=UNDECIDED)
        return replace(
            row,
            mean_first=self._mean(sources[0], people, elements[0], difference.n_first),
            mean_second=self._mean(sources[1], people, elements[1], difference.n_second),
            difference=difference.value,
            ci_low=difference.ci_low,
            ci_high=difference.ci_high,
            p_equivalence=difference.p_equivalence,
            effect="d_z" if row.design == PAIRED else "d",
            effect_size=difference.effect,
            effect_low=difference.effect_low,
            effect_high=difference.effect_high,
        )


def _pair(
    a: Results, b: Results, parameters: Sequence[str], *, paired: bool
) -> Mapping[tuple[str, str], PopulationModel]:
    """Return models of two sources, if both were made by one method that states its errors."""
    if a.people is None or b.people is None or a.source.methods != b.source.methods:
        return {}
    if not paired:
        return people_models([a.people, b.people], same_people=False, parameters=parameters)
    shared = set(a.source.participants) & set(b.source.participants)
    return people_models([_only(p, shared) for p in (a.people, b.people)], parameters=parameters)


def _only(people: PeopleResults, names: set[str]) -> PeopleResults:
    return PeopleResults(
        [p for p in people.posteriors if p.participant in names],
        [c for c in people.cells if c.participant in names],
        {name: mass for name, mass in people.masses_kg.items() if name in names},
    )


def _row(
    place: Place, names: Sequence[str], design: str, values: Sequence[PersonValues]
) -> Difference:
    return Difference(
        parameter=place[0],
        unit=PARAMETER_UNITS[place[0]],
        timing_point=place[1],
        first=names[0],
        second=names[1],
        design=design,
        n_first=0,
        n_second=0,
        n_at_bound=sum(v.at_bound for of_source in values for v in of_source.values()),
    )
