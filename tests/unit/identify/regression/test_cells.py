"""One cell against a slow obvious implementation, its bounds, its calibration, its failures."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.preparation.baselines import Baseline, pre_pulse
from jointz.identify.preparation.cell_data import CellData, FitSettings, Windows
from jointz.identify.regression.cell_regressions import DISSERTATION
from jointz.kernels.resampling import resample_weights

RATE_HZ = 1000.0
N = 100
T = np.arange(N) / RATE_HZ
TRUTH = (50.0, 1.5, 0.05)


def motion() -> np.ndarray:
    """Return angle, velocity and acceleration of one response, (3, N)."""
    total = np.zeros((3, N))
    for centre, width, height in ((0.055, 0.02, 0.05), (0.09, 0.03, -0.03)):
        z = (T - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


def responses(joint=TRUTH, *, n=12, noise=0.0, seed=0) -> np.ndarray:
    """Return (n, 4, N) responses of different sizes, noise on the torque."""
    rng = np.random.default_rng(seed)
    moved = (1 + 0.2 * rng.standard_normal(n))[:, None, None] * motion()
    torque = np.einsum("k,nkt->nt", np.array(joint), moved)
    torque += noise * rng.standard_normal(torque.shape)
    return np.concatenate([moved, torque[:, None]], axis=1)


def no_baseline(n: int) -> Baseline:
    return pre_pulse(np.zeros((n, 4, 50)), n_samples=N)


def fit(windows, *, as_published=True, calibration=None, signs=None, baseline=None, **more):
    n = len(windows)
    signs = np.ones(n) if signs is None else signs
    settings = FitSettings(
        n_resamples=more.pop("n_resamples", 200),
        seed=more.pop("seed", 3),
        rate_hz=RATE_HZ,
        as_published=as_published,
        calibration=calibration or CalibrationSpec(),
        **more,
    )
    return DISSERTATION.fit(CellData(Windows(windows, signs, baseline or no_baseline(n))), settings)


def naive(averages: np.ndarray) -> np.ndarray:
    """Fit every average by scipy, one after the other."""
    found = []
    for average in averages:
        X = average[:3].T
        scale = np.linalg.norm(X, axis=0)
        result = lsq_linear(X / scale, average[3], bounds=(0, np.inf), method="bvls", tol=1e-15)
        found.append(np.where(result.active_mask == 0, result.x, 0.0) / scale)
    return np.array(found)


def test_the_letter_of_4_2_3_is_the_mean_and_the_percentiles_of_scipys_fits():
    windows = responses((0.3, 1.0, 0.05), noise=0.3)
    signs = np.resize([1.0, -1.0], len(windows))
    cell = fit(windows * signs[:, None, None], signs=signs)

    weights = resample_weights(12, 200, np.random.default_rng(3))
    replicates = naive([sum(w * r for w, r in zip(row, windows, strict=True)) for row in weights])
    for i, parameter in enumerate(cell.parameters[:3]):
        mine = replicates[:, i]
        assert parameter.value == pytest.approx(mine.mean(), rel=1e-6, abs=1e-9)
        assert parameter.share_at_bound == pytest.approx((mine == 0).mean())
        if parameter.status == "ok":
            low, high = np.quantile(mine, [0.025, 0.975])
            assert parameter.ci_low == pytest.approx(low, rel=1e-6, abs=1e-9)
            assert parameter.ci_high == pytest.approx(high, rel=1e-6)
    assert 0.1 < cell.parameters[0].share_at_bound < 0.9


def test_otherwise_the_plug_in_is_reported_and_unperturbed_strides_are_drawn_too():
    rng = np.random.default_rng(8)
    n, k = 10, 6
    windows = responses(noise=0.3, n=n)
    strides = 0.05 * rng.standard_normal((k, 4, N)).cumsum(axis=2) * [[1e-3], [1e-2], [1], [1]]
    valid = rng.random((n, k)) > 0.2
    candidates = np.where(valid[:, :, None, None], strides[None], 0.0)
    sources = np.broadcast_to(np.arange(k), (n, k))
    signs = np.resize([1.0, -1.0], n)
    recorded = signs[:, None, None] * windows
    recorded = recorded + np.array([strides[v].mean(axis=0) for v in valid])
    cell = fit(
        recorded,
        as_published=False,
        signs=signs,
        baseline=Baseline(candidates, sources, valid),
        n_resamples=60,
    )

    random = np.random.default_rng(3)
    weights = resample_weights(n, 60, random)
    draws = resample_weights(k, 60, random)
    averages = []
    for row, drawn in zip(weights, draws, strict=True):
        total = np.zeros((4, N))
        for p in range(n):
            share = drawn * valid[p]
            share = share if share.sum() else valid[p].astype(float)
            mean = sum(s * x for s, x in zip(share / share.sum(), strides, strict=True))
            total += row[p] * signs[p] * (recorded[p] - mean)
        averages.append(total)
    replicates = naive(averages)
    plug_in = naive([windows.mean(axis=0)])[0]
    for i, parameter in enumerate(cell.parameters[:3]):
        assert parameter.value == pytest.approx(plug_in[i], rel=1e-6)
        low, high = np.quantile(replicates[:, i], [0.025, 0.975])
        assert parameter.ci_low == pytest.approx(low, rel=1e-5)
        assert parameter.ci_high == pytest.approx(high, rel=1e-5)


def test_vaf_displacement_and_response_are_those_of_the_average():
    windows = responses(noise=0.2)
    cell = fit(windows, as_published=False)

    average = windows.mean(axis=0)
    values = np.array([p.value for p in cell.parameters[:3]])
    error = values @ average[:3] - average[3]
    assert cell.vaf_pct == pytest.approx(100 * (1 - (error**2).sum() / (average[3] ** 2).sum()))
    assert cell.displacement_rad == pytest.approx(np.abs(average[0]).max())
    np.testing.assert_allclose(cell.response.time_s, T)
    np.testing.assert_allclose(cell.response.angle, average[0])
    np.testing.assert_allclose(cell.response.fitted_torque, values @ average[:3])
    X = average[:3].T / np.linalg.norm(average[:3], axis=1)
    assert cell.condition_number == pytest.approx(np.linalg.cond(X), rel=1e-5)


@pytest.mark.parametrize("as_published", [True, False])
@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("K", [0.0, -3.0])
def test_no_or_negative_stiffness_stands_at_the_bound_without_dust(as_published, noise, K):
    stiffness = fit(responses((K, 1.0, 0.05), noise=noise), as_published=as_published).parameters[0]

    assert stiffness.status == "at_bound"
    assert stiffness.ci_low == 0.0
    assert stiffness.value == 0.0 or stiffness.value > 1e-6
    assert stiffness.ci_high >= stiffness.value
    assert stiffness.unbounded == pytest.approx(K, abs=0.3)
    if noise:
        assert stiffness.ci_high > 0.01
    if K < 0:
        assert stiffness.share_at_bound == 1.0


@pytest.mark.parametrize("truth", [(50.0, 0.0, 0.05), (50.0, 1.0, 0.0), (0.0, 0.0, 0.05)])
@pytest.mark.parametrize("as_published", [True, False])
def test_a_value_of_zero_is_always_at_the_bound(truth, as_published):
    for parameter, true in zip(
        fit(responses(truth), as_published=as_published).parameters, truth, strict=False
    ):
        assert (parameter.value == 0.0) == (true == 0.0)
        assert parameter.status == ("at_bound" if true == 0.0 else "ok")


def test_intrinsic_impedance_is_subtracted_with_its_sd():
    known = CalibrationSpec(
        intrinsic_stiffness=Calibrated(value=10.0, sd=2.0),
        intrinsic_damping=Calibrated(value=0.5, sd=0.0),
        intrinsic_inertia=Calibrated(value=0.01, sd=0.001),
    )
    cell = fit(responses(), calibration=known, n_resamples=4000)

    for parameter, truth, sd in zip(
        cell.parameters, (40.0, 1.0, 0.04), (2.0, 0.0, 1e-3), strict=False
    ):
        assert parameter.value == pytest.approx(truth, rel=1e-9)
        width = parameter.ci_high - parameter.ci_low
        # A quantile of 4000 draws is known to 4 %.
        assert width == pytest.approx(2 * 1.96 * sd, rel=0.1, abs=1e-9)


def test_at_the_bound_the_interval_begins_at_minus_the_intrinsic_value():
    known = CalibrationSpec(intrinsic_stiffness=Calibrated(value=10.0, sd=0.1))
    stiffness = fit(responses((-5.0, 1.0, 0.05), noise=0.05), calibration=known).parameters[0]

    assert stiffness.status == "at_bound"
    assert stiffness.value == stiffness.ci_low == -10.0
    assert -10.0 < stiffness.ci_high < -9.0


@pytest.mark.parametrize("name", ["torque_gain", "angle_gain"])
def test_the_sd_of_a_gain_widens_all_intervals_in_proportion(name):
    known = CalibrationSpec(**{name: Calibrated(value=1.05, sd=0.021)})
    for parameter, truth in zip(
        fit(responses(), calibration=known, n_resamples=4000).parameters, TRUTH, strict=False
    ):
        assert parameter.value == pytest.approx(truth, rel=1e-9)
        sd = (parameter.ci_high - parameter.ci_low) / (2 * 1.96)
        assert sd == pytest.approx(0.02 * truth, rel=0.1)


@pytest.mark.parametrize("name", ["angle_lag_s", "torque_lag_s"])
@pytest.mark.parametrize("as_published", [True, False])
def test_the_sd_of_a_lag_widens_damping_by_stiffness_times_it(name, as_published):
    # With little inertia a late torque reads as B - K T and J - B T (SCIENCE trap 2).
    joint = (500.0, 3.0, 0.002)
    known = CalibrationSpec(**{name: Calibrated(value=0.006, sd=1e-4)})
    cell = fit(responses(joint), calibration=known, n_resamples=2000, as_published=as_published)

    _, damping, inertia = cell.parameters[:3]
    assert (damping.ci_high - damping.ci_low) / 3.92 == pytest.approx(500.0 * 1e-4, rel=0.1)
    assert (inertia.ci_high - inertia.ci_low) / 3.92 == pytest.approx(3.0 * 1e-4, rel=0.1)


@pytest.mark.parametrize("as_published", [True, False])
def test_the_sd_of_torque_seen_as_angle_widens_intervals_by_what_it_changes(as_published):
    sd = 2e-5
    known = CalibrationSpec(angle_per_torque=Calibrated(value=0.0, sd=sd))
    windows = responses()
    cell = fit(windows, calibration=known, n_resamples=4000, as_published=as_published)

    # Every parameter of the average, its motion turned by one sd, by scipy; derivatives of the
    # torque are those of the analytic motion.
    average = windows.mean(axis=0)
    rates = np.gradient(average[3], T), np.gradient(np.gradient(average[3], T), T)
    turned = average.copy()
    turned[:3] -= sd * np.stack([average[3], *rates])
    moved = np.abs(naive(turned[None])[0] - TRUTH)
    for parameter, expected in zip(cell.parameters[:3], moved, strict=True):
        half = (parameter.ci_high - parameter.ci_low) / 3.92
        assert half == pytest.approx(expected, rel=0.12)


def test_values_per_kg_are_the_values_over_the_mass():
    cell = fit(responses(noise=0.1), mass_kg=80.0)

    names = [p.name for p in cell.parameters]
    assert names[3:] == ["stiffness_per_mass", "damping_per_mass"]
    for whole, per_kg in zip(cell.parameters, cell.parameters[3:], strict=False):
        for field in ("value", "ci_low", "ci_high", "unbounded"):
            assert getattr(per_kg, field) == pytest.approx(getattr(whole, field) / 80.0)
        assert per_kg.status == whole.status


def test_without_a_mass_only_the_values_per_kg_fail():
    assert [p.status for p in fit(responses()).parameters] == ["ok"] * 3 + [
        "failed:mass_missing"
    ] * 2
    assert len(fit(responses(), wants_per_mass=False).parameters) == 3


@pytest.mark.parametrize(
    ("spoil", "failure"),
    [
        (lambda w: w * [[0], [0], [0], [1]], Failure.CONSTANT_ANGLE),
        (lambda w: w * [[1], [1], [1], [0]], Failure.CONSTANT_TORQUE),
        (lambda w: w[:, [0, 0, 2, 3]], Failure.ILL_CONDITIONED),
        (lambda w: w[:, [0, 1, 0, 3]] * [[1], [1], [-400], [1]], Failure.ILL_CONDITIONED),
    ],
    ids=["no motion", "no torque", "velocity like angle", "a sinusoid"],
)
@pytest.mark.parametrize("as_published", [True, False])
def test_responses_without_an_answer_are_refused_with_a_code(spoil, failure, as_published):
    with pytest.raises(EstimationError) as refused:
        fit(spoil(responses(noise=0.1)), as_published=as_published)
    assert refused.value.code == failure


def test_two_pulses_of_which_resamples_are_singular_are_fitted_by_the_others():
    windows = responses(n=2)
    windows[1, :3] = 0.0  # a resample of this pulse alone has no answer
    cell = fit(windows, as_published=False)

    # The average response has half the motion of the first pulse and the torque of both.
    assert np.isfinite([p.ci_low for p in cell.parameters[:3]]).all()


def test_the_seed_decides_the_intervals_and_nothing_else_does():
    windows = responses(noise=0.2)
    one, same, other = (fit(windows, seed=s, as_published=False) for s in (1, 1, 2))

    assert one.parameters == same.parameters
    for a, b in zip(one.parameters[:3], other.parameters[:3], strict=True):
        assert a.value == b.value
        assert a.ci_low != b.ci_low
