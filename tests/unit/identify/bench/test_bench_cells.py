"""Cases of a bench: what is known of its instruments reaches the fit of whole trials."""

import numpy as np
import pandas as pd
import pytest

from jointz.core.recording import build_recording
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec
from jointz.identify.bench.bench_cells import _lag
from jointz.identify.participant import analyze_participant
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput
from jointz.identify.study_kinds import BENCH

RATE_HZ = 500.0
SPRING = 160.0  # N*m/rad, hardly any inertia: a lag and a damping are one and the same
LATE_S = 0.005


def analyzed(table=None, *, position_m=None, **calibration):
    """Return what is found of a spring whose angle is shown late."""
    rng = np.random.default_rng(4)
    t = np.arange(int(20 * RATE_HZ)) / RATE_HZ
    lines = [(0.03, 7.0), (0.01, 23.0), (0.006, 41.0)]

    def angle_at(time):
        return sum(size * np.sin(omega * time) for size, omega in lines)

    channels = {
        "angle": angle_at(t - LATE_S) + rng.normal(0.0, 1e-5, t.size),
        "torque": SPRING * angle_at(t) + rng.normal(0.0, 0.01, t.size),
        "command": 7.0 * (np.isin(np.floor(t), (3, 6, 9)) & (t % 1.0 < 0.2)),
    }
    if position_m is not None:
        channels["position"] = position_m * t
    units = {"position": "m"}
    recording = build_recording(t, channels, units=units, condition="perturbed", file="spring.csv")
    settings = ParticipantSettings(
        kind=BENCH, perturbations=PerturbationsSpec(), methods=("full_record",), n_resamples=10
    )
    known = CalibrationSpec(**{k: Calibrated(value=v, sd=1e-4) for k, v in calibration.items()})
    return analyze_participant("rig", [RecordingInput(recording, known, table)], settings)


def estimated(**calibration):
    """Return the case of the spring."""
    found = analyzed(**calibration)
    (cell,) = found.cells["full_record"]
    assert cell.method == "full_record"
    assert [round(s.rate_hz) for s in found.sampling] == [RATE_HZ]
    return cell


@pytest.mark.parametrize(
    "known",
    [
        {"angle_lag_s": LATE_S},
        {"torque_lag_s": -LATE_S},
        {"angle_lag_s": LATE_S + 0.002, "torque_lag_s": 0.002},
    ],
)
def test_a_calibrated_lag_of_either_signal_is_used(known):
    cell = estimated(**known)

    (lag,) = [p for p in cell.nuisance if p.name == "torque_lag"]
    assert lag.value == pytest.approx(-LATE_S, abs=2e-4)
    assert cell.parameter("stiffness").value == pytest.approx(SPRING, rel=0.01)


def test_without_one_the_lag_of_a_spring_is_not_told():
    cell = estimated()

    (lag,) = [p for p in cell.nuisance if p.name == "torque_lag"]
    assert lag.status == "undecided"


def test_the_difference_of_both_lags_has_the_sd_of_both():
    known = CalibrationSpec(
        torque_lag_s=Calibrated(value=0.003, sd=3e-4), angle_lag_s=Calibrated(value=0.001, sd=4e-4)
    )

    assert _lag(known) == pytest.approx((0.002, 5e-4))
    assert _lag(CalibrationSpec()) is None


def test_a_position_that_is_no_angle_is_not_taken_off_the_angle():
    alone, beside = estimated(angle_lag_s=LATE_S), estimated(angle_lag_s=LATE_S, position_m=0.1)

    assert beside.parameters == alone.parameters


def test_a_pulse_outside_the_recording_is_no_part_of_its_trial():
    table = pd.DataFrame({"onset_s": [3.0, 6.0, 9.0, 25.0], "timing_point": ""})
    table = table.assign(duration_s=0.2, amplitude_nm=7.0)
    found = analyzed(table, angle_lag_s=LATE_S)

    assert [p.code for p in found.pulses] == ["", "", "", "edge_of_record"]
    (cell,) = found.cells["full_record"]
    assert cell.method == "full_record"
    assert (cell.n_used, cell.n_excluded) == (3, 1)
