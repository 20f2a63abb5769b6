"""Curves over the cycle from posteriors whose prior and truth are known."""

from dataclasses import replace

import numpy as np
import pytest

from jointz import phase_curve
from jointz.core.errors import DataError, EstimationError
from jointz.identify.over_cycle.phase_curve import timing_points_of_phases
from jointz.identify.walking.leg_model import LENGTH_CYCLES
from jointz.results.estimates import REACH_95, CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.series.cycle_curve import MEAN
from jointz.results.study_analysis import StudyAnalysis

#: Centres of the windows, % of the cycle, on the grid of the curves; window of 9 %.
CENTRES = {"LRE": 12.0, "MST": 26.0, "TST": 47.0, "PSW": 62.0, "ISW": 74.0, "TSW": 90.0}
HALF_PCT = 4.5
LEVEL, SPREAD, SHARE = 0.3**2, 0.6**2, 0.9
NOISE_SD = 0.05
MASS_KG = 70.0
FAR = np.array([2.0, 36.0, 37.0, 99.0])  # % of the cycle: windows there overlap with no other
PHASES = np.array(list(CENTRES.values())) / 100.0


def prior_covariance(a, b, *, share=SHARE, level=LEVEL):
    apart = np.abs(a[:, None] - b)
    curve = np.exp(-2.0 * np.sin(np.pi * apart) ** 2 / (2.0 * np.pi * LENGTH_CYCLES) ** 2)
    return level + SPREAD * (share * curve + (1.0 - share) * (apart < 1e-9))


def posterior(person="S1", *, log_values=None, noise_sd=NOISE_SD, parameters=("stiffness",), **how):
    """Return the posterior of measured logarithms, 4 by the prior."""
    n, m = len(CENTRES), len(parameters)
    prior = prior_covariance(PHASES, PHASES, **how)
    gain = prior @ np.linalg.inv(prior + noise_sd**2 * np.eye(n))
    off = np.zeros(n) if log_values is None else log_values - 4.0
    return LogPosterior(
        person,
        parameters=tuple(p for p in parameters for _ in CENTRES),
        timing_points=tuple(CENTRES) * m,
        mean=np.tile(4.0 + gain @ off, m),
        covariance=np.kron(np.eye(m), prior - gain @ prior),
        prior_mean=np.full(n * m, 4.0),
        prior_covariance=np.kron(np.eye(m), prior),
    )


def cells_of(one, *, method="bayesian"):
    """Return the cells beside a posterior, decided, with values per kg."""
    cells = []
    for point, centre in CENTRES.items():
        estimates = []
        for name in dict.fromkeys(one.parameters):
            k = list(zip(one.parameters, one.timing_points, strict=True)).index((name, point))
            value = float(np.exp(one.mean[k]))
            for label, per in ((name, 1.0), (f"{name}_per_mass", MASS_KG)):
                estimates.append(
                    ParameterEstimate(label, value / per, None, None, "ok", unbounded=value / per)
                )
        cells.append(
            CellEstimate(
                one.participant, point, (centre - HALF_PCT) % 100.0, tuple(estimates), 99.0, 9, 0,
                method, centre_gait_pct=centre, session=one.session, side=one.side,
            )
        )  # fmt: skip
    return cells


def analysis_of(*posteriors, coupling="rigid"):
    cells = tuple(cell for one in posteriors for cell in cells_of(one))
    return StudyAnalysis(cells, log_posteriors=posteriors, settings={"coupling": coupling})


def band_of(one, name="stiffness", **how):
    return phase_curve(analysis_of(one, **how), parameters=[name]).band(name, one.label)


def logs(band, at_pct):
    """Return median and sd of the logarithm at phases of the grid."""
    places = np.asarray(at_pct, dtype=int)
    low, high = np.log(np.array(band.ci_low)[places]), np.log(np.array(band.ci_high)[places])
    return np.log(np.array(band.value)[places]), (high - low) / (2.0 * REACH_95)


def drawn(rng, at_pct):
    """Return true logarithms at the timing points and at other phases, and measured ones."""
    phases = np.concatenate([PHASES, np.asarray(at_pct) / 100.0])
    true = 4.0 + np.linalg.cholesky(prior_covariance(phases, phases)) @ rng.standard_normal(
        phases.size
    )
    measured = true[: len(CENTRES)] + NOISE_SD * rng.standard_normal(len(CENTRES))
    return true[len(CENTRES) :], measured


@pytest.mark.parametrize("share", [0.9, 0.3, 0.0])
def test_at_a_timing_point_the_curve_is_the_estimate(share):
    one = posterior(log_values=np.linspace(3.5, 4.5, 6), share=share)
    band = band_of(one)
    mean, sd = logs(band, list(CENTRES.values()))
    np.testing.assert_allclose(mean, one.mean)
    np.testing.assert_allclose(sd, one.sd)
    assert band.cycle_share == pytest.approx(share, abs=1e-6)
    np.testing.assert_allclose([np.log(p.value) for p in band.points], one.mean)
    np.testing.assert_allclose([np.log(p.ci_high) for p in band.points], mean + REACH_95 * sd)


