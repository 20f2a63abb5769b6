"""Why values are undecided or failed in simulated studies: ``python -m benchmarks.undecided``.

Simulated people (``realistic``) walk with pulses of each kind, measured by a goniometer or by three
sensors; then doublets with the mistakes of labs, each in one study of its own; results of other
studies (those of ``python -m benchmarks.attacks``) are counted, too, if their folders are given.
Written are the reasons as the report words them, with the number of values of K, B and J and the
remedy that the report names most often, to docs/tables/undecided.csv.
"""

import argparse
import re
from collections import Counter
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from benchmarks.classical import KINDS, PARAMETERS, PULSES_A_POINT, SEED
from benchmarks.realistic.rows import set_window

import jointz
from jointz.analysis.page.uncertainty_section import main_part, uncertainty_section
from jointz.report.wording import status_meaning
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

#: Numbers of a reason that differ between values of one kind.
_WIDTH = re.compile(r" is ±[^:]*%")
TABLE = Path(__file__).parents[1] / "docs" / "tables" / "undecided.csv"
SENSORS = {"goniometer": ("goniometer",), "three": ("goniometer", "encoder", "gyroscopes")}


def _pounds(found: re.Match[str]) -> str:
    return f"mass_kg = {2.2046 * float(found[1]):.2f}"


#: Mistake -> sensors, and what is replaced in study.toml by what.
MISTAKES: dict[str, tuple[str, str, Any]] = {
    "mass in pounds": ("three", r"(?m)^mass_kg = ([\d.]+)", _pounds),
    "rigid coupling": ("three", 'coupling = "strap"', 'coupling = "rigid"'),
    "sign of torque": ("three", 'acts_on = "joint"', 'acts_on = "device"'),
    "torque gain 1.4": ("three", r"torque_gain = \{ value = 1.0", "torque_gain = { value = 1.4"),
    "angle gain 1.4": ("three", r"angle_gain = \{ value = 1.0", "angle_gain = { value = 1.4"),
    "encoder late": ("three", r"(joint_encoder_lag_s = .) value = [\d.]+", r"\1 value = 0.015"),
    "goniometer late": (
        "goniometer", "torque_gain =", "angle_lag_s = { value = 0.02, sd = 0.0005 }, torque_gain =",
    ),
}  # fmt: skip
#: Studies of few pulses -> sensors, pulses a timing point.
FEW = {"two pulses": ("three", 2), "six pulses, goniometer": ("goniometer", 6)}


def reasons(analysis: StudyAnalysis) -> Iterator[tuple[str, str]]:
    """Yield reason and remedy of each K, B and J without a value."""
    section = uncertainty_section(analysis)
    for row in section["undecided"] if section else ():
        yield _WIDTH.sub("", main_part(row["why"])), row["remedy"].partition(": ±")[0]
    for cell in analysis.cells:
        for name in PARAMETERS:
            estimate = cell.parameter(name)
            if estimate is not None and estimate.status.startswith("failed:"):
                yield status_meaning(estimate.status), ""


def simulated(people: int, seed: int) -> Iterator[tuple[str, StudyAnalysis]]:
    """Yield the analysis of each study of simulated people."""
    studies = {
        **{f"{k}, {n}": (k, n, PULSES_A_POINT, "", "") for k in KINDS for n in SENSORS},
        **{m: ("doublet", n, PULSES_A_POINT, *edit) for m, (n, *edit) in MISTAKES.items()},
        **{m: ("doublet", n, pulses, "", "") for m, (n, pulses) in FEW.items()},
    }
    for study_name, (kind, name, per_point, old, new) in studies.items():
        pulses, window_s = KINDS[kind]
        with TemporaryDirectory() as folder:
            study = simulate_study(
                Path(folder) / "study",
                preset="realistic",
                participants=people,
                plan=WalkPlan(per_point=per_point, pulses=pulses),
                seed=seed,
                sensors=SENSORS[name],
            )
            set_window(study, window_s)
            file = study / "study.toml"
            text, count = re.subn(old, new, file.read_text()) if old else (file.read_text(), 1)
            if not count:
                raise ValueError(f"{study_name}: {old!r} is not in study.toml.")
            file.write_text(text)
            yield study_name, jointz.analyze(study, progress=False)


def table_of(found: dict[str, list[tuple[str, str]]]) -> pd.DataFrame:
    """Return reasons by frequency, with the number of studies and the commonest remedy."""
    rows = [(study, *row) for study, own in found.items() for row in own]
    table = pd.DataFrame(rows, columns=["study", "reason", "remedy"])
    groups = table.groupby("reason")
    return (
        pd.DataFrame({
            "values": groups.size(),
            "studies": groups["study"].nunique(),
            "remedy": groups["remedy"].agg(lambda own: Counter(own).most_common(1)[0][0]),
        })
        .sort_values("values", ascending=False)
        .reset_index()
    )  # fmt: skip


def main() -> None:
    """Write the table and print it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.undecided", description=__doc__)
    parser.add_argument("results", type=Path, nargs="*")
    parser.add_argument("--people", type=int, default=4)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=TABLE)
    asked = parser.parse_args()
    studies = simulated(asked.people, asked.seed)
    loaded = ((folder.name, jointz.load(folder)) for folder in asked.results)
    found = {}
    for name, analysis in chain(studies, loaded):
        found[name] = [*reasons(analysis)]
        print(f"{name}: {len(found[name])} values without an estimate", flush=True)
    table = table_of(found)
    table.to_csv(asked.out, index=False)
    print(table.to_string())


if __name__ == "__main__":
    main()
