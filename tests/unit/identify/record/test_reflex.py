"""Intrinsic and reflex paths of a joint whose two paths are known."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter, lsim

from jointz.core.errors import DataError, EstimationError
from jointz.identify.record.joint import identify_joint
from jointz.results.series.reflex_fit import ReflexFit

RATE_HZ = 1000.0
TRUTH = {
    "stiffness": 70.0,
    "damping": 1.0,
    "inertia": 0.015,
    "reflex_gain": 5.0,
    "reflex_delay": 0.045,
}


def simulate(
    seed: int,
    *,
    gain: float = 5.0,
    sign: float = 1.0,
    threshold: float = 0.0,
    seconds: float = 60.0,
    noise: float = 0.3,
    drift: float = 0.0,
) -> dict[str, np.ndarray]:
    """Steps of random size and length; reflex through a twitch of 4 Hz, by lsim in time."""
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE_HZ)
    lengths = rng.integers(150, 350, size=n // 150)
    angle = np.repeat(rng.uniform(-0.03, 0.03, lengths.size), lengths)[:n]
    angle = gaussian_filter1d(angle, 12.0, mode="wrap")
    velocity = np.gradient(angle) * RATE_HZ
    time = np.arange(n) / RATE_HZ
    torque = 70.0 * angle + velocity + 0.015 * np.gradient(velocity) * RATE_HZ
    stretch = sign * np.maximum(sign * velocity - threshold, 0.0)
    late = np.concatenate([np.zeros(45), stretch[:-45]])
    w = 25.0
    torque += gain * lsim(([w**2], [1.0, 2 * 0.9 * w, w**2]), late, time)[1]
    slow = lfilter([1.0], [1.0, -np.exp(-1.0 / (RATE_HZ * 0.15))], rng.standard_normal(n))
    torque += noise * slow / slow.std() + 0.1 * noise * rng.standard_normal(n)
    return {"time": time, "angle": angle, "torque": torque + drift * np.cos(0.1 * time)}


def fit(record: dict[str, np.ndarray], **settings: object) -> ReflexFit:
    found = identify_joint(record, model="reflex", input="angle", **settings)
    assert isinstance(found, ReflexFit)
    return found


def covers(found: ReflexFit) -> dict[str, bool]:
    return {
        name: found.parameter(name).ci_low <= value <= found.parameter(name).ci_high
        for name, value in TRUTH.items()
    }


@pytest.fixture(scope="module")
def nearly_clean() -> ReflexFit:
    return fit(simulate(3, noise=0.003))


def test_a_record_with_little_noise_gives_back_both_paths(nearly_clean: ReflexFit) -> None:
    found = {name: nearly_clean.parameter(name).value for name in TRUTH}
    # np.gradient differentiates 20 Hz 0.3 % too small; the delay is known to a millisecond.
    assert found["reflex_delay"] == pytest.approx(0.045, abs=1e-3)
    for name in ("stiffness", "damping", "inertia", "reflex_gain"):
        assert found[name] == pytest.approx(TRUTH[name], rel=0.02)
    assert nearly_clean.status == "ok"
    path = nearly_clean.path
    assert path.stretch == "positive"
    assert path.threshold_rad_s == pytest.approx(0.0, abs=0.03)
    assert path.frequency_hz == pytest.approx(25.0 / (2 * np.pi), rel=0.05)
    assert path.damping_ratio == pytest.approx(0.9, rel=0.05)


@pytest.mark.parametrize("seed", [0, 1])
def test_with_noise_the_intervals_hold_the_truth(seed: int) -> None:
    found = fit(simulate(seed))
    assert found.status == "ok"
    assert sum(covers(found).values()) >= 4
    assert found.vaf_pct > found.linear_vaf_pct + 3.0


def test_stretch_to_the_other_side_is_found_by_the_fit() -> None:
    found = fit(simulate(4, sign=-1.0, threshold=0.2))
    assert found.path.stretch == "negative"
    assert found.path.threshold_rad_s == pytest.approx(0.2, abs=0.15)
    assert all(covers(found).values())


def test_turning_angle_and_torque_turns_only_the_direction() -> None:
    record = simulate(5)
    turned = fit(record | {"angle": -record["angle"], "torque": -record["torque"]})
    straight = fit(record)
    assert (straight.path.stretch, turned.path.stretch) == ("positive", "negative")
    for name in TRUTH:
        assert turned.parameter(name).value == pytest.approx(
            straight.parameter(name).value, rel=1e-3
        )


def test_without_a_reflex_gain_and_delay_are_undecided_and_the_rest_stands() -> None:
    found = fit(simulate(2, gain=0.0))
    assert [found.parameter(n).status for n in ("reflex_gain", "reflex_delay")] == ["undecided"] * 2
    assert found.parameter("reflex_gain").value is None
    for name in ("stiffness", "damping", "inertia"):
        estimate = found.parameter(name)
        assert estimate.ci_low < TRUTH[name] < estimate.ci_high
    assert found.vaf_pct == found.linear_vaf_pct
    assert found.status == "undecided"


def test_torque_that_drifts_over_a_minute_changes_little() -> None:
    still, drifting = fit(simulate(7)), fit(simulate(7, drift=1.0))
    for name in TRUTH:
        sd = (still.parameter(name).ci_high - still.parameter(name).ci_low) / 4.0
        assert abs(drifting.parameter(name).value - still.parameter(name).value) < 0.5 * sd


@pytest.mark.parametrize("cutoff_hz", [0.1, 600.0, float("nan")])
def test_a_cutoff_that_shows_no_delay_or_is_above_half_the_rate_is_refused(
    cutoff_hz: float,
) -> None:
    with pytest.raises(DataError, match="cutoff_hz"):
        fit(simulate(1, seconds=30.0), cutoff_hz=cutoff_hz)


@pytest.mark.parametrize("name", ["angle", "torque"])
def test_a_signal_that_stops_in_the_first_second_has_its_code(name: str) -> None:
    record = simulate(1, seconds=30.0)
    stopped = np.where(record["time"] < 0.5, record[name], record[name][500])
    with pytest.raises(EstimationError) as caught:
        fit(record | {name: stopped})
    assert caught.value.code == f"constant_{name}"


def test_one_sine_is_ill_conditioned() -> None:
    time = np.arange(30_000) / RATE_HZ
    angle = 0.02 * np.sin(2 * np.pi * 2.0 * time)
    with pytest.raises(EstimationError) as caught:
        fit({"time": time, "angle": angle, "torque": 50.0 * angle})
    assert caught.value.code == "ill_conditioned"


def test_the_command_writes_a_figure_and_the_values_of_both_paths(jointz, tmp_path: Path) -> None:
    file, figure = tmp_path / "ankle.csv", tmp_path / "reflex.png"
    pd.DataFrame(simulate(0, seconds=30.0)).to_csv(file, index=False)
    columns = ("--angle", "angle", "--torque", "torque", "--time", "time", "--input", "angle")

    outcome = jointz(
        "identify", "joint", file, *columns, "--model", "reflex", "--figure", figure, "--json"
    )

    assert outcome.code == 0
    found = outcome.json
    assert found["model"] == "reflex"
    assert list(found["parameters"]) == list(TRUTH)
    assert found["parameters"]["reflex_gain"]["unit"] == "N*m*s/rad"
    assert found["parameters"]["reflex_delay"]["value"] == pytest.approx(0.045, abs=0.01)
    assert {"vaf_pct", "intrinsic_vaf_pct", "reflex_vaf_pct", "linear_vaf_pct"} <= set(found)
    assert "series" not in found
    assert figure.stat().st_size > 10_000


# --- calibration ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "threshold"), [(1.0, 0.0), (-1.0, 0.2)])
def test_intervals_hold_the_truth_as_often_as_they_say(sign: float, threshold: float) -> None:
    held = [covers(fit(simulate(100 + i, sign=sign, threshold=threshold))) for i in range(40)]
    for name in TRUTH:
        # 34 of 40: the lower end of the binomial 99 % band around 0.95.
        assert sum(h[name] for h in held) >= 34, name


@pytest.mark.slow
def test_a_reflex_that_is_not_there_is_found_at_most_at_the_nominal_rate() -> None:
    fits = [fit(simulate(1000 + i, gain=0.0)) for i in range(80)]
    # Binomial 99 % band around 0.05 of 80.
    assert sum(f.path.p_value < 0.05 for f in fits) <= 10
    assert sum(f.parameter("reflex_gain").status == "ok" for f in fits) <= 10
