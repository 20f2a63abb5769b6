"""Studies and analyses that several tests use."""

from dataclasses import replace

from tests.unit.conftest import recommended_analysis

from jointz.core.method_names import BAYESIAN
from jointz.results.estimates import ParameterEstimate

#: Estimated lag of the angle of each participant.
LAGS_S = {"S01": 0.004, "S02": 0.007, "S03": 0.010}


def bayesian_analysis(*, coupling="rigid"):
    """Return an analysis of three people by the method bayesian, beside the dissertation's."""
    made = recommended_analysis()
    return replace(
        made,
        cells=tuple(map(_bayesian, made.cells)),
        population=tuple(replace(m, method=BAYESIAN) for m in made.population),
        models=(),
        settings={**made.settings, "method": BAYESIAN, "coupling": coupling},
    )


def _bayesian(cell):
    lag_s = LAGS_S[cell.participant]
    lag = ParameterEstimate("angle_lag", lag_s, lag_s - 0.002, lag_s + 0.002, "ok")
    parts = {name: {"lag": 0.1, "pulses": 0.1} for name in ("stiffness", "damping", "inertia")}
    return replace(cell, method=BAYESIAN, budget={}, nuisance=(lag,), through_instruments=parts)


def study_record(**parts):
    """Return a study as a provenance holds it; people who have no recordings get one each."""
    people = parts.get("participants", [{"id": person} for person in LAGS_S])
    recordings = [
        {"participant": p["id"], "file": f"{p['id']}.csv", "condition": "perturbed"} for p in people
    ]
    return {
        "jointz": 1,
        "joint": "knee",
        "kind": "walking",
        "channels": {"angle": {"column": "knee"}, "torque": {"column": "tau"}},
        "participants": people,
        "recordings": recordings,
        **parts,
    }


def without_recordings(study, person, condition):
    """Leave the recordings of a person in a condition out of a study's table."""
    file = study.root / "study.toml"
    parts = file.read_text().split("[[recordings]]")
    kept = [p for p in parts if not (f'"{person}"' in p and f'"{condition}"' in p)]
    assert len(kept) < len(parts)
    file.write_text("[[recordings]]".join(kept))
