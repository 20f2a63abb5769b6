"""A simulated study with encoder and gyroscopes, from recordings to methods text and explorer."""

import json

import numpy as np
import pytest

import jointz
from jointz.analysis.paper.methods_text import methods_text
from jointz.analysis.pulse_traces import PulseKey, ReestimationRequest, read_traces
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.explorer.plots import Overlaid, overlay_figure
from jointz.explorer.results_files import pulses_of
from jointz.io.study_reader import open_study
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

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


@pytest.fixture(scope="module")
def traces(study, analysis):
    return read_traces(open_study(study), "S01", ReestimationRequest.of(analysis), analysis)


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


def test_every_shape_of_pulse_has_its_average_and_fit_as_signed(analysis, traces):
    shapes = set()
    for cell in analysis.cells:
        pulses = [p for p in pulses_of(analysis, cell.label, cell.timing_point) if not p.code]
        for shape, response in enumerate(cell.responses):
            windows = [traces[PulseKey.of(p)].windows["bayesian"] for p in pulses]
            windows = [w for w in windows if w.shape == shape]
            assert len(windows) == response.n_pulses
            shapes.add(shape)
            start = np.argmin(np.abs(windows[0].time_s - response.time_s[0]))
            kept = slice(start, start + response.time_s.size)
            angle = np.mean([w.response_angle for w in windows], axis=0)[kept]
            np.testing.assert_allclose(angle, response.angle, atol=1e-9)
            np.testing.assert_allclose(windows[0].fitted[kept], response.fitted_angle)
            assert {w.fits for w in windows} == {"angle"}
        if cell.responses:
            assert sum(r.n_pulses for r in cell.responses) == cell.n_used == len(pulses)
    assert len(shapes) > 1


def test_averages_lie_among_the_pulses_that_they_average(analysis, traces):
    cell = analysis.cells[0]
    windows = [
        (p, traces[PulseKey.of(p)].windows["bayesian"])
        for p in pulses_of(analysis, cell.label, cell.timing_point)
    ]
    pulses = [Overlaid(k, w, used=not p.code) for k, (p, w) in enumerate(windows)]

    for quantity in ("angle", "torque"):
        data = overlay_figure(pulses, cell, None, quantity=quantity)["data"]
        averages = [t for t in data if t["name"].startswith("average")]
        drawn = np.array([t["y"] for t in data if t["name"].startswith("pulse")])
        assert len(averages) == len(cell.responses) > 1
        assert averages[0]["name"] == f"average by shape, size and sign ({len(averages)})"
        for average in averages:
            beside = drawn[:, : len(average["y"])]
            assert (average["y"] <= beside.max(axis=0) + 1e-9).all()
            assert (average["y"] >= beside.min(axis=0) - 1e-9).all()
    # Doublets begin either way, and so do their averages.
    assert {np.sign(average["y"][20]) for average in averages} == {-1.0, 1.0}
    fits = [
        t
        for t in overlay_figure(pulses, cell, None, quantity="angle")["data"]
        if t["name"] == "fit"
    ]
    assert len(fits) == len(cell.responses)
