"""The accuracy benchmark judges methods: its bound, bands and histograms are tested here."""

import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from scipy import stats

ROOT = Path(__file__).parents[3]
STEP_S = 0.002
N = 51


def part(name: str) -> ModuleType:
    """A module of the benchmark, which is no part of the package."""
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    return importlib.import_module(f"benchmarks.accuracy.{name}")


bound, joints, noise = part("bound"), part("linear_joint"), part("baseline_noise")
ranks, rows, runs, scores = part("ranks"), part("rows"), part("runs"), part("scores")
summaries, page, main = part("summaries"), part("page"), part("__main__").main

TIME = np.arange(N) * STEP_S
JOINT = joints.Joint(stiffness=30.0, damping=2.0, inertia=0.04, carried=0.01)


def step_response(K: float, B: float, J: float, since: np.ndarray) -> np.ndarray:
    """Closed form: angle of a second-order joint after 1 N*m from time 0 on."""
    root = np.sqrt(complex(B**2 - 4.0 * K * J))
    fast, slow = (-B - root) / (2.0 * J), (-B + root) / (2.0 * J)
    shape = (slow * np.exp(fast * since) - fast * np.exp(slow * since)) / (fast - slow)
    return np.where(since >= 0.0, (1.0 + shape).real / K, 0.0)


def test_a_constant_torque_moves_the_rigid_joint_as_the_closed_form_says() -> None:
    shown = joints.response_matrix(JOINT, N, STEP_S) @ np.ones(N)
    assert np.allclose(shown, step_response(30.0, 2.0, 0.05, TIME), rtol=0, atol=1e-12)


def test_the_sensor_shows_the_response_delayed_filtered_and_scaled() -> None:
    late = replace(JOINT, lag_s=0.005, delay_share=1.0)
    shown = joints.response_matrix(late, N, STEP_S) @ np.ones(N)
    expected = step_response(30.0, 2.0, 0.05, TIME - 0.005)
    # The spline between samples of 2 ms: a ten-thousandth of the largest angle.
    assert np.abs(shown - expected).max() < 1e-4 * expected.max()

    lag_s, fine = 0.006, np.arange(0.0, 0.1 + 1e-9, 1e-5)
    response = step_response(30.0, 2.0, 0.05, fine)
    shown = joints.response_matrix(replace(JOINT, lag_s=lag_s), N, STEP_S) @ np.ones(N)
    weights = np.exp(-(0.1 - fine) / lag_s) / lag_s
    assert shown[-1] == pytest.approx(np.trapezoid(weights * response, fine), rel=1e-5)

    plain = joints.response_matrix(JOINT, N, STEP_S)
    shown = joints.response_matrix(replace(JOINT, angle_gain=1.03, torsion=1e-3), N, STEP_S)
    assert np.allclose(shown, 1.03 * plain + 1e-3 * np.eye(N), rtol=0, atol=1e-15)


def test_a_reflex_acts_only_after_its_latency_and_resists() -> None:
    reflex = replace(JOINT, reflex=0.5, latency_s=0.04)
    plain = joints.response_matrix(JOINT, N, STEP_S) @ np.ones(N)
    shown = joints.response_matrix(reflex, N, STEP_S) @ np.ones(N)
    before = TIME <= 0.04
    assert np.array_equal(shown[before], plain[before])
    assert shown[-1] < plain[-1]


def information(sd: float, names: list[str], *, n_pulses: int) -> object:
    torque = np.full(N, 17.0)
    slopes = bound.sensitivities(JOINT, torque, 0.1 * torque, names, STEP_S)
    return bound.PointInformation(JOINT, slopes, sd**2 * np.eye(N), n_pulses, 1.0)


def closed_form_slopes() -> np.ndarray:
    """Derivatives of the closed form by a step of another size, K, B and J."""
    K, B, J = 30.0, 2.0, 0.05
    h = 1e-5

    def slope(*which: float) -> np.ndarray:
        high = [value * (1.0 + h * here) for value, here in zip((K, B, J), which, strict=True)]
        low = [value * (1.0 - h * here) for value, here in zip((K, B, J), which, strict=True)]
        size = 2.0 * h * float(np.dot((K, B, J), which))
        return 17.0 * (step_response(*high, TIME) - step_response(*low, TIME)) / size

    return np.column_stack([slope(1, 0, 0), slope(0, 1, 0), slope(0, 0, 1)])


def test_in_white_noise_the_bound_is_the_closed_form() -> None:
    point = information(0.01, ["stiffness", "damping", "inertia"], n_pulses=50)
    found = bound.bound_of({"MST": point}, {}, inertia_spread=0.0)
    slopes = closed_form_slopes()
    expected = 0.01 / np.sqrt(50) * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    values = [found["MST"][name] for name in ("stiffness", "damping", "inertia")]
    assert values == pytest.approx(expected, rel=1e-4)
    assert found["all"]["inertia"] == pytest.approx(expected[2], rel=1e-4)


