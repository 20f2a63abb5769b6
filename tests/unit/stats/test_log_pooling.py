"""Means over people from likelihoods: priors count for nobody, undecided people by their data."""

from dataclasses import replace

import numpy as np
import pytest

from jointz.results.log_posterior import LogPosterior
from jointz.stats.log_pooling import log_means

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


def test_intervals_hold_the_mean_of_the_population():
    spread = 0.2**2 + 0.1**2
    expected = {
        (point, name): np.exp(TRUE[2 * i + k] + spread / 2)
        for i, name in enumerate(NAMES)
        for k, point in enumerate(POINTS)
    }
    held, given = [], []
    for seed in range(16):
        found = log_means(people(8, seed=seed), NAMES)
        assert set(found) == set(expected)
        held += [m.ci_low <= expected[key] <= m.ci_high for key, m in found.items() if m.decided]
        given += [m.decided for m in found.values()]
    assert np.mean(held) >= 0.9
    assert np.mean(given) >= 0.9


def test_the_prior_of_each_person_is_no_data():
    """With data as weak as the prior, posteriors lie far from the truth; their mean does not."""
    weak = people(40, error_sd=0.7, level_sd=0.05, point_sd=0.05)
    found = log_means(weak, NAMES)["LRE", "stiffness"]
    naive = np.exp(np.mean([p.mean[0] for p in weak]))
    assert naive < 85.0
    assert found.value == pytest.approx(100.0, rel=0.2)


def test_where_a_typical_person_decides_nothing_the_mean_is_not_decided():
    found = log_means(people(20, error_sd=1.5), NAMES)
    assert not any(mean.decided for mean in found.values())
    assert {mean.n_people for mean in found.values()} == {20}


def test_a_person_whom_the_model_does_not_fit_counts_nowhere():
    sound = people(6)
    odd = replace(sound[0], participant="S9", mean=sound[0].mean + 2.0, doubted=(True,) * 6)
    assert log_means([*sound, odd], NAMES) == log_means(sound, NAMES)


def test_sessions_of_one_person_are_one_person():
    sound = people(6)
    twice = [replace(p, session=day) for p in sound for day in ("1", "2")]
    assert log_means(twice, NAMES) == log_means(sound, NAMES)


def test_a_session_that_is_mostly_doubted_does_not_take_the_others_values_away():
    sound = people(6)
    doubted = (True,) * 4 + (False,) * 2
    second = [replace(p, session="2", doubted=doubted, mean=p.mean + 0.1) for p in sound]
    assert log_means([*sound, *second], NAMES) == log_means(sound, NAMES)


def test_values_per_kg_are_pooled_per_kg_and_the_device_is_taken_off():
    sound = people(6)
    masses = {p.participant: np.log(70.0) for p in sound}
    whole, per_kg = (log_means(sound, NAMES[:2], log_scale=s) for s in (None, masses))
    assert per_kg["LRE", "stiffness"].value == pytest.approx(
        whole["LRE", "stiffness"].value / 70, rel=1e-3
    )
    less = log_means([replace(p, intrinsic=(("inertia", 0.05),)) for p in sound], NAMES)
    with_device = log_means(sound, NAMES)["LRE", "inertia"]
    assert less["LRE", "inertia"].value == pytest.approx(with_device.value - 0.05)
    assert less["LRE", "inertia"].sd == with_device.sd


def test_the_device_is_taken_off_values_per_kg_by_each_person_s_mass():
    sound = people(6)
    worn = [replace(p, intrinsic=(("stiffness", 10.0),)) for p in sound]
    masses_kg = 50.0 + 10.0 * np.arange(6)
    log_masses = dict(zip([p.participant for p in sound], np.log(masses_kg), strict=True))
    own, less = (log_means(p, NAMES[:2], log_scale=log_masses) for p in (sound, worn))
    own_part = np.mean(10.0 / masses_kg)
    for point in POINTS:
        expected = own[point, "stiffness"].value - own_part
        assert less[point, "stiffness"].value == pytest.approx(expected)


def test_a_mean_that_is_the_device_s_own_is_undecided():
    """It is no mean of too few people."""
    worn = [replace(p, intrinsic=(("stiffness", 150.0),)) for p in people(6)]
    mean = log_means(worn, NAMES)["LRE", "stiffness"]
    assert (mean.decided, mean.n_people) == (False, 6)


def test_what_all_people_share_does_not_average_out():
    shares = {}
    for n in (5, 80):
        mean = log_means(people(n, error_sd=0.05, level_sd=0.05, point_sd=0.02), NAMES)[
            "LRE", "damping"
        ]
        shares[n] = np.log(mean.ci_high / mean.ci_low) / (2 * 1.96)
    assert shares[80] == pytest.approx(0.08, rel=0.05)


def test_one_person_has_no_mean_over_people_and_missing_points_are_left_out():
    sound = people(3)
    assert log_means(sound[:1], NAMES) == {}
    lre = [0, 2, 4]
    short = LogPosterior(
        "S7", NAMES, ("LRE",) * 3, sound[0].mean[lre], sound[0].covariance[np.ix_(lre, lre)],
        PRIOR[lre], np.diag(PRIOR_SD[lre] ** 2),
    )  # fmt: skip
    counts = {key: mean.n_people for key, mean in log_means([*sound, short], NAMES).items()}
    assert (counts["LRE", "damping"], counts["MSW", "damping"]) == (4, 3)
