"""Reasons why results folders cannot be pooled."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, Final

from jointz.core.gait_phases import circular_mean_pct, phase_difference
from jointz.pooling.conditions import Condition
from jointz.pooling.results_folders import ResultsFolder
from jointz.report.wording import ABSOLUTE, format_count

#: Largest distance of timing points of one name, % of the gait cycle.
_SAME_POINT_PCT: Final = 2.0
_APART = "pool each side by itself"


def _texts(folder: ResultsFolder, column: str) -> str:
    return " and ".join(f"{value}" for value in folder.estimates[column].drop_duplicates())


def _method(folder: ResultsFolder) -> str:
    """Describe the method, and the coupling of device and leg if it assumes one."""
    coupling = folder.settings.get("coupling")
    assumed = f"coupling {coupling}, " if coupling else ""
    baseline = folder.settings.get("baseline") or "its own"
    return f"{_texts(folder, 'method')} ({assumed}baseline {baseline})"


def _estimand(folder: ResultsFolder) -> str:
    """Describe which K, B and J were estimated: over what time, and of the device or without."""
    window_s = folder.settings.get("window_s")
    time = "its own window" if window_s is None else f"the first {1e3 * window_s:g} ms"
    subtracted = [
        name for name in ABSOLUTE
        if any((one.get(f"intrinsic_{name}") or {}).get("value") for one in folder.calibrations)
    ]  # fmt: skip
    device = (
        f"{', '.join(subtracted)} of the device subtracted" if subtracted else "device included"
    )
    return f"mean over {time}, {device}"


#: What must be the same -> (how to read it, what to do where it is not).
_SAME: Final[Mapping[str, tuple[Callable[[ResultsFolder], str], str]]] = {
    "joint": (lambda f: str(f.study["joint"]), f"Impedances of joints differ: {_APART}"),
    "kind of study": (lambda f: str(f.study["kind"]), f"Walking is not a bench: {_APART}"),
    "positive direction": (
        lambda f: str(f.study["positive"]),
        "Write the same positive in each study.toml, with the channels' own positive where they "
        "differ, and run jointz analyze again",
    ),
    "method": (_method, "Run jointz analyze with one --method"),
    "estimand": (
        _estimand,
        "Use one window_s and the same kind of [calibration], and run jointz analyze again",
    ),
    "level of intervals (ci_level)": (
        lambda f: _texts(f, "ci_level"),
        "Run jointz analyze again with this version",
    ),
}  # fmt: skip


def refusals(folders: Sequence[ResultsFolder], conditions: Sequence[Condition]) -> Iterator[str]:
    """Yield all reasons why folders cannot be pooled."""
    for what, (read, todo) in _SAME.items():
        yield from _difference(what, {f.name: read(f) for f in folders}, todo)
    units: dict[str, dict[str, str]] = {}
    for folder in folders:
        of_folder = folder.estimates[["parameter", "unit"]].drop_duplicates()
        for parameter, group in of_folder.groupby("parameter"):
            units.setdefault(str(parameter), {})[folder.name] = " and ".join(group["unit"])
    for parameter, by_folder in units.items():
        yield from _difference(f"unit of {parameter}", by_folder, "Run jointz analyze again")
    yield from _other_points(folders)
    yield from _repeats(folders, conditions)


def _difference(what: str, values: Mapping[str, str], todo: str) -> Iterator[str]:
    sides = {value: [n for n, v in values.items() if v == value] for value in values.values()}
    if len(sides) > 1:
        found = "; ".join(f"{value} in {', '.join(names)}" for value, names in sides.items())
        yield f"{what}: expected one, found {found}. {todo}."


def _other_points(folders: Sequence[ResultsFolder]) -> Iterator[str]:
    """Yield timing points of one name at different phases of the gait cycle."""
    phases: dict[str, dict[str, float]] = {}
    for folder in folders:
        known = folder.estimates.dropna(subset="onset_gait_pct")
        for point, onsets in known.groupby("timing_point", sort=False)["onset_gait_pct"]:
            phases.setdefault(str(point), {})[folder.name] = circular_mean_pct(onsets)
    for point, by_folder in phases.items():
        pairs = combinations(by_folder.values(), 2)
        if any(abs(phase_difference(a, b)) > _SAME_POINT_PCT for a, b in pairs):
            found = ", ".join(f"{pct:.1f} % in {name}" for name, pct in by_folder.items())
            yield (
                f"timing point {point}: expected onsets within {_SAME_POINT_PCT:g} % of the gait "
                f"cycle, found {found}. Name timing points by their phase, or {_APART}."
            )


def _repeats(folders: Sequence[ResultsFolder], conditions: Sequence[Condition]) -> Iterator[str]:
    """Yield folders that hold the same people's data twice."""
    for (a, of_a), (b, of_b) in combinations(zip(folders, conditions, strict=True), 2):
        both = f"{a.name} and {b.name}"
        study: Any = a.provenance.get("study_sha256")
        if a.sha256["estimates.csv"] == b.sha256["estimates.csv"]:
            yield f"{both}: estimates.csv is the same byte for byte. Name one of them."
        elif n_shared := len(a.recordings & b.recordings):
            shared = format_count(n_shared, "recording is", "recordings are")
            yield f"{both}: {shared} in both, whose people would count twice. Name one of them."
        elif study and study == b.provenance.get("study_sha256") and of_a.study != of_b.study:
            yield (
                f"{both}: analyses of the same study.toml, as the studies {of_a.study} and "
                f"{of_b.study}. Name one of them, or give both the same study in conditions.csv."
            )