def test_a_torque_gain_error_alone_maps_one_to_one_into_everything() -> None:
    names = ["stiffness", "damping", "inertia", "torque_gain"]
    point = information(1e-7, names, n_pulses=50)
    found = bound.bound_of({"MST": point}, {"torque_gain": 0.02}, inertia_spread=0.0)["MST"]
    assert found["stiffness"] == pytest.approx(0.02 * 30.0, rel=1e-3)
    assert found["damping"] == pytest.approx(0.02 * 2.0, rel=1e-3)
    # What moves with the motor is part of the inertia that the gain scales.
    assert found["inertia"] == pytest.approx(0.02 * 0.05, rel=1e-3)


def test_one_inertia_for_two_points_is_known_better_than_free_ones() -> None:
    point = information(0.01, ["stiffness", "damping", "inertia"], n_pulses=10)
    both = {"LRE": point, "MST": point}
    one, spread, free = (bound.bound_of(both, {}, inertia_spread=s) for s in (0.0, 0.1, 100.0))
    alone = bound.bound_of({"MST": point}, {}, inertia_spread=0.0)["MST"]
    assert one["MST"]["inertia"] == pytest.approx(alone["inertia"] / np.sqrt(2.0), rel=1e-6)
    assert free["MST"]["inertia"] == pytest.approx(alone["inertia"], rel=1e-3)
    assert one["MST"]["inertia"] < spread["MST"]["inertia"] < free["MST"]["inertia"]


def test_prediction_leaves_noise_and_takes_what_the_past_tells() -> None:
    rng = np.random.default_rng(3)
    strikes = np.arange(0.0, 600.0, 1.1)
    time = np.arange(0.0, strikes[-1], STEP_S)
    stride = np.searchsorted(strikes, time, side="right") - 1
    level = rng.normal(scale=0.1, size=strikes.size)[stride]
    angle = level + np.sin(2 * np.pi * time / 1.1) + rng.normal(scale=0.01, size=time.size)
    signals = np.stack([angle, rng.normal(size=time.size), np.zeros(time.size)])
    walked = noise.Walked(signals, STEP_S, strikes, np.array([]))
    found = noise.surprises(walked, walked, strikes[10:20] + 0.55, 40)
    # White noise of 0.01 and what 67 predictors cost in 540 strides, an eighth of its variance.
    assert found.virtual[0].std() == pytest.approx(0.0107, rel=0.05)
    assert np.abs(found.pulses[0]).max() < 0.02


def test_too_few_unperturbed_strides_are_refused() -> None:
    strikes = np.arange(0.0, 60.0, 1.1)
    signals = np.zeros((3, 30_000))
    walked = noise.Walked(signals, STEP_S, strikes, np.array([]))
    with pytest.raises(ValueError, match="expected 200 unperturbed strides"):
        noise.surprises(walked, walked, strikes[10:20] + 0.5, 40)


@pytest.mark.parametrize(
    ("seed", "n", "share", "cells", "met"), [(5, 2000, 0.95, 1, True), (6, 400, 0.9, 6, False)]
)
def test_cells_that_agree_within_a_person_count_as_one_in_a_binomial_band(
    seed: int, n: int, share: float, cells: int, met: bool
) -> None:
    inside = np.random.default_rng(seed).random(n) < share
    found = scores.coverage_of(np.repeat(inside, cells), np.repeat(np.arange(n), cells))
    low, high = stats.binom.interval(0.95, n, 0.95)
    assert found.design_effect == pytest.approx(cells, rel=0.01 if cells > 1 else 1e-3)
    assert (found.low, found.high) == pytest.approx((low / n, high / n), abs=1 / n)
    assert found.met is met


def estimate(point: str, name: str, value: float | None, status: str = "ok") -> dict[str, object]:
    half = None if value is None else 0.1 * value
    low, high = (None, None) if value is None else (value - half, value + half)
    return {"timing_point": point, "parameter": name, "value": value, "low": low, "high": high,
            "status": status}  # fmt: skip


def truth_entry(number: int) -> dict[str, object]:
    points = {p: {"stiffness": k, "damping": 2.0, "inertia": j} for p, k, j in
              (("LRE", 100.0, 0.04), ("MST", 0.0, 0.06))}  # fmt: skip
    least = {p: {"stiffness": 5.0, "damping": 0.1, "inertia": 0.001} for p in points}
    return {"number": number, "truth": points, "bound": {**least, "all": {"inertia": 0.002}}}


