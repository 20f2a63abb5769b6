"""Posterior of a person's impedance at all timing points: arrays, table, JSON, folder."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import jointz
from jointz.analysis.saved_analysis import Analysis
from jointz.results.log_posterior import LOG_POSTERIOR_COLUMNS, LogPosterior
from jointz.results.study_analysis import StudyAnalysis

PARAMETERS = ("stiffness", "damping", "inertia")
POINTS = ("LRE", "MST")


def posterior(participant="S01", *, seed=0, session="", side=""):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((6, 6))
    covariance = 0.01 * root @ root.T + 0.01 * np.eye(6)
    return LogPosterior(
        participant,
        parameters=tuple(name for name in PARAMETERS for _ in POINTS),
        timing_points=POINTS * len(PARAMETERS),
        mean=rng.standard_normal(6),
        covariance=covariance,
        prior_mean=rng.standard_normal(6),
        prior_covariance=covariance + 0.3 * np.eye(6),
        session=session,
        side=side,
    )


def test_every_element_has_a_row():
    one = posterior(session="day 2", side="left")

    table = one.to_frame()

    assert tuple(table.columns) == LOG_POSTERIOR_COLUMNS
    assert table["parameter"].tolist() == list(one.parameters)
    assert table["timing_point"].tolist() == list(POINTS) * 3
    assert table["log_mean"].tolist() == one.mean.tolist()
    np.testing.assert_allclose(table["log_sd"] ** 2, np.diag(one.covariance))
    assert table["prior_log_mean"].tolist() == one.prior_mean.tolist()
    np.testing.assert_allclose(table["prior_log_sd"] ** 2, np.diag(one.prior_covariance))
    assert set(table["session"]) == {"day 2"}
    assert set(table["side"]) == {"left"}
    assert (one.label, posterior().label) == ("S01, day 2, left", "S01")


def test_arrays_of_other_sizes_are_refused():
    one = posterior()

    for change in (
        {"mean": one.mean[:5]},
        {"covariance": one.covariance[:, :5]},
        {"prior_covariance": np.diag(one.prior_covariance)},
        {"timing_points": POINTS},
        {"parameters": (), "timing_points": ()},
    ):
        with pytest.raises(ValueError, match="log posterior: expected"):
            replace(one, **change)


def test_a_study_keeps_the_posteriors_of_its_people(tmp_path):
    posteriors = (posterior("S01"), posterior("S02", seed=1, side="left"))
    analysis = Analysis(cells=(), log_posteriors=posteriors)

    analysis.save(tmp_path / "results", tables=True)

    assert jointz.load(tmp_path / "results") == analysis
    loaded = jointz.load(tmp_path / "results").log_posteriors
    np.testing.assert_array_equal(loaded[1].covariance, posteriors[1].covariance)
    file = tmp_path / "results" / "log_posterior.csv"
    written = pd.read_csv(file, keep_default_na=False, na_values={"scale_unit": [""]})
    table = analysis.log_posterior_frame()
    pd.testing.assert_frame_equal(written, table, rtol=1e-9)
    assert len(table) == 12


def test_a_stiffness_that_may_be_zero_states_its_scale(tmp_path):
    one = posterior()
    near_zero = np.where([p == "stiffness" for p in one.parameters], 0.0, one.mean)
    scaled = replace(one, mean=near_zero, scale_units=(("stiffness", 8.0),))

    Analysis(cells=(), log_posteriors=(scaled,)).save(tmp_path / "results")
    loaded = jointz.load(tmp_path / "results").log_posteriors[0]

    assert loaded == scaled
    assert loaded.scale("stiffness").value(1.0) == pytest.approx(8.0 * np.sinh(1.0))
    assert loaded.scale("damping").value(1.0) == pytest.approx(np.e)
    assert loaded.shares.tolist() == [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
    assert loaded.plot().get_yscale() == "symlog"
    # Files of logarithms stay as they were.
    assert "scale_units" not in one.to_dict()


def test_a_study_without_posteriors_has_no_such_file(tmp_path):
    analysis = Analysis(cells=())
    old = {k: v for k, v in analysis.to_dict().items() if k != "log_posteriors"}

    analysis.save(tmp_path / "results", tables=True)

    assert not (tmp_path / "results" / "log_posterior.csv").exists()
    assert tuple(analysis.log_posterior_frame().columns) == LOG_POSTERIOR_COLUMNS
    assert StudyAnalysis.from_dict(old).log_posteriors == ()
