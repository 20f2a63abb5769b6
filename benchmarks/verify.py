"""Known additions and planted errors: what ``jointz verify`` says.

    python -m benchmarks.verify --people 10
    python -m benchmarks.verify --people 10 --error torque_gain

Simulated people (realistic, three sensors) walk without and with 50 N*m/rad (or ``--stiffness``)
and 0.05 kg*m^2 more, in the order A B B A. Errors are planted in a copy of the study: torque or
goniometer 10 % too large, the torque 8 ms late; with ``strap`` they walk with straps a quarter as
stiff. Prints the intervals and verdicts of everybody, how many hold what was really mounted, and
how many are noticed.
"""

import argparse
import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import xarray as xr
from scipy.stats import binomtest

import jointz
from jointz.core.protocols.protocol import Protocol
from jointz.io.protocols import load_protocol
from jointz.rig.sim import presets
from jointz.verification.verify import Verification, verify

_INERTIA = 0.05
#: SD of what is added, of its value.
_SD = 0.02
#: Resonance of a strap that is a quarter as stiff.
_SLOWER = 0.5
_LATE_SAMPLES = 4


def main() -> None:
    """Simulate, plant, verify and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--per-point", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stiffness", type=float, default=50.0, help="N*m/rad of the band")
    errors = ["none", "torque_gain", "angle_gain", "lag", "strap"]
    parser.add_argument("--error", choices=errors, default="none")
    default = Path(tempfile.gettempdir()) / "jointz-verify"
    parser.add_argument("--keep", type=Path, default=default, help="folder of the studies")
    given = parser.parse_args()
    study = given.keep / ("strap" if given.error == "strap" else "none")
    if not study.exists():
        walk = protocol(given.per_point, given.stiffness)
        simulate(study, walk, given.people, given.seed, loose=given.error == "strap")
    if given.error not in ("none", "strap"):
        planted = given.keep / given.error
        shutil.copytree(study, planted, ignore=shutil.ignore_patterns("sessions"))
        plant(planted, given.error)
        report(verify(planted), study)
        return
    report(verify(study), study)


def protocol(per_point: int, stiffness: float) -> Protocol:
    """Return walking without and with the addition, in the order A B B A."""
    parts = {"inertia": _INERTIA, "stiffness": stiffness}
    load = {name: {"value": value, "sd": _SD * value} for name, value in parts.items()}
    raw = load_protocol("walking_doublets").model_dump(exclude_unset=True, mode="json")
    _, unperturbed, perturbed = raw["conditions"]
    perturbed["perturbations"]["count_per_point"] = per_point
    conditions: list[dict[str, Any]] = []
    for k, session in enumerate(("without", "with", "with_again", "without_again"), start=1):
        more = {"session": session} | ({} if "out" in session else {"load": "band"})
        conditions += [
            {**one, "name": f"{one['name']}_{k}", **more} for one in (unperturbed, perturbed)
        ]
    return Protocol.model_validate(
        raw | {"conditions": conditions, "loads": [{"name": "band", **load}]}
    )


def simulate(study: Path, walk: Protocol, people: int, seed: int, *, loose: bool) -> None:
    """Run the protocol on simulated people, with straps as usual or looser."""
    usual = presets.preset("realistic")
    personal = usual.personal
    if loose and personal is not None:
        low, high = (_SLOWER * end for end in personal.strap_range_hz)
        usual = replace(usual, personal=replace(personal, strap_range_hz=(low, high)))
    with patch.dict(presets.PRESETS, realistic=usual):
        jointz.run(
            walk,
            out=study,
            participants=people,
            seed=seed,
            preset="realistic",
            workers=1 if loose else 2,
            progress=False,
        )


def plant(study: Path, error: str) -> None:
    """Plant an error in all recordings of a study."""
    file = study / "study.toml"
    if error == "torque_gain":
        lines = file.read_text(encoding="utf-8").splitlines()
        at = next(k for k, line in enumerate(lines) if line.startswith("torque_constant"))
        lines[at] = f"torque_constant = {1.1 * float(lines[at].partition('=')[2]):.6g}"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return
    for recording in study.glob("*.nc"):
        with xr.open_dataset(recording) as opened:
            data = opened.load()
        if error == "angle_gain":
            data["angle"] = 1.1 * data["angle"]
        else:
            late = np.roll(data["current"].to_numpy(), _LATE_SAMPLES)
            data["current"] = data["current"].copy(data=late)
        data.to_netcdf(recording, engine="h5netcdf")


def report(found: Verification, study: Path) -> None:
    """Print everything about the people of a study."""
    print(found.summary())
    truth = json.loads((study / "ground_truth.json").read_text())["participants"]
    for part in ("stiffness", "inertia"):
        rows = [row for row in found.parts if row.part == part and row.participant in truth]
        mounted = [_mounted(truth[row.participant], part) for row in rows]
        inside = [
            row.ci_low <= true <= row.ci_high for row, true in zip(rows, mounted, strict=True)
        ]
        wide = [50.0 * (row.ci_high - row.ci_low) / row.stated for row in rows]
        print(f"{part}: inside {_share(inside)}, half-width {np.median(wide):.0f} % of it")
    verdicts = [verdict for person, verdict in found.verdicts.items() if person in truth]
    print(f"noticed: {_share([verdict == 'fail' for verdict in verdicts])}")


def _mounted(person: dict[str, Any], part: str) -> float:
    """Return the part of the addition that was really mounted."""
    return next(
        float(c["load"][part]) for c in person.values() if isinstance(c, dict) and "load" in c
    )


def _share(hits: list[bool]) -> str:
    band = binomtest(sum(hits), len(hits)).proportion_ci(method="wilson")
    return f"{sum(hits)}/{len(hits)} [{band.low:.2f}, {band.high:.2f}]"


if __name__ == "__main__":
    main()