def test_errors_are_counted_over_decided_cells_and_zero_truth_only_absolutely() -> None:
    found = [
        estimate("LRE", "stiffness", 110.0),
        estimate("MST", "stiffness", 1.0, "at_bound"),
        estimate("LRE", "damping", None, "undecided"),
    ]
    cells = scores.cells_of([truth_entry(0)], [{"number": 0, "method": "m", "estimates": found}])
    by = {(s.parameter, s.timing_point): s for s in scores.scores_of(cells)}
    overall = by["stiffness", "all"]
    assert overall.rmse_pct == pytest.approx(10.0)
    assert overall.rmse == pytest.approx(np.sqrt((100.0 + 1.0) / 2))
    assert overall.ratio == pytest.approx(2.0)
    assert overall.one_sided_pct == 50.0
    assert by["stiffness", "MST"].rmse_pct is None
    assert by["damping", "all"].undecided_pct == 100.0
    assert by["damping", "all"].coverage.rate is None


def test_one_inertia_is_held_against_the_mean_and_against_each_point() -> None:
    found = [estimate("all", "inertia", 0.06)]
    cells = scores.cells_of([truth_entry(0)], [{"number": 0, "method": "m", "estimates": found}])
    by = {s.timing_point: s for s in scores.scores_of(cells)}
    assert by["all"].n == 1
    assert by["all"].bias_pct == pytest.approx(20.0)
    assert by["LRE"].bias_pct == pytest.approx(50.0)
    assert by["MST"].bias_pct == pytest.approx(0.0)


def test_honest_intervals_have_a_flat_histogram_and_short_ones_have_not() -> None:
    rng = np.random.default_rng(8)
    n = 4000
    table = pd.DataFrame({"method": "m", "number": np.arange(n), "timing_point": "LRE",
                          "parameter": "stiffness", "status": "ok", "shared": False,
                          "truth": 100.0, "value": rng.normal(100.0, 10.0, n)})  # fmt: skip
    for sd, honest in ((10.0, True), (6.0, False)):
        cells = table.assign(low=table["value"] - 1.96 * sd, high=table["value"] + 1.96 * sd)
        (found,) = ranks.ranks_of(cells)
        assert (found.ks < found.ks_limit) is honest
        assert (found.chi2_p > 0.01) is honest
        assert sum(found.counts) == n


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two participants through a row of three pulses, from the command line."""
    folder = tmp_path_factory.mktemp("accuracy")
    code = main(asked(folder))
    assert code == 0
    return folder


def asked(folder: Path) -> list[str]:
    words = "--rows three-pulses --participants 2 --methods least_squares --workers 1 --quiet"
    places = {"cache": "cache", "results": "results", "page": "accuracy.md"}
    paths = [f"--{name}={folder / place}" for name, place in places.items()]
    return [*words.split(), *paths]


def test_two_participants_go_through_a_row(finished: Path) -> None:
    summary = json.loads((finished / "results" / "three-pulses.json").read_text())
    overall = {s["parameter"]: s for s in summary["scores"] if s["timing_point"] == "all"}
    assert overall["stiffness"]["n"] == 12
    assert 0.0 < overall["stiffness"]["bound_pct"] < 100.0
    # Six points of some 55 samples: chi-squared per sample has an sd of 0.08 a participant.
    assert summary["misfit"] == pytest.approx(1.0, abs=0.3)
    assert summary["errors"] == {"least_squares": 0}
    text = (finished / "accuracy.md").read_text()
    assert "`csv <tables/accuracy-three-pulses.csv>`" in text
    table = pd.read_csv(finished / "tables" / "accuracy-three-pulses.csv")
    assert set(table["method"]) == {"least_squares"}
    assert "inertia" in set(table["parameter"])
    unnamed = [
        c for c in table.columns if f"`{c}`" not in text and f"`.{c.split('.')[-1]}`" not in text
    ]
    assert unnamed == []


def test_a_second_run_does_nothing_again(
    finished: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runs, "run_bundle", lambda jobs: pytest.fail(f"ran {jobs} again"))
    before = (finished / "results" / "three-pulses.json").read_text()
    assert main(asked(finished)) == 0
    assert "0 participants" in capsys.readouterr().out
    assert (finished / "results" / "three-pulses.json").read_text() == before


def test_a_line_that_was_cut_off_and_a_changed_row_are_done_again(tmp_path: Path) -> None:
    row, store = rows.all_rows()["one-pulse"], runs.Cache(tmp_path)
    store.add(row, 1, "truth", {"number": 0})
    (path,) = tmp_path.rglob("*.jsonl")
    path.write_text(path.read_text() + '{"number": 1, "tr')
    assert [job.number for job in runs.jobs_of([row], [], 2, 1, store)] == [1]
    assert store.load(replace(row, title="other words", target=None), 1, "truth")
    assert not store.load(replace(row, lag_sd_s=0.001), 1, "truth")
    assert not store.load(row, 2, "truth")
