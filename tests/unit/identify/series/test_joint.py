"""What goes into identify_joint, what comes out, and what it refuses."""

import json

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student_t

from jointz.core.errors import DataError, EstimationError
from jointz.core.recording import build_recording
from jointz.identify.series.joint import identify_joint
from jointz.results.series.joint_fit import JointFit

RATE_HZ = 500.0


def record(*, duration_s: float = 15.0, amplitude: float = 0.02) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(11)
    t = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    w = 2 * np.pi * np.linspace(0.2, 12.0, 25)[:, None]
    phase = rng.uniform(0, 2 * np.pi, 25)[:, None]
    size = amplitude / (1 + w / 20.0)
    angle = np.sum(size * np.sin(w * t + phase), axis=0)
    torque = np.sum(
        size * ((80.0 - 0.02 * w**2) * np.sin(w * t + phase) + 1.2 * w * np.cos(w * t + phase)),
        axis=0,
    )
    slow = 0.05 * np.sin(2 * np.pi * 0.37 * t + 1.0) + 0.02 * rng.standard_normal(t.size)
    return {"time": t, "angle": angle, "torque": torque + slow}


@pytest.fixture(scope="module")
def fit() -> JointFit:
    return identify_joint(record(), input="angle")


def test_recording_frame_mapping_and_arrays_give_the_same_fit(fit: JointFit) -> None:
    data = record()
    recording = build_recording(
        data["time"], {name: data[name] for name in ("angle", "torque")}, sha256="abc"
    )
    from_recording = identify_joint(recording, input="angle")
    assert from_recording.settings["sha256"] == "abc"
    assert from_recording.parameters == fit.parameters
    assert identify_joint(pd.DataFrame(data), input="angle") == fit
    assert identify_joint(**data, input="angle") == fit


def test_rate_and_time_give_the_same_fit(fit: JointFit) -> None:
    data = record()
    del data["time"]
    by_rate = identify_joint(**data, rate_hz=RATE_HZ, input="angle")
    found = [p.value for p in by_rate.parameters]
    np.testing.assert_allclose(found, [p.value for p in fit.parameters], rtol=1e-9)


def test_offsets_change_nothing(fit: JointFit) -> None:
    data = record()
    data["angle"] += 0.7
    data["torque"] -= 12.0
    moved = identify_joint(data, input="angle")
    np.testing.assert_allclose(
        [p.value for p in moved.parameters], [p.value for p in fit.parameters], rtol=1e-9
    )


def test_torque_on_the_device_is_turned(fit: JointFit) -> None:
    data = record()
    data["torque"] = -data["torque"]
    turned = identify_joint(data, input="angle", torque_acts_on="device")
    assert [p.value for p in turned.parameters] == pytest.approx(
        [p.value for p in fit.parameters], rel=1e-12
    )


def test_jitter_of_the_clock_is_resampled() -> None:
    data = record()
    rng = np.random.default_rng(12)
    jittered = data["time"] + rng.uniform(-1e-4, 1e-4, data["time"].size)
    moved = {"time": jittered} | {
        name: np.interp(jittered, data["time"], data[name]) for name in ("angle", "torque")
    }
    found = identify_joint(moved, input="angle")
    assert found.parameter("stiffness").value == pytest.approx(80.0, rel=0.01)


def test_the_dictionary_is_json_and_comes_back_equal(fit: JointFit) -> None:
    text = json.dumps(fit.to_dict(), allow_nan=False)
    assert JointFit.from_dict(json.loads(text)) == fit
    assert JointFit.from_dict(fit.to_dict()) == fit


def test_the_dictionary_has_the_promised_keys(fit: JointFit) -> None:
    data = fit.to_dict()
    assert data["model"] == "kbj"
    assert data["status"] == "ok"
    assert list(data["parameters"]) == ["stiffness", "damping", "inertia"]
    stiffness = data["parameters"]["stiffness"]
    assert stiffness["unit"] == "N*m/rad"
    assert stiffness["ci"][0] < stiffness["value"] < stiffness["ci"][1]
    assert 99.0 < data["vaf_pct"] <= 100.0


def test_a_dictionary_of_another_schema_is_refused(fit: JointFit) -> None:
    with pytest.raises(ValueError, match=r"expected schema 'jointz\.JointFit/1', got 'other'"):
        JointFit.from_dict(fit.to_dict() | {"schema": "other"})


def test_the_frame_has_one_row_a_parameter(fit: JointFit) -> None:
    frame = fit.to_frame()
    assert frame["parameter"].tolist() == ["stiffness", "damping", "inertia"]
    assert frame["unit"].tolist() == ["N*m/rad", "N*m*s/rad", "kg*m^2"]


def test_an_unknown_parameter_is_named(fit: JointFit) -> None:
    with pytest.raises(KeyError, match="it has stiffness, damping, inertia"):
        fit.parameter("mass")


def test_the_summary_tells_values_intervals_and_warnings() -> None:
    text = identify_joint(record(amplitude=0.2), estimator="least_squares").summary()
    assert "stiffness" in text
    assert "N*m/rad (95% interval" in text
    assert "block sandwich" in text
    assert "biased low by torque inside the joint" in text
    assert "rad from its mean" in text


def test_the_plot_shows_measured_and_modelled(fit: JointFit) -> None:
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    axes = fit.plot()
    assert [line.get_label() for line in axes.lines] == ["measured", "model"]
    assert axes.get_ylabel() == "torque (N*m)"
    assert "K = 80" in axes.get_title()
    plt.close(axes.figure)


