"""A simulated study with encoder and gyroscopes, from its recordings to the methods text."""

import json

import pytest

import jointz
from jointz.analysis.paper.methods_text import methods_text
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.session.simulate_study import simulate_study
from jointz.sim.direct_walk import WalkPlan

PULSES = (
    DoubletPulse(
        name="doublet",
        kind="doublet",
        amplitudes_nm=(12.0, 17.0),
        durations_s=(0.075, 0.045),
        direction="both",
    ),
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return simulate_study(
        tmp_path_factory.mktemp("sensors") / "study",
        preset="realistic",
        plan=WalkPlan(per_point=16, timing_points={"MST": 21.5, "PSW": 56.0}, pulses=PULSES),
        seed=3,
    )


@pytest.fixture(scope="module")
def analysis(study):
    return jointz.analyze(study, resamples=10, progress=False)


def test_sensors_tell_their_lags(study, analysis):
    truth = json.loads((study / "ground_truth.json").read_text())
    true = truth["participants"]["S01"]["perturbed"]["instruments"]
    found = {p.name: p for p in analysis.cells[0].nuisance}

    assert set(found) == {"angle_lag", "joint_encoder_lag", "joint_velocity_lag"}
    for lag, sensor in (
        ("joint_encoder_lag", "joint_encoder"),
        ("joint_velocity_lag", "shank_velocity"),
    ):
        assert found[lag].value == pytest.approx(true[sensor]["lag_s"], abs=1e-3)
        assert found[lag].ci_high - found[lag].ci_low < 2e-3


def test_b_and_j_are_decided_by_few_pulses(analysis):
    for cell in analysis.cells:
        for name in ("damping", "inertia"):
            found = cell.parameter(name)
            assert found.status == "ok"
            assert found.ci_high < 1.6 * found.value


def test_the_methods_text_names_the_sensors_and_their_priors(analysis):
    text = methods_text(analysis)

    assert "the encoder of the device and gyroscopes on shank and thigh" in text
    assert "thigh damping" in text
    assert "lag of the device's encoder" in text
