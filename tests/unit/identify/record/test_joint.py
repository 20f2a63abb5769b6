"""What goes into identify_joint, what comes out, and what it refuses."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student_t

from jointz.core.errors import DataError, EstimationError
from jointz.core.recording import build_recording
from jointz.identify.record.joint import identify_joint
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


def values(fit) -> list[float | None]:
    return [p.unbounded if p.value is None else p.value for p in fit.parameters]


def test_recording_frame_mapping_and_arrays_give_the_same_fit(fit: JointFit) -> None:
    data = record()
    channels = {name: data[name] for name in ("angle", "torque")}
    from_recording = identify_joint(
        build_recording(data["time"], channels, sha256="abc"), input="angle"
    )
    assert from_recording.settings["sha256"] == "abc"
    assert from_recording.parameters == fit.parameters
    assert identify_joint(pd.DataFrame(data), input="angle") == fit
    assert identify_joint(**data, input="angle") == fit
    by_rate = identify_joint(**channels, rate_hz=RATE_HZ, input="angle")
    np.testing.assert_allclose(values(by_rate), values(fit), rtol=1e-9)
    with pytest.raises(ValueError, match="angle"):
        identify_joint(record(), angle=np.zeros(3))


@pytest.fixture(scope="module")
def long_record() -> dict[str, np.ndarray]:
    return record(duration_s=25.0)


@pytest.mark.parametrize("model", ["kbj", "irf", "frf", "reflex"])
def test_offsets_and_a_torque_on_the_device_change_nothing(model: str, long_record) -> None:
    moved = {
        "time": long_record["time"],
        "angle": long_record["angle"] + 0.7,
        "torque": 12.0 - long_record["torque"],
    }
    turned = identify_joint(moved, input="angle", model=model, torque_acts_on="device")
    plain = identify_joint(long_record, input="angle", model=model)
    same = [(a, b) for a, b in zip(values(turned), values(plain), strict=True) if b is not None]
    assert len(same) >= 3
    np.testing.assert_allclose(*zip(*same, strict=True), rtol=1e-6)


@pytest.mark.parametrize("level", [0.95, 0.99])
def test_the_interval_follows_from_the_covariance_and_its_level(level: float) -> None:
    fit = identify_joint(record(), input="angle", ci_level=level)
    stiffness = fit.parameter("stiffness")
    t = student_t.ppf(0.5 + level / 2, int(fit.ci_method.split("with ")[1].split()[0]))
    assert stiffness.ci_high - stiffness.value == pytest.approx(t * np.sqrt(fit.covariance[0][0]))


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
    assert JointFit.from_dict(short.to_dict()) == short


@pytest.mark.parametrize("estimator", ["least_squares", "admittance"])
def test_a_single_sine_cannot_tell_stiffness_from_inertia(estimator: str) -> None:
    t = np.arange(10_000) / 1000.0
    angle = 0.05 * np.sin(2 * np.pi * 2.0 * t)
    torque = 3.0 * np.sin(2 * np.pi * 2.0 * t + 0.4)
    with pytest.raises(EstimationError, match="frequency") as caught:
        identify_joint(angle=angle, torque=torque, rate_hz=1000.0, estimator=estimator)
    assert caught.value.code == "ill_conditioned"


def test_all_problems_of_the_samples_are_told_at_once() -> None:
    data = record()
    data["angle"][[40, 41, 99]] = np.nan
    del data["torque"]
    message = r"^identify_joint: no channel 'torque'.*'angle' has 3 sample\(s\) .*first in row 41"
    with pytest.raises(DataError, match=message):
        identify_joint(data)


T = record()["time"]
INSTRUMENT = {"estimator": "instrumental_variable"}


@pytest.mark.parametrize("model", ["kbj", "irf", "frf", "reflex"])
@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"torque": np.zeros(10)}, DataError, "equally long"),
        ({n: np.zeros(0) for n in ("angle", "torque", "time")}, DataError, "two samples"),
        ({"time": np.where(T[700] == T, 0.0, T)}, DataError, "row 701"),
        ({"time": T + (T >= 2.0)}, DataError, "row 1000"),
        ({"time": np.where(T < 8, T, 2 * T - 8)}, DataError, "rate"),
        ({"rate_hz": 500.0}, DataError, "rate_hz"),
        ({"time": None}, DataError, "rate_hz"),
        ({"input": "force"}, ValueError, "input"),
        ({"ci_level": 95.0}, ValueError, "ci_level"),
    ],
)
def test_impossible_requests_are_refused(model, changes, error, message) -> None:
    with pytest.raises(error, match=message):
        identify_joint(**(record() | changes), model=model)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"cutoff_hz": 250.0}, DataError, "cutoff_hz"),
        ({"cutoff_hz": 300.0, "model": "frf"}, DataError, "cutoff_hz"),
        ({"model": "arx"}, ValueError, "model"),
        ({"estimator": "best"}, ValueError, "least_squares"),
        ({"estimator": "admittance", "model": "reflex"}, DataError, "estimator"),
        ({"length_s": 0.1}, DataError, "length_s"),
        ({"length_s": 0.0, "model": "irf"}, ValueError, "length_s"),
        ({"length_s": 2.0, "model": "irf"}, DataError, "15 s"),
        ({"estimator": "instrumental_variable"}, DataError, "'command'"),
        ({**INSTRUMENT, "command": np.zeros(7500)}, DataError, "'command'"),
        ({"command": np.ones(7500), "model": "frf"}, DataError, "'command'"),
    ],
)
def test_impossible_requests_of_a_model_are_refused(changes, error, message) -> None:
    with pytest.raises(error, match=message):
        identify_joint(**(record() | changes))


@pytest.mark.parametrize(
    ("model", "seconds"), [("kbj", 0.2), ("frf", 0.2), ("frf", 1.0), ("reflex", 15.0)]
)
def test_a_short_record_is_refused(model, seconds) -> None:
    with pytest.raises(DataError, match=rf"{seconds:g} s|too short"):
        identify_joint(record(duration_s=seconds), model=model)


@pytest.mark.parametrize("model", ["kbj", "irf", "frf", "reflex"])
@pytest.mark.parametrize("channel", ["angle", "torque"])
def test_a_constant_channel_has_a_code(model: str, channel: str, long_record) -> None:
    data = long_record | {channel: np.full_like(long_record[channel], 1.3)}
    with pytest.raises(EstimationError, match=channel) as caught:
        identify_joint(data, model=model)
    assert caught.value.code == f"constant_{channel}"


def test_what_is_no_vector_of_real_numbers_in_si_is_refused_or_made_one():
    data = record()
    fit = partial(identify_joint, torque=data["torque"], rate_hz=RATE_HZ, input="angle")
    in_columns = fit(angle=data["angle"][:, None], torque=data["torque"][:, None])
    assert in_columns.parameters == fit(angle=data["angle"]).parameters
    masked = np.ma.array(data["angle"], mask=np.arange(data["angle"].size) == 7)
    with pytest.raises(DataError, match=r"1 sample\(s\) without a number, the first in row 8"):
        fit(angle=masked)
    for wrong in (data["angle"] + 0j, np.arange(data["angle"].size).astype("m8[ms]")):
        with pytest.raises(DataError, match="'angle': expected real numbers"):
            fit(angle=wrong)
    with pytest.raises(DataError, match="turns further or faster than any joint"):
        fit(angle=100.0 * data["angle"])
    assert fit(angle=np.rad2deg(data["angle"]), units={"angle": "degrees"}).status == "ok"


@pytest.mark.parametrize("input", ["angle", "torque"])
@pytest.mark.parametrize("model", ["kbj", "irf", "frf", "reflex"])
def test_the_torque_of_the_other_body_is_refused(model, input):
    with pytest.raises(EstimationError) as caught:
        identify_joint(record(), torque_acts_on="device", model=model, input=input)
    assert caught.value.code == "opposite_sign"


@pytest.mark.parametrize("input", ["angle", "torque"])
def test_noise_decides_nothing(input):
    data = record()
    noise = np.random.default_rng(3).standard_normal((2, data["time"].size))
    nothing = identify_joint(
        angle=0.05 * noise[0], torque=5.0 * noise[1], rate_hz=RATE_HZ, input=input
    )
    assert {p.status for p in nothing.parameters} == {"undecided"}
