"""People together: priors count for nobody, undecided people by their data."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.core.errors import DataError
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.log_posterior import LogPosterior
from jointz.results.value_scale import ValueScale
from jointz.stats.people_likelihoods import PeopleResults
from jointz.stats.people_together import together

POINTS = ("LRE", "MSW")
NAMES = ("stiffness", "damping", "inertia")
TRUE = np.log([100.0, 40.0, 3.0, 1.5, 0.3, 0.25])
PRIOR = np.log([60.0, 60.0, 2.5, 2.5, 0.2, 0.2])
PRIOR_SD = np.array([0.8, 0.8, 0.7, 0.7, 0.5, 0.5])


def posterior(person, rng, *, error_sd=0.15, level_sd=0.2, point_sd=0.1, true=TRUE):
    """Return what a person with a normal prior learns from data of an error."""
    own = true + np.repeat(level_sd * rng.standard_normal(3), 2)
    own = own + point_sd * rng.standard_normal(6)
    error = np.full(6, error_sd)
    data = own + error * rng.standard_normal(6)
    precision = error**-2 + PRIOR_SD**-2
    mean = (data / error**2 + PRIOR / PRIOR_SD**2) / precision
    return LogPosterior(
        person,
        tuple(name for name in NAMES for _ in POINTS),
        POINTS * 3,
        mean,
        np.diag(1.0 / precision),
        PRIOR,
        np.diag(PRIOR_SD**2),
    )


def people(n, *, seed=1, **how):
    rng = np.random.default_rng(seed)
    return [posterior(f"S{k}", rng, **how) for k in range(n)]


def means_of(posteriors, names=NAMES, masses_kg=None):
    found = together([PeopleResults(posteriors, (), masses_kg or {})], names, same_people=True)
    means = {place: found.mean(0, place) for _, place in found.elements} if found else {}
    return {place: mean for place, mean in means.items() if mean}


@pytest.mark.parametrize("studies", [3, pytest.param(16, marks=pytest.mark.slow)])
def test_intervals_hold_the_mean_of_the_population(studies):
    spread = 0.2**2 + 0.1**2
    expected = {
        (point, name): np.exp(TRUE[2 * i + k] + spread / 2)
        for i, name in enumerate(NAMES)
        for k, point in enumerate(POINTS)
    }
    held, given = [], []
    for seed in range(studies):
        found = means_of(people(8, seed=seed), NAMES)
        assert set(found) == set(expected)
        held += [m.ci_low <= expected[key] <= m.ci_high for key, m in found.items() if m.decided]
        given += [m.decided for m in found.values()]
    assert np.mean(held) >= 0.9
    assert np.mean(given) >= 0.9


@pytest.fixture(scope="module")
def sound():
    return people(6)


@pytest.fixture(scope="module")
def sound_means(sound):
    return means_of(sound)


def test_the_prior_of_each_person_is_no_data():
    """With data as weak as the prior, posteriors lie far from the truth; their mean does not."""
    weak = people(40, error_sd=0.7, level_sd=0.05, point_sd=0.05)
    found = means_of(weak, NAMES)["LRE", "stiffness"]
    naive = np.exp(np.mean([p.mean[0] for p in weak]))
    assert naive < 85.0
    assert found.value == pytest.approx(100.0, rel=0.2)


def test_where_a_typical_person_decides_nothing_the_mean_is_not_decided():
    found = means_of(people(20, error_sd=1.5), NAMES)
    assert not any(mean.decided for mean in found.values())
    assert {mean.n_people for mean in found.values()} == {20}


def test_a_person_whom_the_model_does_not_fit_counts_nowhere(sound, sound_means):
    odd = replace(sound[0], participant="S9", mean=sound[0].mean + 2.0, doubted=(True,) * 6)
    assert means_of([*sound, odd], NAMES) == sound_means


def test_sessions_of_one_person_are_one_person(sound, sound_means):
    twice = [replace(p, session=day) for p in sound for day in ("1", "2")]
    assert means_of(twice, NAMES) == sound_means


def test_a_session_that_is_mostly_doubted_does_not_take_the_others_values_away(sound, sound_means):
    doubted = (True,) * 4 + (False,) * 2
    second = [replace(p, session="2", doubted=doubted, mean=p.mean + 0.1) for p in sound]
    assert means_of([*sound, *second], NAMES) == sound_means


def test_people_without_mass_or_known_too_well_are_refused(sound):
    exact = replace(sound[0], covariance=1e-12 * np.eye(6))
    with pytest.raises(DataError, match="S0: expected variances of at least 1e-10, got 1e-12"):
        means_of([exact, *sound[1:]])
    with pytest.raises(DataError, match="expected more than 0 kg; correct S1"):
        means_of(sound, masses_kg={"S0": 70.0, "S1": 0.0})


PER_KG = ("stiffness_per_mass", "damping_per_mass")


def test_values_per_kg_are_means_of_values_per_kg_and_the_device_is_taken_off(sound, sound_means):
    masses = {p.participant: 70.0 for p in sound}
    per_kg = means_of(sound, PER_KG, masses)
    assert per_kg["LRE", "stiffness_per_mass"].value == pytest.approx(
        sound_means["LRE", "stiffness"].value / 70, rel=2e-2
    )
    less = means_of([replace(p, intrinsic=(("inertia", 0.05),)) for p in sound], NAMES)
    with_device = sound_means["LRE", "inertia"]
    assert less["LRE", "inertia"].value == pytest.approx(with_device.value - 0.05)
    assert less["LRE", "inertia"].sd == with_device.sd


def test_the_device_is_taken_off_values_per_kg_by_each_person_s_mass(sound):
    worn = [replace(p, intrinsic=(("stiffness", 10.0),)) for p in sound]
    masses_kg = 50.0 + 10.0 * np.arange(6)
    masses = dict(zip([p.participant for p in sound], masses_kg, strict=True))
    own, less = (means_of(p, PER_KG, masses) for p in (sound, worn))
    own_part = np.mean(10.0 / masses_kg)
    for point in POINTS:
        expected = own[point, "stiffness_per_mass"].value - own_part
        assert less[point, "stiffness_per_mass"].value == pytest.approx(expected)


def test_where_mass_explains_the_people_the_spread_per_kg_is_smaller():
    rng = np.random.default_rng(3)
    masses = {f"S{k}": 50.0 + 6.0 * k for k in range(10)}
    heavy = [
        posterior(p, rng, error_sd=0.05, level_sd=0.02, point_sd=0.02, true=TRUE + np.log(m / 75.0))
        for p, m in masses.items()
    ]
    whole = means_of(heavy, NAMES[:2], masses)["LRE", "stiffness"]
    per_kg = means_of(heavy, PER_KG, masses)["LRE", "stiffness_per_mass"]
    assert whole.sd / whole.value > 0.18
    assert per_kg.sd / per_kg.value < 0.12


SCALE = ValueScale(8.0)


def on_asinh(sound, values):
    """Return the same people with other stiffnesses, N*m/rad, on the scale of asinh."""
    return [
        replace(
            p,
            mean=np.concatenate([SCALE.of(own) * np.ones(2), p.mean[2:]]),
            prior_mean=np.concatenate([SCALE.of(60.0) * np.ones(2), p.prior_mean[2:]]),
            covariance=np.diag([0.02**2] * 2 + np.diag(p.covariance)[2:].tolist()),
            scale_units=(("stiffness", SCALE.unit),),
        )
        for p, own in zip(sound, values, strict=True)
    ]


@pytest.mark.parametrize("per_kg", [0.04, 0.0, 0.8])
def test_a_mean_per_kg_may_be_small_or_zero(per_kg):
    rng = np.random.default_rng(4)
    masses = {f"S{k}": 50.0 + 6.0 * k for k in range(10)}
    kg = np.array(list(masses.values()))
    values = kg * (per_kg + 0.01 * rng.standard_normal(10))
    legs = on_asinh(people(10), values)
    mean = means_of(legs, PER_KG, masses)["LRE", "stiffness_per_mass"]
    whole = means_of(legs, NAMES)["LRE", "stiffness"]
    assert mean.value == pytest.approx(float((values / kg).mean()), abs=0.01 + 0.01 * per_kg)
    assert whole.value == pytest.approx(float(values.mean()), abs=0.7 + 0.02 * values.mean())
    assert 0.0 <= mean.ci_low <= per_kg < mean.ci_high
    assert (mean.decided, mean.n_people) == (per_kg > 0.0, 10)
    assert mean.sd < 0.05 + 0.1 * per_kg


def test_people_on_either_scale_have_one_mean():
    sound = people(10)
    values = 100.0 * np.exp(0.1 * np.random.default_rng(5).standard_normal(10))
    logs = [
        replace(p, mean=np.concatenate([np.log(v) * np.ones(2), p.mean[2:]]),
                prior_mean=np.concatenate([np.log(60.0) * np.ones(2), p.prior_mean[2:]]),
                covariance=other.covariance, scale_units=())
        for p, v, other in zip(sound, values, on_asinh(sound, values), strict=True)
    ]  # fmt: skip
    mixed = [*on_asinh(sound, values)[:5], *logs[5:]]
    alone, both = (means_of(p)["LRE", "stiffness"] for p in (logs, mixed))
    assert both.value == pytest.approx(alone.value, rel=0.02)
    assert both.ci_high - both.ci_low == pytest.approx(alone.ci_high - alone.ci_low, rel=0.2)


def test_a_mean_that_is_the_device_s_own_is_undecided(sound):
    """It is no mean of too few people."""
    worn = [replace(p, intrinsic=(("stiffness", 150.0),)) for p in sound]
    mean = means_of(worn, NAMES)["LRE", "stiffness"]
    assert (mean.decided, mean.n_people) == (False, 6)


def test_what_all_people_share_does_not_average_out():
    shares = {}
    for n in (5, 80):
        mean = means_of(people(n, error_sd=0.05, level_sd=0.02, point_sd=0.01))["LRE", "damping"]
        shares[n] = np.log(mean.ci_high / mean.ci_low) / (2 * 1.96)
    assert shares[80] == pytest.approx(0.5 * 0.05, rel=0.15)


def test_two_people_have_no_mean_and_no_difference():
    pair = PeopleResults(people(2, error_sd=0.01, level_sd=0.01, point_sd=0.01), (), {})
    both = together([pair, pair], NAMES, same_people=True)
    first, second = ((k, ("LRE", "stiffness")) for k in (0, 1))
    assert both.mean(*first) is None
    assert both.difference(first, second, margin_share=10.0) is None


def test_one_person_has_no_mean_over_people_and_missing_points_are_left_out():
    sound = people(3)
    assert means_of(sound[:1], NAMES) == {}
    lre = [0, 2, 4]
    short = LogPosterior(
        "S7", NAMES, ("LRE",) * 3, sound[0].mean[lre], sound[0].covariance[np.ix_(lre, lre)],
        PRIOR[lre], np.diag(PRIOR_SD[lre] ** 2),
    )  # fmt: skip
    counts = {key: mean.n_people for key, mean in means_of([*sound, short], NAMES).items()}
    assert (counts["LRE", "damping"], counts["MSW", "damping"]) == (4, 3)


# --- sessions, differences, other methods ---------------------------------------------------------


def test_sessions_that_differ_widen_the_mean_and_not_the_spread_between_people():
    sound = people(8, error_sd=0.05, level_sd=0.1, point_sd=0.02)
    rng = np.random.default_rng(2)
    days = [
        replace(p, session=day, mean=p.mean + 0.2 * rng.standard_normal(6))
        for p in sound
        for day in ("1", "2")
    ]
    found = together([PeopleResults(days)], NAMES, same_people=True)
    mean, alone = found.mean(0, ("LRE", "stiffness")), means_of(sound)["LRE", "stiffness"]
    assert found.session_sd["stiffness"] == pytest.approx(0.2, rel=0.4)
    assert mean.ci_high - mean.ci_low > alone.ci_high - alone.ci_low
    assert mean.sd < 2.0 * alone.sd


def stiffer(sound, factor, *, rng, own_sd=0.05):
    """Return the same people with a stiffness of a factor; each responds in an own way."""
    change = np.repeat([np.log(factor), 0.0, 0.0], 2)
    return [
        replace(p, mean=p.mean + change + own_sd * rng.standard_normal()) for p in sound
    ]  # fmt: skip


def test_of_the_same_people_their_own_levels_do_not_blur_a_difference():
    rng = np.random.default_rng(5)
    sound = people(10, level_sd=0.3, error_sd=0.08)
    again = stiffer(sound, 1.4, rng=rng)
    results, place = [PeopleResults(again), PeopleResults(sound)], ("LRE", "stiffness")
    paired = together(results, NAMES, same_people=True).difference((0, place), (1, place))
    groups = together(results, NAMES, same_people=False).difference((0, place), (1, place))
    level = means_of(sound)[place].value
    assert paired.decided
    assert paired.ci_low < 0.4 * level < paired.ci_high
    assert paired.p < 0.01 < groups.p
    assert paired.ci_high - paired.ci_low < 0.6 * (groups.ci_high - groups.ci_low)
    assert (paired.n_first, paired.n_second) == (10, 10)
    same = together(results, NAMES, same_people=True).difference(
        (0, ("LRE", "damping")), (1, ("LRE", "damping")), margin_share=0.3
    )
    assert same.p > 0.05
    assert same.p_equivalence < 0.05


def test_a_difference_that_the_data_do_not_decide_is_undecided():
    rng, weak = np.random.default_rng(6), people(6, error_sd=1.2)
    again = stiffer(weak, 1.0, rng=rng, own_sd=0.6)
    found = together([PeopleResults(again), PeopleResults(weak)], NAMES, same_people=True)
    assert not found.difference((0, ("LRE", "damping")), (1, ("LRE", "damping"))).decided


def test_timing_points_of_the_same_people_are_compared():
    found = together([PeopleResults(people(10))], NAMES, same_people=True)
    row = found.difference((0, ("LRE", "stiffness")), (0, ("MSW", "stiffness")))
    assert row.ci_low < 60.0 < row.ci_high
    assert row.p < 1e-3


def test_people_whose_levels_go_together_have_a_correlation():
    rng = np.random.default_rng(7)
    alike = []
    for k in range(30):
        level = 0.3 * rng.standard_normal()
        true = TRUE + np.repeat([level, level, 0.0], 2)
        alike.append(posterior(f"S{k}", rng, error_sd=0.05, level_sd=0.0, point_sd=0.05, true=true))
    found = together([PeopleResults(alike)], NAMES, same_people=True).correlations
    value, low, _ = found["stiffness", "damping"]
    assert low > 0.3
    assert value > 0.6


def cell(person, value, sd, *, status="ok", gain=0.0):
    """Return an estimate of the method rigid with its error budget."""
    given = value if status == "ok" else None
    stiffness = ParameterEstimate("stiffness", given, None, None, status, unbounded=value)
    return CellEstimate(
        person, "LRE", 7.0, (stiffness,), 99.0, 5, 0, "rigid",
        budget={"stiffness": {"noise": 0.6 * sd, "lag": 0.8 * sd, "gain": gain}},
    )  # fmt: skip


def mean_of_cells(cells):
    found = together([PeopleResults((), cells)], NAMES, same_people=True)
    return found.mean(0, ("LRE", "stiffness"))


def test_estimates_with_error_budgets_count_by_their_errors_undecided_ones_included():
    cells = [cell(f"S{k}", v, 2.0) for k, v in enumerate((48.0, 50.0, 52.0, 51.0, 49.0))]
    undecided = cell("S9", 20.0, 60.0, status="undecided")
    alone, both = mean_of_cells(cells), mean_of_cells([*cells, undecided])
    assert alone.value == pytest.approx(50.0, rel=0.01)
    assert (alone.decided, alone.n_people, both.n_people) == (True, 5, 6)
    assert both.value == pytest.approx(50.0, rel=0.03)


def test_an_error_of_the_gain_is_everybody_s():
    values = [50.0 + 0.5 * k for k in range(12)]
    without, shared = (
        mean_of_cells([cell(f"S{k}", v, 2.0, gain=g * v) for k, v in enumerate(values)])
        for g in (0.0, 0.1)
    )
    widths = [(m.ci_high - m.ci_low) / m.value / 2.0 for m in (without, shared)]
    assert np.sqrt(widths[1] ** 2 - widths[0] ** 2) == pytest.approx(0.196, rel=0.05)


def test_without_stated_errors_people_are_not_looked_at_together():
    bare = replace(cell("S1", 50.0, 2.0), budget={})
    assert together([PeopleResults((), [bare])], NAMES, same_people=True) is None