def test_the_series_is_a_few_readable_seconds(fit: JointFit) -> None:
    time_s = np.array(fit.series.time_s)
    assert 100 < time_s.size <= 2000
    assert 4.0 < time_s[-1] - time_s[0] <= 5.0
    error = np.array(fit.series.measured) - np.array(fit.series.modelled)
    assert np.std(error) < 0.1 * np.std(fit.series.measured)


def test_the_vaf_of_the_admittance_is_of_the_angle() -> None:
    assert identify_joint(record()).vaf_of == "angle"


def test_a_higher_level_gives_a_wider_interval(fit: JointFit) -> None:
    wide = identify_joint(record(), input="angle", ci_level=0.99).parameter("stiffness")
    narrow = fit.parameter("stiffness")
    assert wide.ci_level == 0.99
    assert wide.ci_low < narrow.ci_low < narrow.ci_high < wide.ci_high


def test_the_interval_follows_from_the_covariance(fit: JointFit) -> None:
    stiffness = fit.parameter("stiffness")
    sd = np.sqrt(fit.covariance[0][0])
    freedom = int(fit.ci_method.split("with ")[1].split()[0])
    assert stiffness.ci_high - stiffness.value == pytest.approx(student_t.ppf(0.975, freedom) * sd)


def test_a_record_too_short_for_an_interval_is_undecided() -> None:
    rng = np.random.default_rng(13)
    data = record(duration_s=1.0)
    walk = np.cumsum(rng.standard_normal(data["time"].size))
    data["torque"] = data["torque"] + 0.2 * walk
    short = identify_joint(data, input="angle")
    assert short.status == "undecided"
    assert short.parameter("stiffness").value is None
    assert short.covariance == ()
    assert short.check.finding == "not_tested"
    assert "the residual was not tested" in short.summary()
    assert "too short for an interval" in short.warnings[0]
    assert "undecided" in short.summary()
    assert JointFit.from_dict(short.to_dict()) == short


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"angle": None}, DataError, "no channel 'angle'"),
        ({"torque": np.zeros(10)}, DataError, "equally long"),
        (
            {name: np.zeros(0) for name in ("angle", "torque", "time")},
            DataError,
            "at least two samples",
        ),
        ({"cutoff_hz": 250.0}, DataError, r"cutoff_hz < 250 \(half the sampling rate\), got 250"),
        ({"cutoff_hz": 0.0}, DataError, "cutoff_hz"),
        ({"model": "arx"}, ValueError, "model: expected one of kbj, irf, frf, reflex; got 'arx'"),
        ({"estimator": "best"}, ValueError, "least_squares, bounded_least_squares, admittance"),
        ({"input": "force"}, ValueError, "torque, angle"),
        ({"torque_acts_on": "hand"}, ValueError, "joint, device"),
        ({"ci_level": 95.0}, ValueError, "ci_level"),
        ({"rate_hz": 500.0}, DataError, "got both"),
        ({"time": None}, DataError, "expected time stamps or rate_hz"),
        ({"estimator": "instrumental_variable"}, DataError, "no channel 'command'"),
        (
            {"estimator": "instrumental_variable", "command": np.zeros(7500)},
            DataError,
            "'command' is constant",
        ),
    ],
)
def test_impossible_requests_are_refused(
    changes: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        identify_joint(**(record() | changes))


def test_a_recording_and_arrays_together_are_refused() -> None:
    with pytest.raises(ValueError, match="either a recording or arrays; got a recording and angle"):
        identify_joint(record(), angle=np.zeros(3))


def test_missing_samples_are_counted_and_located() -> None:
    data = record()
    data["angle"][[40, 41, 99]] = np.nan
    with pytest.raises(DataError, match=r"'angle' has 3 sample\(s\) .* the first in row 41"):
        identify_joint(data)


def test_a_gap_is_named_with_row_and_time() -> None:
    data = {name: np.delete(values, slice(1000, 1100)) for name, values in record().items()}
    with pytest.raises(DataError, match=r"row 1000: a gap of 0.202 s after 1.998 s") as caught:
        identify_joint(data)
    assert caught.value.row == 1000


def test_time_that_goes_back_is_named() -> None:
    data = record()
    data["time"][700] = 0.0
    with pytest.raises(DataError, match="row 701: time does not increase"):
        identify_joint(data)


def test_a_record_of_a_fraction_of_a_second_is_refused() -> None:
    with pytest.raises(DataError, match=r"lasts 0.2 s, at least 0.5333 s are needed"):
        identify_joint(record(duration_s=0.2))


@pytest.mark.parametrize("channel", ["angle", "torque"])
@pytest.mark.parametrize("level", [0.0, 1.3])
def test_a_constant_channel_has_a_code(channel: str, level: float) -> None:
    data = record()
    data[channel] = np.full_like(data[channel], level)
    with pytest.raises(EstimationError, match=f"the {channel} is constant") as caught:
        identify_joint(data)
    assert caught.value.code == f"constant_{channel}"


@pytest.mark.parametrize("estimator", ["least_squares", "admittance"])
def test_a_single_sine_cannot_tell_stiffness_from_inertia(estimator: str) -> None:
    t = np.arange(10_000) / 1000.0
    angle = 0.05 * np.sin(2 * np.pi * 2.0 * t)
    torque = 3.0 * np.sin(2 * np.pi * 2.0 * t + 0.4)
    with pytest.raises(EstimationError, match="more than one frequency") as caught:
        identify_joint(angle=angle, torque=torque, rate_hz=1000.0, estimator=estimator)
    assert caught.value.code == "ill_conditioned"
