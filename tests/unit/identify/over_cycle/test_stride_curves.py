"""Strides of somebody who wore no device: which count, and what stands in them."""

import numpy as np
import pytest

from jointz.core.recording import build_recording
from jointz.core.study import CalibrationSpec, PerturbationsSpec, UserExclusion
from jointz.identify.over_cycle.stride_curves import NODES, stride_curves
from jointz.identify.preparation.sources import ParticipantSettings, RecordingInput, prepare_sources
from jointz.identify.study_kinds import WALKING

STRIDE_S = 1.0


def recording(*, condition="no_device", side="left", missing=(), moment=True):
    time = np.arange(1200) / 100.0
    angle = 0.4 + 0.2 * np.sin(2 * np.pi * time / STRIDE_S)
    angle[list(missing)] = np.nan
    channels = {"angle": angle, "contact": (time % STRIDE_S < 0.6).astype(float)}
    if condition == "perturbed":
        channels["command"] = np.zeros(time.size)
    if moment:
        channels["torque"] = 50.0 * (0.4 + 0.2 * np.sin(2 * np.pi * time / STRIDE_S))
    return build_recording(
        time, channels, condition=condition, side=side, file=f"{side}.csv", contact_kind="contact"
    )


def found(*recordings, exclusions=()):
    settings = ParticipantSettings(
        kind=WALKING, perturbations=PerturbationsSpec(), n_resamples=2, user_exclusions=exclusions
    )
    inputs = [RecordingInput(r, CalibrationSpec()) for r in recordings]
    return stride_curves("S01", prepare_sources(inputs, settings))


def test_every_stride_goes_from_one_heel_strike_to_the_next():
    (curves,) = found(recording())

    assert curves.angle.shape == curves.moment.shape == (10, NODES)
    cycle = np.linspace(0.0, 1.0, NODES)
    truth = 0.4 + 0.2 * np.sin(2 * np.pi * cycle)
    np.testing.assert_allclose(curves.angle, np.tile(truth, (10, 1)), atol=1e-3)
    np.testing.assert_allclose(curves.moment, 50.0 * curves.angle, atol=1e-9)


def test_sides_are_kept_apart_and_recordings_of_a_side_together():
    sides = found(recording(), recording(side="right"), recording(side="right"))

    assert [(c.side, len(c.angle)) for c in sides] == [("left", 10), ("right", 20)]


def test_a_stride_with_a_long_hole_does_not_count():
    (curves,) = found(recording(missing=range(350, 353)))

    assert len(curves.angle) == 9
    assert np.isfinite(curves.angle).all()


def test_a_stride_that_the_user_left_out_does_not_count():
    line = UserExclusion("S01", "left.csv", 4.0, "exclude", "stumbled")

    (curves,) = found(recording(), exclusions=(line,))

    assert len(curves.angle) == 9


@pytest.mark.parametrize("without", [{"condition": "unperturbed"}, {"moment": False}])
def test_a_device_or_no_moment_makes_no_curves(without):
    assert found(recording(**without)) == ()


@pytest.mark.parametrize("other", ["unperturbed", "perturbed"])
def test_one_file_with_every_condition_is_of_somebody_with_a_device(other):
    assert found(recording(), recording(condition=other)) == ()
