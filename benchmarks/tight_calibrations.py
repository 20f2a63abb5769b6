"""Do better calibrations give more? ``python -m benchmarks.tight_calibrations --people 12``.

Realistic people with three sensors, each analysed with calibrations that are loose, as a lab states
them, and tight; the stated values are the truth plus an error of the stated SD. From the root of
the repository.
"""

import argparse
import os
import re
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.realistic.rows import METHOD, ROWS, cells_of, preset_of, set_window

import jointz
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.own_truth import own_truth
from jointz.rig.sim.people import draw_instruments, draw_person
from jointz.rig.sim.sensors.motion_sensors import draw_motion_instruments

#: Name -> SD of lags (s) and relative SD of gains.
CALIBRATIONS: Mapping[str, tuple[float, float]] = {
    "loose": (0.005, 0.03),
    "lab": (0.002, 0.01),
    "tight": (0.0003, 0.003),
}
_CALIBRATION = re.compile(r"^calibration = .*", re.MULTILINE)
#: Gyroscopes on shank and thigh are used as one sensor, with the lag of the shank's.
_OF_JOINT = {"joint_velocity_lag": "shank_velocity_lag"}
_KEPT = ("friction_gain", "intrinsic_inertia")

Entry = dict[str, Any]


def values_of_person(seed: int, number: int) -> list[Entry]:
    """Simulate a person; return a line a value and calibration."""
    with TemporaryDirectory(prefix="tight_") as scratch:
        study = Path(scratch) / "study"
        errors, truth = _walked(study, seed, number)
        rng = np.random.default_rng([seed, number])
        off = {name: float(rng.standard_normal()) for name in errors}
        text = (study / "study.toml").read_text()
        entries = []
        for name, sds in CALIBRATIONS.items():
            (study / "study.toml").write_text(_stated(text, errors, off, sds))
            analysis = jointz.analyze(study, method=METHOD, resamples=10, progress=False)
            values = (row for cell in analysis.cells for row in cells_of(cell, truth, {}))
            rows = chain(values, _lags(analysis, errors))
            common = {"calibration": name, "number": number}
            entries += [common | row for row in rows]
    return entries


def _walked(study: Path, seed: int, number: int) -> tuple[dict[str, float], Entry]:
    row, person = ROWS["c"], draw_person(number, seed=seed)
    settings = preset_of(row)
    simulate_study(study, preset=settings, participants=[person], plan=row.plan)
    set_window(study, row.window_s)
    tools = draw_instruments(person, settings)
    errors = {
        "torque_gain": tools.torque_gain,
        "angle_gain": tools.angle_gain,
        "angle_lag_s": tools.angle_lag_s,
    }
    for name, sensor in draw_motion_instruments(person, settings).items():
        errors |= {f"{name}_gain": sensor.gain, f"{name}_lag_s": sensor.lag_s}
    return errors, own_truth(person, settings, row.plan, row.window_s)


def _stated(
    text: str, errors: Mapping[str, float], off: Mapping[str, float], sds: tuple[float, float]
) -> str:
    """Return a study file with calibrations of these SDs instead of its own."""
    entries = []
    for name, true in errors.items():
        sd = sds[0] if name.endswith("_s") else sds[1]
        entries.append(f"{name} = {{ value = {true + sd * off[name]:.8g}, sd = {sd:g} }}")
    kept = [f"{name} = {found}" for name in _KEPT for found in _found(text, name)]
    table = ", ".join([*entries, *kept])
    changed, count = _CALIBRATION.subn(lambda _: f"calibration = {{ {table} }}", text)
    if count != 1:
        raise ValueError(f"study.toml: expected one calibration, found {count}.")
    return changed


def _found(text: str, name: str) -> list[str]:
    return re.findall(rf"\b{name} = (\{{[^}}]*\}})", text)


def _lags(analysis: Any, errors: Mapping[str, float]) -> Iterator[Entry]:
    for lag in analysis.cells[0].nuisance if analysis.cells else ():
        yield {
            "parameter": lag.name,
            "status": "lag",
            "value": lag.value,
            "low": lag.ci_low,
            "high": lag.ci_high,
            "truth": errors[f"{_OF_JOINT.get(lag.name, lag.name)}_s"],
        }


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return shares, coverage, errors (%) and lags of each calibration."""
    lines = []
    for key, group in rows.groupby("calibration", sort=False):
        values, lags = group[group["status"] != "lag"], group[group["status"] == "lag"]
        ok = values[values["value"].notna()]
        inside = (ok["low"] <= ok["truth"]) & (ok["truth"] <= ok["high"])
        held = (lags["low"] <= lags["truth"]) & (lags["truth"] <= lags["high"])
        by_person = values.assign(ok=values["value"].notna()).groupby("number")["ok"].sum()
        errors = 100.0 * (ok["value"] / ok["truth"] - 1.0)
        rmse = errors.pow(2).groupby(ok["parameter"]).mean().pow(0.5).round(1)
        lines.append(
            {
                "calibration": key,
                "ok": f"{len(ok)}/{len(values)}",
                "coverage": round(float(inside.mean()), 3),
                "lags": f"{int(held.sum())}/{len(lags)}",
                "by person": " ".join(map(str, by_person)),
            }
            | {f"rmse {name}": value for name, value in rmse.items()}
        )
    return pd.DataFrame(lines)


def main() -> None:
    """Read the command line, run, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=12)
    parser.add_argument("--seed", type=int, default=68)
    parser.add_argument("--rows", type=Path, help="csv file for a line a value")
    chosen = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(max_workers=2) as pool:
        people = pool.map(partial(values_of_person, chosen.seed), range(chosen.people))
        found = [row for rows in people for row in rows]
    table = pd.DataFrame(found)
    if chosen.rows:
        table.to_csv(chosen.rows, index=False)
    print(summary(table).to_string(index=False))


if __name__ == "__main__":
    main()