def test_between_timing_points_it_is_the_prior_given_the_measurements():
    """All phases and measurements as one normal vector."""
    _, measured = drawn(np.random.default_rng(1), FAR)
    phases = np.concatenate([PHASES, FAR / 100.0])
    joint = prior_covariance(phases, phases)
    seen = joint[:6, :6] + NOISE_SD**2 * np.eye(6)
    expected = 4.0 + joint[6:, :6] @ np.linalg.solve(seen, measured - 4.0)
    covariance = joint[6:, 6:] - joint[6:, :6] @ np.linalg.solve(seen, joint[:6, 6:])

    mean, sd = logs(band_of(posterior(log_values=measured)), FAR)

    np.testing.assert_allclose(mean, expected)
    np.testing.assert_allclose(sd, np.sqrt(np.diag(covariance)))


def test_where_nothing_follows_the_cycle_the_band_between_is_that_of_the_prior():
    one = posterior(log_values=np.linspace(3.5, 4.5, 6), share=0.0, level=0.0)
    mean, sd = logs(band_of(one), FAR)
    np.testing.assert_allclose(mean, 4.0)
    np.testing.assert_allclose(sd, np.sqrt(SPREAD))
    # The own part of a timing point fades with the overlap of the windows.
    _, inside = logs(band_of(one), [12, 15, 19])
    assert NOISE_SD > inside[0] < inside[1] < inside[2] < np.sqrt(SPREAD)


def test_the_band_holds_curves_of_the_prior():
    rng, at, held = np.random.default_rng(3), np.append(FAR, [16.0, 54.0]), []
    for _ in range(100):
        true, measured = drawn(rng, at)
        mean, sd = logs(band_of(posterior(log_values=measured)), at)
        held.append(np.mean(np.abs(true - mean) < REACH_95 * sd))
    # People, not phases, are independent: standard error of their mean coverage.
    assert abs(np.mean(held) - 0.95) < 2.6 * np.std(held) / np.sqrt(100)


def test_timing_points_whose_windows_overlap_keep_their_estimates(monkeypatch):
    monkeypatch.setitem(CENTRES, "MST", 14.0)
    monkeypatch.setattr(f"{__name__}.PHASES", np.array(list(CENTRES.values())) / 100.0)
    one = posterior(log_values=np.linspace(3.5, 4.5, 6), share=0.3)
    mean, sd = logs(band_of(one), list(CENTRES.values()))
    np.testing.assert_allclose(mean, one.mean)
    np.testing.assert_allclose(sd, one.sd)


def test_errors_of_gains_and_model_are_added_in_full_and_the_device_is_subtracted():
    one = posterior(parameters=("damping",))
    plain, strap = band_of(one, "damping"), band_of(one, "damping", coupling="strap")
    whole = replace(one, gain_sd=0.2, intrinsic=(("damping", 10.0),))
    other = band_of(whole, "damping")
    _, sd = logs(plain, FAR)
    np.testing.assert_allclose(logs(strap, FAR)[1], np.hypot(sd, 0.08))
    np.testing.assert_allclose(np.array(other.value) + 10.0, plain.value)
    ends = np.array([other.ci_low, other.ci_high])[:, FAR.astype(int)] + 10.0
    np.testing.assert_allclose(
        np.diff(np.log(ends), axis=0)[0] / (2.0 * REACH_95), np.hypot(sd, 0.2)
    )


def test_a_stiffness_that_may_be_zero_has_a_curve_and_values_per_kg_are_its_share():
    one = replace(posterior(), scale_units=(("stiffness", 8.0),))
    analysis = replace(analysis_of(one), cells=tuple(cells_of(posterior())))
    curve = phase_curve(analysis, parameters=["stiffness", "stiffness_per_mass"])
    whole, per_mass = curve.band("stiffness", "S1"), curve.band("stiffness_per_mass", "S1")
    assert whole.scale == "asinh"
    assert whole.value[12] == pytest.approx(8.0 * np.sinh(one.mean[0]))
    np.testing.assert_allclose(np.array(per_mass.ci_high) * MASS_KG, whole.ci_high)


