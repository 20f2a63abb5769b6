"""Errors of classical values by kind of pulse: ``python -m benchmarks.classical``.

Simulated people (``realistic``: strap, reflex, softening, late sensors) walk with pulses of each
kind; the dissertation's method estimates K, B and J. Written is the root mean square of the
relative errors of all values that the method gives, off the nearest of the joint's own at the
onset and over the window, to docs/tables/classical.csv; the same of studies A, B and C of another
simulator (benchmarks.real_legs). A third one has doublets only: rows ``attacks`` are added by hand
from ``python -m benchmarks.attacks --only clean_dissertation --people 20 --per-point 24``.
jointz/reference/classical_errors.py has the smallest and the largest of all.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from benchmarks.real_legs.studies import real_legs_folder, recorded_truths, simulated_truths
from benchmarks.realistic.rows import set_window

import jointz
from jointz.core.method_names import DISSERTATION
from jointz.core.protocols.pulse_models import DoubletPulse, NamedPulse, TrapezoidPulse
from jointz.results.estimates import CellEstimate
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset

TABLE = Path(__file__).parents[1] / "docs" / "tables" / "classical.csv"
PARAMETERS = ("stiffness", "damping", "inertia")
SEED = 72
PULSES_A_POINT = 24


def _trapezoid(name: str, hold_s: float, *sizes_nm: float) -> TrapezoidPulse:
    return TrapezoidPulse(
        name=name, kind="trapezoid", hold_s=hold_s, amplitudes_nm=sizes_nm, direction="both"
    )


def _doublet(name: str, *durations_s: float) -> DoubletPulse:
    return DoubletPulse(
        name=name, kind="doublet", durations_s=durations_s, amplitudes_nm=(10.0, 17.0),
        direction="both",
    )  # fmt: skip


#: Kind -> pulses, and the window that suits them (s).
KINDS: dict[str, tuple[tuple[NamedPulse, ...], float]] = {
    "hold": ((_trapezoid("hold", 0.25, 17.0),), 0.1),
    "short": ((_trapezoid("short", 0.06, 10.0, 17.0),), 0.15),
    "doublet": ((_doublet("short", 0.040, 0.022), _doublet("long", 0.092, 0.050)), 0.2),
}

#: Kind -> study of another simulator.
RECORDED = {"hold": "A", "short": "C", "doublet": "B"}
COLUMNS = ["kind", "person", "timing_point", "parameter", "value", "onset", "window", "error"]


def errors_of(kind: str, people: int, folder: Path, *, seed: int = SEED) -> pd.DataFrame:
    """Return one row a value: value, truth at the onset and over the window, relative error."""
    pulses, window_s = KINDS[kind]
    plan = WalkPlan(per_point=PULSES_A_POINT, pulses=pulses)
    study = simulate_study(
        folder / kind, preset="realistic", participants=people, plan=plan, seed=seed
    )
    set_window(study, window_s)
    found = jointz.analyze(study, method=DISSERTATION, resamples=100, progress=False)
    truths = simulated_truths(study)
    rows = []
    for number in range(people):
        person = draw_person(number, seed=seed)
        over_window = own_truth(person, preset("realistic"), plan, window_s)
        for cell in (c for c in found.cells if c.participant == person.id):
            for name in PARAMETERS:
                own = [truth[cell.timing_point][name] for truth in (truths[person.id], over_window)]
                rows += _row(kind, cell, name, (own[0], own[1]))
    return pd.DataFrame(rows, columns=COLUMNS)


def recorded_errors(kind: str, folder: Path) -> pd.DataFrame:
    """Return the same of a study of another simulator."""
    study, window_s = RECORDED[kind], KINDS[kind][1]
    truths = recorded_truths(folder, study, window_s)
    found = jointz.analyze(folder / study, method=DISSERTATION, resamples=100, progress=False)
    rows = []
    for cell in found.cells:
        truth = truths[cell.participant][cell.timing_point]
        for name in PARAMETERS:
            own = (truth.get(f"{name}_onset", truth[name]), truth[name])
            rows += _row(kind, cell, name, own)
    return pd.DataFrame(rows, columns=COLUMNS)


def _row(
    kind: str, cell: CellEstimate, name: str, truths: tuple[float, float]
) -> list[tuple[object, ...]]:
    """Return the row of a value that the method gives."""
    estimate = cell.parameter(name)
    if estimate is None or estimate.status != "ok" or estimate.value is None:
        return []
    error = estimate.value / float(np.clip(estimate.value, min(truths), max(truths))) - 1.0
    return [(kind, cell.participant, cell.timing_point, name, estimate.value, *truths, error)]


def table_of(errors: pd.DataFrame) -> pd.DataFrame:
    """Return simulator, kind, parameter, number of values given, and their RMS error in %."""
    groups = errors.groupby(["simulator", "kind", "parameter"], sort=False)["error"]
    rms = groups.apply(lambda e: 100.0 * float(np.sqrt((e**2).mean())))
    return pd.DataFrame({"given": groups.size(), "rms_pct": rms.round(1)}).reset_index()


def main() -> None:
    """Write the table and print it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.classical", description=__doc__)
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=TABLE)
    asked = parser.parse_args()
    parts = []
    with TemporaryDirectory() as folder:
        for kind in KINDS:
            own = errors_of(kind, asked.people, Path(folder), seed=asked.seed)
            parts.append(own.assign(simulator="realistic"))
    if (recorded := real_legs_folder()).is_dir():
        parts += [recorded_errors(kind, recorded).assign(simulator="A, B, C") for kind in KINDS]
    table = table_of(pd.concat(parts))
    table.to_csv(asked.out, index=False)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
