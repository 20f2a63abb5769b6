"""Pulses of a bench one by one, by the method that was asked for, and what is told about them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from jointz.analysis.likelihood_pulses import likelihood_pulses
from jointz.analysis.study_statistics import study_statistics
from jointz.core.events import PulseEstimate
from jointz.core.method_names import PULSE_LIKELIHOOD
from jointz.core.study import Calibrated, CalibrationSpec, PerturbationsSpec, TorqueModelSpec
from jointz.identify.participant import ParticipantResult
from jointz.identify.preparation.sources import RecordingInput
from jointz.results.estimates import CellEstimate, ParameterEstimate

K, B, J, LAG_S = 168.0, 0.3, 0.0374, 0.002
TIME = np.arange(1800) / 900.0
GAIN = 0.95
#: Sizes and angular frequencies, rad and rad/s.
MOTION = ((0.03, 7.0), (0.004, 55.0))


def recording():
    """Return a load that moves fast and slowly, its torque recorded late and too small."""
    angle, torque = np.zeros(TIME.size), np.zeros(TIME.size)
    late = TIME - LAG_S
    for size, omega in MOTION:
        angle += size * np.sin(omega * TIME)
        torque += size * (
            (K - J * omega**2) * np.sin(omega * late) + B * omega * np.cos(omega * late)
        )
    rng = np.random.default_rng(0)
    channels = {
        "angle": angle + 1e-6 * rng.standard_normal(TIME.size),
        "torque": GAIN * (torque + 1e-3 * rng.standard_normal(TIME.size)),
    }
    data = {name: ("time", values) for name, values in channels.items()}
    attrs = {"file": "a.nc", "trial": "1", "condition": "perturbed"}
    gain = CalibrationSpec(torque_gain=Calibrated(value=GAIN, sd=0.01))
    return RecordingInput(xr.Dataset(data, {"time": TIME}, attrs), gain)


def pulse(onset_s, point="A", sign=1):
    direction = "with" if onset_s < 1.0 else "against"
    return PulseEstimate(
        "case-1", point, "a.nc", "1", onset_s, sign, direction, 150.0, -0.1, 0.03, 99.0
    )


def cell(point="A", method="full_record", n_used=2):
    lag = ParameterEstimate("torque_lag", LAG_S, LAG_S - 1e-4, LAG_S + 1e-4, "ok")
    parameters = (ParameterEstimate("stiffness", K, K - 1, K + 1, "ok"),)
    return CellEstimate(
        "case-1", point, None, parameters, 99.0, n_used, 0, method, "none", nuisance=(lag,)
    )


def by_likelihood(single, cells):
    return likelihood_pulses(
        [recording()], single, cells, perturbations=PerturbationsSpec(), torque_model=None
    )


def test_a_pulse_is_estimated_by_itself_with_gain_and_lag_taken_out():
    first, second = by_likelihood([pulse(0.3), pulse(1.2)], [cell()])
    for found in (first, second):
        assert found.method == PULSE_LIKELIHOOD
        assert found.stiffness == pytest.approx(K, rel=0.01)
        assert found.damping == pytest.approx(B, abs=0.05)
        assert found.inertia == pytest.approx(J, rel=0.01)
    assert (second.onset_s, second.direction) == (1.2, "against")


def test_a_gain_of_the_torque_is_not_that_of_the_rotor_in_a_torque_from_current():
    rotor, given = 0.1, recording()
    acceleration = sum(-s * w**2 * np.sin(w * (TIME - LAG_S)) for s, w in MOTION)
    channels = {
        "current": given.recording["torque"].to_numpy() + GAIN * rotor * acceleration,
        "motor_velocity": np.zeros(TIME.size),
        "motor_acceleration": acceleration,
    }
    data = given.recording.drop_vars("torque").assign(
        {name: ("time", values) for name, values in channels.items()}
    )
    model = TorqueModelSpec(gear_ratio=1.0, torque_constant=1.0, rotor_inertia=rotor)
    (found,) = likelihood_pulses(
        [replace(given, recording=data)],
        [pulse(0.3)],
        [cell()],
        perturbations=PerturbationsSpec(),
        torque_model=model,
    )
    assert found.stiffness == pytest.approx(K, rel=0.01)
    assert found.inertia == pytest.approx(J, rel=0.01)


def test_a_case_that_was_estimated_from_responses_keeps_its_pulses():
    given = [pulse(0.3, "B")]
    assert by_likelihood(given, [cell("B", "dissertation")]) == tuple(given)


def test_a_pulse_at_the_end_of_the_record_is_left_out():
    assert len(by_likelihood([pulse(0.3), pulse(1.9)], [cell()])) == 1


# --- what is told --------------------------------------------------------------------------------


def statistics(cells, single, method="full_record"):
    spec = SimpleNamespace(
        kind="bench",
        of_people=False,
        participants=("case-1",),
        recordings=(),
        perturbations=PerturbationsSpec(),
    )
    study = SimpleNamespace(user_exclusions=(), spec=spec)
    result = ParticipantResult({}, tuple(single), (), (), ())
    return study_statistics(study, method, cells, [result])


def test_the_tests_of_pulses_name_the_method_of_their_estimates():
    given = [
        replace(pulse(0.1 * k, sign=1 if k % 2 else -1), method=PULSE_LIKELIHOOD) for k in range(8)
    ]
    assert statistics([cell(n_used=8)], given)["pulse_effects"]["methods"] == [PULSE_LIKELIHOOD]