def test_people_have_a_mean_with_the_spread_between_them():
    posteriors = [posterior(f"S{k}", log_values=np.full(6, 3.8 + 0.1 * k)) for k in range(5)]
    curve = phase_curve(analysis_of(*posteriors), parameters=["stiffness"])
    mean, bands = curve.band("stiffness"), [b for b in curve.bands if b.participant != MEAN]
    values = np.array([band.value for band in bands])
    np.testing.assert_allclose(mean.value, values.mean(axis=0))
    half = (np.array(mean.ci_high) - np.array(mean.ci_low)) / 2.0
    spread = 2.776 * values.std(axis=0, ddof=1) / np.sqrt(5)
    assert (half > spread).all()
    assert half[12] == pytest.approx(spread[12], rel=0.1)  # widened by the errors of the curves
    assert half[36] > 1.5 * spread[36]
    two = phase_curve(analysis_of(*posteriors[:2]), parameters=["stiffness"])
    assert [band.participant for band in two.bands] == ["S0", "S1"]


def test_sides_of_a_person_are_one_of_the_mean():
    sides = [replace(posterior("S1"), side=side) for side in ("left", "right")]
    curve = phase_curve(analysis_of(*sides, posterior("S2")), parameters=["stiffness"])
    assert [band.participant for band in curve.bands] == ["S1, left", "S1, right", "S2"]


def test_one_participant_can_be_asked_for():
    analysis = analysis_of(*(posterior(f"S{k}") for k in range(3)))
    curve = phase_curve(analysis, "S1")
    assert {band.participant for band in curve.bands} == {"S1"}
    one_side = analysis_of(replace(posterior(), side="left"))
    assert phase_curve(one_side, "S1").bands[0].participant == "S1, left"
    with pytest.raises(DataError, match="S0; S1; S2"):
        phase_curve(analysis, "S7")
    with pytest.raises(DataError, match="parameters"):
        phase_curve(analysis, parameters=["torque"])


def test_timing_points_with_doubts_are_left_out_with_a_warning():
    doubts = {"doubts": ("responses_misfit",)}
    some = replace(posterior("S1"), doubted=(False, True, *[False] * 4), **doubts)
    all_points = replace(posterior("S2"), doubted=(True,) * 6, **doubts)
    curve = phase_curve(analysis_of(some, all_points), parameters=["stiffness"])
    (band,) = curve.bands
    assert [p.timing_point for p in band.points] == [p for p in CENTRES if p != "MST"]
    assert logs(band, [26])[1][0] > 3.0 * NOISE_SD
    first, second = curve.warnings
    assert "S1: doubts at MST: responses_misfit" in first
    assert "no curve of stiffness of S2: 0 timing points" in second
    with pytest.raises(EstimationError, match="expected 4 or more"):
        phase_curve(analysis_of(all_points))


def test_people_without_posterior_or_phases_have_no_curve_but_a_warning():
    one, lone = analysis_of(posterior("S1")), cells_of(posterior("S3"))
    unplaced = posterior("S2")
    cells = [replace(c, centre_gait_pct=None) for c in cells_of(unplaced)]
    analysis = replace(
        one, cells=(*one.cells, *cells, *lone), log_posteriors=(*one.log_posteriors, unplaced)
    )
    curve = phase_curve(analysis, parameters=["stiffness"])
    assert [band.participant for band in curve.bands] == ["S1"]
    assert [w.split(":")[0] for w in curve.warnings] == [
        "no curve of S3", "no curve of stiffness of S2"
    ]  # fmt: skip


def test_results_of_earlier_versions_are_used_if_they_hold_posteriors():
    one = posterior(parameters=("damping",))
    strapped = StudyAnalysis(tuple(cells_of(one, method="strapped")), log_posteriors=(one,))
    band = phase_curve(strapped, parameters=["damping"]).band("damping", "S1")
    assert band == band_of(one, "damping", coupling="strap")
    rigid = StudyAnalysis(tuple(cells_of(one, method="rigid")))
    with pytest.raises(DataError, match=r"method rigid.*Analyse the study again"):
        phase_curve(rigid)


def test_timing_points_are_made_of_measured_phases():
    rng = np.random.default_rng(0)
    phases = rng.uniform(0.0, 100.0, 300)
    points = timing_points_of_phases(np.append(phases, np.nan))
    assert len(points) == 20
    assert all(0.0 < at - 5.0 * k < 5.0 for k, at in enumerate(points.values()))
    # Two dense places and stray pulses: these go to the nearest.
    few = timing_points_of_phases(np.array([1.0] * 6 + [93.4, 93.6] * 4 + [50.0]))
    assert few == pytest.approx({"0-5 %": 1.0, "90-95 %": 93.5})


@pytest.mark.parametrize(
    ("phases", "options", "message"),
    [
        (np.array([1.0, 40.0]), {}, "5 pulses"),
        (np.arange(10.0), {"width_pct": 0.0}, "width_pct"),
    ],
)
def test_phases_without_groups_are_refused(phases, options, message):
    with pytest.raises(DataError, match=message):
        timing_points_of_phases(phases, **options)
