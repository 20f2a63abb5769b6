"""What a plan says of one person, from unperturbed walking and the priors alone."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from benchmarks.kept import Entry
from benchmarks.planning.obtained import PLANNED
from benchmarks.realistic.rows import PARAMETERS, RealisticRow, preset_of

from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.study_reader import open_study
from jointz.planning.laboratory import Actuator, Laboratory
from jointz.planning.plan_study import lab_of_study
from jointz.planning.predicted_estimates import PlannedLeg, drawn_parameters, typical_leg
from jointz.planning.schedule import Schedule, recorded_schedule
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan
from jointz.rig.sim.people import draw_person

#: Strides of the pilot: about four minutes.
PILOT_STRIDES = 200
_TORQUE_NM = 17.0
#: Legs drawn for a person; the people's together show the spread.
_DRAWN = 2


def schedule_of(row: RealisticRow) -> Schedule:
    """Return the schedule of a row's direct walk.

    Parameters
    ----------
    row : RealisticRow
        Pulses, sensors and window.
    """
    plan = row.plan
    return recorded_schedule(
        row.name,
        plan.pulses or (plan.pulse,),  # type: ignore[arg-type]
        TIMING_POINTS,
        plan.counts,
        plan.gap_strides,
        window_s=row.window_s,
        strides=0.0,
        participants=1,
    )


def lab_of_person(row: RealisticRow, seed: int, number: int) -> Laboratory:
    """Let a person walk without pulses, and return the lab that a plan sees.

    Parameters
    ----------
    row : RealisticRow
        Pulses, sensors and window.
    seed, number : int
        Of the population; person, the same in all rows.
    """
    person = draw_person(number, seed=seed)
    with TemporaryDirectory(prefix="pilot_") as scratch:
        study = simulate_study(
            Path(scratch) / "study",
            preset=preset_of(row),
            participants=[person],
            plan=WalkPlan(per_point=1),
            unperturbed_strides=PILOT_STRIDES,
        )
        return lab_of_study(open_study(study), schedule_of(row), Actuator(_TORQUE_NM))[0]


def predicted(name: str, seed: int, number: int) -> Entry:
    """Return sds of logarithms and half-widths of the person's typical leg and of drawn legs.

    Parameters
    ----------
    name : str
        Row of :data:`~benchmarks.planning.obtained.PLANNED`.
    seed, number : int
        Of the population; person, the same in all rows.
    """
    row = PLANNED[name]
    lab, schedule = lab_of_person(row, seed, number), schedule_of(row)
    counts = {k: float(n) for k, n in schedule.counts.items()}
    middle = typical_leg(lab, schedule.design).estimates(counts)
    size = (len(PARAMETERS), len(TIMING_POINTS))
    thetas = drawn_parameters(lab, schedule.design, n=_DRAWN, seed=1000 * seed + number)
    drawn = [_half_width(lab, schedule, counts, k, theta) for k, theta in enumerate(thetas)]
    return {
        "number": number,
        "sd": middle.moments.sd[: size[0] * size[1]].reshape(size).tolist(),
        "half_width": middle.half_width.tolist(),
        "decided": middle.decided.tolist(),
        "drawn": drawn,
    }


def _half_width(
    lab: Laboratory, schedule: Schedule, counts: dict[str, float], k: int, theta: np.ndarray
) -> Sequence[Sequence[float]]:
    half = PlannedLeg(lab, schedule.design, k, theta).estimates(counts).half_width
    return half.tolist()  # type: ignore[no-any-return]
