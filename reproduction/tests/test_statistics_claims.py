"""The statistics of 4.3 from the published tables, printed beside ours."""

import re

import numpy as np
import pytest
from reproduction import printed_numbers
from reproduction.chapter4.published_statistics import (
    implied_fwhm,
    published_statistics,
    spm_threshold,
)
from reproduction.reproduction_result import Reproduction
from scipy import stats

from jointz.reference import chapter4

NAMES = {"stiffness": "K", "damping": "B", "inertia": "J"}


@pytest.fixture(scope="module")
def published():
    return published_statistics(4, n_simulations=200)


@pytest.fixture(scope="module")
def chapter(published):
    tables, curves = published
    return Reproduction(4, "statistics", tables, curves)


def claims(chapter, name):
    return {row.claim: row for row in chapter.table(name).rows}


# --- averages ------------------------------------------------------------------------------------


def test_every_printed_average_but_the_lowest_damping_comes_out_to_its_last_digit(chapter):
    apart = []
    for row in chapter.table("averages").rows:
        decimals = {"N*m/rad/kg": 2, "%": 2}.get(row.unit, 3)
        # Half a digit, and the dissertation's own rounding of halves.
        if abs(row.recommended - row.printed) > 0.5001 * 10.0**-decimals:
            apart.append(row.quantity)
    assert apart == ["damping, smallest of the six"]


def test_the_mean_vaf_and_its_sd_over_timing_points_are_as_printed(chapter):
    row = chapter.table("averages").rows[-1]
    assert round(row.recommended, 2) == round(row.dissertation, 2) == row.printed == 90.62
    assert round(row.dissertation_sd, 2) == row.printed_sd == 4.32


def test_intervals_of_averages_are_students_over_ten_people(chapter):
    row = chapter.table("averages").rows[0]
    values = [cell.value for cell in chapter4.STIFFNESS["LRE"].values()]
    low, high = stats.t.interval(0.95, 9, np.mean(values), stats.sem(values))
    assert row.quantity == "stiffness, LRE"
    np.testing.assert_allclose([row.recommended_low, row.recommended_high], [low, high])


# --- factors -------------------------------------------------------------------------------------


def test_f_of_timing_points_is_that_of_one_value_a_person_and_point(chapter):
    rows = claims(chapter, "factors")
    for name, f in {"stiffness": 6.835, "damping": 1.981, "inertia": 1.079}.items():
        assert f"F(5, 45) = {f}, " in rows[f"timing point, {name}"].ours
    stiffness = rows["timing point, stiffness"]
    assert "p = 8.08e-05 (Satterthwaite 8.08e-05)" in stiffness.ours
    assert "epsilon 0.31, p = 0.0122" in stiffness.ours


def test_only_the_timing_point_of_stiffness_is_reproduced_with_people(chapter):
    verdicts = {claim: row.verdict for claim, row in claims(chapter, "factors").items()}
    assert verdicts.pop("timing point, stiffness") == "reproduced"
    assert set(verdicts.values()) == {"only with replicates as people"}
    assert len(verdicts) == 5


def test_subjects_have_an_exact_test_and_both_reference_distributions(chapter):
    rows = claims(chapter, "factors")
    for name, p in {"stiffness": "0.0199", "damping": "0.0129", "inertia": "0.0326"}.items():
        ours = rows[f"subject, {name}"].ours
        assert re.search(rf"exact F\(9, 45\) = 2\.\d+, p = {p}; likelihood ratio", ours)
        mixture, squared = re.search(r"p = ([\d.]+) \(mixture\), ([\d.]+) \(chi", ours).groups()
        assert float(mixture) == pytest.approx(float(squared) / 2, rel=0.01)


# --- pairs ---------------------------------------------------------------------------------------


def test_three_pairs_of_stiffness_differ_and_no_other(chapter):
    found = {
        (NAMES[curve["name"]], *pair["numbers"]): pair["p"]
        for curve in chapter.curves["pairs"].values()
        for pair in curve["pairs"]
        if pair["p"] < 0.05
    }
    assert {key: float(f"{p:.2g}") for key, p in found.items()} == {
        ("K", 1, 2): 0.0025, ("K", 1, 5): 0.00017, ("K", 1, 6): 0.00031,
    }  # fmt: skip


def test_all_pairs_of_the_text_and_only_they_stand_in_the_table(chapter):
    rows = chapter.table("pairs").rows
    assert len(rows) == 29
    assert sum(row.printed == "different" for row in rows) == 20
    assert sum(len(curve["pairs"]) for curve in chapter.curves["pairs"].values()) == 45


# --- gait and quasi-stiffness --------------------------------------------------------------------


def test_the_printed_threshold_is_that_of_a_width_of_12_534_nodes():
    assert round(spm_threshold(12.534), 3) == printed_numbers.SPM_THRESHOLD.value == 4.299
    assert round(implied_fwhm(4.299), 3) == 12.534


def test_a_threshold_that_no_smoothness_gives_is_refused():
    for threshold in (1.0, 9.0):
        with pytest.raises(ValueError, match="no width of 2 to 100 nodes"):
            implied_fwhm(threshold)


def test_the_printed_p_of_quasi_stiffness_is_welchs_over_timing_points(chapter):
    welch = claims(chapter, "quasi_stiffness")["unpaired t-test of Q against K"]
    assert welch.verdict == "reproduced"
    assert welch.ours == "p = 0.3374: t = -1.020, df 8.06, n = 6 and 6"
    k = [np.mean([c.value for c in row.values()]) for row in chapter4.STIFFNESS.values()]
    q = list(chapter4.implied_quasi_stiffness().values())
    assert round(stats.ttest_ind(q, k, equal_var=False).pvalue, 4) == 0.3374


# --- the pilot and the audit ---------------------------------------------------------------------


def test_the_pilots_numbers_are_those_of_s2_and_s3(chapter):
    rows = chapter.table("pilot_people").rows
    assert len(rows) == 2 * len(printed_numbers.PILOT_RANGES) + 3
    digits = {"N*m/rad/kg": 0.01, "N*m*s/rad/kg": 0.01, "kg*m^2": 0.01, "%": 0.1}
    for row in rows:
        assert abs(row.recommended - row.printed) < 0.51 * digits[row.unit]
    both = [row for row in rows if row.note]
    assert [round(row.recommended, 2) for row in both] == [row.printed for row in both]


# --- where not even replicates give what is printed -----------------------------------------------
