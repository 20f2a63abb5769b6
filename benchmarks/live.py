"""Sessions that estimates stop or steer: pulses they take, and coverage of what they give.

    python -m benchmarks.live --people 10 --wish 25 --may stop
    python -m benchmarks.live --people 10 --wish 30 --may steer stop

Prints the pulses of every person until all wishes held (or the plan was done), and how many
intervals of K, B and J cover the truth of the simulation, with Wilson's 95 % band. Without --may
every session takes all its pulses.
"""

import argparse
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from benchmarks.certificate import apparent
from scipy.stats import binomtest

import jointz
from jointz.core.protocols.protocol_models import LiveSpec
from jointz.io.protocols import load_protocol
from jointz.rig.experiment.files.journal import read_journal

_NAMES = ("stiffness", "damping", "inertia")


def main() -> None:
    """Run the sessions and print their numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=10)
    parser.add_argument("--wish", type=float, default=25.0)
    parser.add_argument("--may", nargs="*", default=[])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder of the study, which is kept")
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        study = given.keep or Path(folder) / "study"
        _run(study, given)
        _report(study)


def _run(study: Path, given: argparse.Namespace) -> None:
    spec = load_protocol("walking_doublets")
    if given.may:
        live = LiveSpec(may=tuple(given.may), planned_half_width_pct=given.wish)
        spec = spec.model_copy(update={"live": live})
    jointz.run(
        spec,
        out=study,
        participants=given.people,
        seed=given.seed,
        preset="realistic",
        workers=given.workers,
        progress=False,
    )


def _report(study: Path) -> None:
    numbers = [_pulses(journal) for journal in sorted(study.glob("sessions/*/journal.jsonl"))]
    print("pulses, stopped:", numbers)
    print(f"mean {np.mean([n for n, _ in numbers]):.1f}, stopped {sum(s for _, s in numbers)}")
    analysis = jointz.analyze(study, resamples=2, progress=False)
    people = json.loads((study / "ground_truth.json").read_text())["participants"]
    truth = apparent({who: walks["perturbed"]["timing_points"] for who, walks in people.items()})
    for name in _NAMES:
        inside: list[bool] = []
        widths: list[float] = []
        for cell in analysis.cells:
            estimate = cell.parameter(name)
            if estimate is None or estimate.status != "ok" or estimate.value is None:
                continue
            true = truth[cell.participant][cell.timing_point][name]
            low, high = estimate.ci_low or 0.0, estimate.ci_high or 0.0
            inside.append(low <= true <= high)
            widths.append(50.0 * (high - low) / estimate.value)
        if not inside:
            print(f"{name}: no value")
            continue
        band = binomtest(sum(inside), len(inside)).proportion_ci(method="wilson")
        print(
            f"{name}: {sum(inside)}/{len(inside)} cover [{band.low:.2f}, {band.high:.2f}], "
            f"half-width {np.median(widths):.0f} %"
        )


def _pulses(journal: Path) -> tuple[int, bool]:
    """Return the pulses of a session without shams, and whether a decision stopped it."""
    events = read_journal(journal)
    completed = sum(event["event"] == "pulse_completed" for event in events)
    return completed, any(event["event"] == "decided" and event["stop"] for event in events)


if __name__ == "__main__":
    main()
