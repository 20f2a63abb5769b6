"""Chapter IV again: published tables tested, the walking experiment and its pilot simulated."""

import tempfile
from pathlib import Path

from jointz.reproduction.audit_claims import audit_claims
from jointz.reproduction.chapter4.pilot import pilot_results, pilot_study
from jointz.reproduction.chapter4.simulated import simulated_chapter
from jointz.reproduction.chapter4.statistics_claims import published_statistics
from jointz.reproduction.chapter4.walking import walking_study
from jointz.reproduction.reproduction_result import Reproduction
from jointz.reproduction.reproduction_tasks import provenance
from jointz.tasks.progress import Progress, RunProgress


def reproduce_chapter4(seed: int, preset: str, tell: Progress) -> Reproduction:
    """Test the published tables, run the walking experiment on simulated people, set it beside."""
    tell(0, 1, "published tables")
    published, curves = published_statistics()
    with tempfile.TemporaryDirectory() as folder:
        pilot = pilot_study(Path(folder), seed, preset, run_progress=_pulses("pilot", tell))
        walked = walking_study(
            Path(folder), seed, preset, tell, run_progress=_pulses("walking", tell)
        )
    pilot_table, curves["pilot"] = pilot_results(pilot)
    simulated, more = simulated_chapter(walked)
    return Reproduction(
        chapter=4,
        title="The human knee in walking",
        tables=(*published, *simulated, pilot_table, audit_claims(4)),
        curves={**curves, **more},
        notes=(
            "Two things stand on this page and are not to be mixed: statistics of the published "
            "tables, where only the printed people speak, and a simulated experiment on people of "
            "known impedance, which says what either method makes of such data.",
            "A printed statement that comes out only when the rows of a cell are counted as people "
            "is consistent with their having been counted so; it is no proof of what was done.",
            "The simulated people's impedance was chosen in the range of the literature, and their "
            "gait is that of published recordings; docs/protocols.md and docs/run.md say more.",
        ),
        provenance=provenance(4, seed, preset),
    )


def _pulses(what: str, tell: Progress) -> RunProgress:
    """Return what tells of all people's pulses together."""
    done: dict[str, tuple[int, int]] = {}

    def note(participant: str, condition: str, strides: int, completed: int, planned: int) -> None:
        del condition, strides
        if planned:
            done[participant] = (completed, planned)
        pulses, of = (sum(part) for part in zip(*done.values(), strict=True)) if done else (0, 1)
        tell(pulses, of, f"{what}: pulses")

    return note
