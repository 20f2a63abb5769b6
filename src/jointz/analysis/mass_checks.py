"""Body masses that height, inertia or other people make unlikely, and the values per kg."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from statistics import median, median_low

from jointz.core.codes import Failure
from jointz.core.study import ParticipantSpec, Study
from jointz.reference.body_segments import leg_beyond
from jointz.report.wording import PER_MASS
from jointz.results.estimates import CellEstimate, ParameterEstimate

#: Adults who walk in a lab, kg; devices worn at the leg are made for at most 100 to 135 kg.
_MASSES_KG = (25.0, 250.0)
#: Body mass index, kg/m^2. Nobody lives long below about 12 (Henry 1990, Eur J Clin Nutr 44, 329);
#: the WHO's highest class begins at 40. Pounds taken for kg give 40 to 66 for usual people.
_INDICES, _HEAVY_INDEX = (13.0, 50.0), 40.0
#: The same of children, and the height that is taken for a child's, m.
_CHILD_M, _CHILD_MASSES_KG, _CHILD_INDICES = 1.4, (5.0, 100.0), (10.0, 45.0)
_USUAL_INDICES, _USUAL_MASSES_KG, _USUAL_HEIGHT_M = (17.0, 36.0), (42.0, 115.0), 1.74
#: Median mass of a study above which it is in pounds, where heights are unknown, kg.
_HEAVY_STUDY_KG = 120.0
#: Largest inertia over that of the leg (its hip free), and of a device that may be in it, kg*m^2.
#: Inertias that are too small say nothing: published ones are down to a thirtieth of the leg's.
_MOST_INERTIA, _MOST_LEG_INERTIA, _DEVICE_INERTIA, _FREE_HIP = 4.0, 2.5, 0.3, 0.65
#: Factor to kg -> what may have been written instead.
_UNITS: Mapping[float, str] = {
    1 / 2.2046: "pounds",
    10.0: "kg with a lost digit",
    6.3503: "stone",
    1 / 9.81: "newtons",
    0.1: "kg without the decimal point",
    1e-3: "grams",
}
_ASK = (
    "Values per kg are withheld ({status}); K, B and J do not depend on it, except by the method "
    "bayesian, which expects a leg of this mass. Correct [[participants]] in study.toml; if it is "
    "right, divide K and B by it yourself."
)


def likely_masses_kg(study: Study, questions: Collection[str]) -> dict[str, float]:
    """Return the masses of participants that are stated and not in question."""
    return {
        person.id: person.mass_kg
        for person in study.spec.participants
        if person.mass_kg is not None and person.id not in questions
    }


def mass_questions(study: Study, cells: Iterable[CellEstimate]) -> dict[str, str]:
    """Return a question for each participant of a walking study whose mass is unlikely."""
    if study.spec.kind != "walking":
        return {}
    people = [p for p in study.spec.participants if p.mass_kg is not None]
    inertias: dict[str, list[float]] = {}
    for cell in cells:
        j = cell.inertia
        if j is not None and j.status == "ok" and j.value is not None:
            inertias.setdefault(cell.participant, []).append(j.value)
    pounds = _all_in_pounds(people)
    questions = {}
    for person in people:
        doubt = _doubt(person) or _doubt_of_inertia(study, person, inertias.get(person.id, ()))
        if doubt or pounds:
            doubt = doubt or "the masses of this study are those of much heavier people"
            height = "" if person.height_m is None else f" and height_m = {person.height_m:g}"
            ask = _ASK.format(status=Failure.MASS_UNLIKELY.status)
            questions[person.id] = (
                f"{person.id}: is mass_kg = {person.mass_kg:g}{height} right? "
                f"{doubt[0].upper()}{doubt[1:]}.{_likely_unit(person)} {ask}"
            )
    return questions


def mass_remarks(study: Study, questions: Collection[str]) -> list[str]:
    """Return a question for each mass that is unusual; its values per kg are kept."""
    if study.spec.kind != "walking":
        return []
    return [
        f"{p.id}: mass_kg = {p.mass_kg:g} and height_m = {p.height_m:g} give a body mass index of "
        f"{index:.0f} kg/m^2. Are they right?{_likely_unit(p)} Values per kg hold only if they are."
        for p in study.spec.participants
        if p.id not in questions and (index := _index(p)) is not None and index > _HEAVY_INDEX
    ]


def without_values_per_kg(
    cells: Sequence[CellEstimate], people: Collection[str]
) -> list[CellEstimate]:
    """Return cells in which people have no values per kg."""
    return [
        replace(cell, parameters=tuple(map(_withheld, cell.parameters)))
        if cell.participant in people
        else cell
        for cell in cells
    ]


def _withheld(estimate: ParameterEstimate) -> ParameterEstimate:
    if estimate.name not in PER_MASS:
        return estimate
    return ParameterEstimate(estimate.name, None, None, None, Failure.MASS_UNLIKELY.status)


def _index(person: ParticipantSpec) -> float | None:
    if person.mass_kg is None or person.height_m is None:
        return None
    return person.mass_kg / person.height_m**2


def _doubt(person: ParticipantSpec) -> str:
    """Return why the mass is implausible."""
    mass, index = person.mass_kg, _index(person)
    child = person.height_m is not None and person.height_m < _CHILD_M
    low, high = _CHILD_INDICES if child else _INDICES
    if index is not None and not low <= index <= high:
        return f"the body mass index is {index:.3g} kg/m^2, of people {low:g} to {high:g}"
    low, high = _CHILD_MASSES_KG if child else _MASSES_KG
    if mass is not None and not low <= mass <= high:
        known = "" if person.height_m is not None else " (of a child give height_m, too)"
        return f"people of this height weigh {low:g} to {high:g} kg{known}"
    return ""


def _doubt_of_inertia(study: Study, person: ParticipantSpec, inertias: Sequence[float]) -> str:
    """Say that a decided inertia of the knee is too large for the leg of this mass."""
    if not inertias or person.mass_kg is None or "knee" not in study.spec.joint.lower():
        return ""
    leg = _FREE_HIP * leg_beyond("knee", person.mass_kg, person.height_m or _USUAL_HEIGHT_M).inertia
    entries = [e for e in study.spec.recordings if e.participant == person.id]
    alone = all(study.spec.calibration_of(e).intrinsic_inertia is not None for e in entries)
    most = _MOST_LEG_INERTIA * leg if alone else max(_MOST_INERTIA * leg, leg + _DEVICE_INERTIA)
    inertia = median(inertias)
    if inertia <= most:
        return ""
    return f"the inertia, {inertia:.2g} kg*m^2, is {inertia / leg:.2g} times that of such a leg"


def _all_in_pounds(people: Sequence[ParticipantSpec]) -> bool:
    """Return whether most people of a study of several are so heavy that pounds are likely."""
    if len(people) < 2:
        return False
    indices = [index for p in people if (index := _index(p)) is not None]
    if 2 * len(indices) >= len(people):
        return median_low(indices) > _HEAVY_INDEX
    return median_low([p.mass_kg for p in people if p.mass_kg is not None]) > _HEAVY_STUDY_KG


def _likely_unit(person: ParticipantSpec) -> str:
    """Name the unit that would make a mass usual, "" if none would or it is usual."""
    if person.mass_kg is None:
        return ""
    low, high = _USUAL_MASSES_KG
    if person.height_m is not None:
        low, high = (index * person.height_m**2 for index in _USUAL_INDICES)
    if low <= person.mass_kg <= high:
        return ""
    fitting = [
        f"{name} ({factor * person.mass_kg:.3g} kg)"
        for factor, name in _UNITS.items()
        if low <= factor * person.mass_kg <= high
    ]
    if fitting:
        return f" It may be in {' or '.join(fitting)}."
    return " Is height_m in metres?" if person.height_m is not None else ""
