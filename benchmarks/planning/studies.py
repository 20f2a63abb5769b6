"""Are wishes reached? ``python -m benchmarks.planning.studies --studies 60 --run 10``.

Every study has another pilot, other sensors and another wanted half-width of K and B, to be reached
by 80 of 100 legs. All are planned; of those whose wish is not refused the first are walked by
other people of the population and analysed. Printed is the share of values whose interval is as
narrow as was asked.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from benchmarks.kept import Entry, add_options, by_person
from benchmarks.planning.obtained import obtained_of
from benchmarks.planning.predicted import PILOT_STRIDES
from benchmarks.realistic.rows import PRESET

from jointz.io.protocols import load_protocol
from jointz.planning.plan_study import plan
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.people import draw_person
from jointz.rig.sim.presets import preset
from jointz.rig.sim.sensors.motion_sensors import with_sensors

_SENSORS = (
    ("goniometer",),
    ("goniometer", "encoder"),
    ("goniometer", "encoder", "gyroscopes"),
)
_WISHES_PCT = (25.0, 50.0)
_WALKERS = 2
_ROOT = Path(__file__).parents[2]


def planned_study(seed: int, number: int) -> Entry:
    """Plan a study from a pilot of its own.

    Parameters
    ----------
    seed, number : int
        Of the population; study.
    """
    rng = np.random.default_rng([seed, number])
    sensors = _SENSORS[number % len(_SENSORS)]
    wish = round(float(rng.uniform(*_WISHES_PCT)))
    with TemporaryDirectory(prefix="pilot_") as scratch:
        pilot = simulate_study(
            Path(scratch) / "study",
            preset=with_sensors(preset(PRESET), sensors),
            participants=[draw_person(100 + number, seed=seed)],
            plan=WalkPlan(per_point=1),
            unperturbed_strides=PILOT_STRIDES,
        )
        made = plan("walking_doublets", pilot=pilot, half_width_pct=wish, seed=number)
    return {
        "number": number,
        "sensors": sensors,
        "wish_pct": wish,
        "refused": list(made.refused),
        "minutes": made.minutes,
        "counts": {e.timing_point: e.pulses for e in made.estimates},
        "protocol": made.protocol_text,
    }


def run_study(study: Entry, seed: int, number: int) -> Entry:
    """Let people walk a planned study; return half-widths of K and B, infinite if undecided.

    Parameters
    ----------
    study : Entry
        Of :func:`planned_study`.
    seed, number : int
        Of the population; study.
    """
    with TemporaryDirectory(prefix="protocol_") as scratch:
        file = Path(scratch) / "protocol.toml"
        file.write_text(study["protocol"])
        pulses = load_protocol(file).pulses
    settings = with_sensors(preset(PRESET), study["sensors"])
    walk = WalkPlan(per_point=study["counts"], pulses=pulses)
    half = []
    for k in range(_WALKERS):
        person = draw_person(1000 + _WALKERS * number + k, seed=seed)
        cells = obtained_of(person, settings, walk, 0.15)["cells"]
        half += [
            np.inf if c["value"] is None else (c["high"] - c["low"]) / (2.0 * abs(c["value"]))
            for c in cells
            if c["parameter"] != "inertia"
        ]
    return {"number": number, "half_width_pct": [min(100.0 * h, 1e6) for h in half]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan studies, run some, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line by default.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.planning.studies")
    parser.add_argument("--studies", type=int, default=60)
    parser.add_argument("--run", type=int, default=10, help="of those that are not refused")
    add_options(
        parser, people=1, kept=_ROOT / ".accuracy-cache" / "planned", table=Path("studies.csv")
    )
    asked = parser.parse_args(arguments)
    keep = partial(by_person, workers=asked.workers, tell=partial(print, file=sys.stderr))
    studies = keep(
        partial(planned_study, asked.seed),
        range(asked.studies),
        asked.kept / "plans" / f"{asked.seed}.jsonl",
    )
    kept = [s for s in studies if not s["refused"]]
    print(f"{len(kept)} of {len(studies)} wishes are kept; minutes, median: "
          f"{np.median([s['minutes'] for s in kept]):.0f}")  # fmt: skip
    for study in kept[: asked.run]:
        number = study["number"]
        (done,) = keep(
            partial(run_study, study, asked.seed),
            [number],
            asked.kept / "runs" / f"{asked.seed}.jsonl",
        )
        share = np.mean(np.array(done["half_width_pct"]) <= study["wish_pct"])
        print(f"{number:3} {', '.join(study['sensors']):38} {study['wish_pct']} % wished: "
              f"{100 * share:.0f} % reached; {study['minutes']:.0f} min", flush=True)  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
