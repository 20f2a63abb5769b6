"""A lab as the study of a pilot shows it: sensors, people, calibration and walking."""

from jointz.analysis.participant_jobs import coupling_of, participant_settings, read_participant
from jointz.core.errors import DataError
from jointz.core.method_names import BAYESIAN
from jointz.core.priors import PriorsSpec
from jointz.core.study import Study
from jointz.identify.walking.coupling import COUPLINGS
from jointz.planning.laboratory import SENSORS, Actuator, Laboratory
from jointz.planning.schedule import Schedule
from jointz.planning.unperturbed_walking import recorded_walking
from jointz.report.wording import format_count

#: People of a pilot whose walking is used.
_MOST_WALKERS = 4


def lab_of_study(
    study: Study, schedule: Schedule, actuator: Actuator, coupling: str | None = None
) -> tuple[Laboratory, str]:
    """Return the lab of a study, and where its walking is from, in words.

    The coupling is that which the study states, or another one.
    """
    spec = study.spec
    if spec.kind != "walking" or spec.joint != "knee":
        raise DataError(
            f"pilot: expected walking of the knee, got {spec.kind} of the {spec.joint}."
        )
    walkers, strides = [], 0
    people = spec.participants[:_MOST_WALKERS]
    for person in people:
        settings = participant_settings(study, person.id, BAYESIAN, resamples=1, seed=0)
        recordings = read_participant(study, person.id, {})
        walking = recorded_walking(
            recordings,
            settings,
            who=person.id,
            timing_points=schedule.timing_points,
            window_s=schedule.design.window_s,
            n_strides=schedule.teaching_strides,
        )
        walkers.append(walking)
        strides += next(iter(walking.values())).n_recorded
    channels = set.intersection(*(set(next(iter(w.values())).channels) for w in walkers))
    first = people[0]
    own = [e for e in spec.recordings if e.participant == first.id]
    lab = Laboratory(
        people=people,
        walking=tuple(walkers),
        noise={name: noise for name, (channel, noise) in SENSORS.items() if channel in channels},
        actuator=actuator,
        calibration=study.spec.calibration_of(own[0]),
        torque_model=spec.torque_model,
        priors=spec.priors or PriorsSpec(),
        joint=spec.joint,
        coupling=COUPLINGS[coupling or coupling_of(study, BAYESIAN)],
    )
    who = format_count(len(people), "person", "people")
    where = study.root.resolve().name
    return lab.with_sensors(lab.noise), f"{strides} unperturbed strides of {who} of {where}"
