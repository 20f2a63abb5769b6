"""The audit of the printed text: every recomputed number once more, another way."""

import itertools

import numpy as np
import pytest
from reproduction import printed_numbers
from reproduction.audit import audit
from reproduction.audit_chapter4 import BONFERRONI_PAIRS, PARTICIPANT_P, POINT_P
from scipy import stats

from jointz.core.gait_phases import TIMING_POINTS
from jointz.reference import chapter4

FINDINGS = {finding.what: finding for finding in audit()}
PARAMETERS = ("stiffness_per_mass", "damping_per_mass", "inertia")


def values(name):
    """Return a printed table as (people, timing points)."""
    return np.array(
        [[cell.value for cell in row.values()] for row in chapter4.TABLES[name].values()]
    ).T


def two_way(y):
    """Return mean squares of people, timing points and the rest: one value a cell."""
    people, points = y.shape
    rest = y - y.mean(1, keepdims=True) - y.mean(0) + y.mean()
    error = (rest**2).sum() / ((people - 1) * (points - 1))
    between_people = points * ((y.mean(1) - y.mean()) ** 2).sum() / (people - 1)
    between_points = people * ((y.mean(0) - y.mean()) ** 2).sum() / (points - 1)
    return between_people, between_points, error


@pytest.mark.parametrize(
    ("what", "recomputed"),
    [
        ("mean stiffness error, k1", "-1.53 %"),
        ("mean stiffness error, k2", "-2.91 %"),
        ("mean inertia error, I1", "-14.8 %"),
        ("mean inertia error, I2", "-13.5 %"),
        ("error of the dynamic stiffness", "5.10 % signed, 5.96 % absolute"),
        ("lowest bandwidth", "17.2 Hz in the results"),
        ("inertia larger with the trajectory", "7 of 20 are 35 %, 8 of 20 are 40 %"),
        ("stiffness below its true value", "at least 45 %: 9 of 10 means are negative"),
        ("duration of the pulse", "300 ms: 75 + 150 + 75"),
        ("inertia of S4 at TST", "mean 0.037 with 0.14, 0.024 with 0.014"),
        ("lowest mean damping", "0.029 N*m*s/rad/kg, at MSW"),
        ("damping in stance", "0.039 0.042 0.053 0.030 at LRE, MST, TST, PSW"),
        ("estimates at the bound", "7 of 60 fits have one, 3 more nearly"),
        ("quasi-stiffness and stiffness", "3, 52, -214, -55, -78, -113 % apart"),
        ("VAFs of S7", "94.38 % at LRE and PSW; 90.76 % at MST and MSW; 99.24 % at TST as S9"),
        ("the two people of the pilot", "S2 and S3 of table 4.4: 97.83, 84.84 %"),
    ],
)
def test_known_inconsistencies_are_found(what, recomputed):
    assert FINDINGS[what].recomputed == recomputed


# --- what stands as a number ---------------------------------------------------------------------


@pytest.mark.parametrize("name", PARAMETERS)
def test_p_values_of_timing_point_and_participant_are_those_of_the_tables(name):
    people, points, error = two_way(values(name))
    assert POINT_P[name] == pytest.approx(stats.f.sf(points / error, 5, 45), rel=1e-5)
    assert PARTICIPANT_P[name] == pytest.approx(stats.f.sf(people / error, 9, 45), rel=1e-5)


@pytest.mark.parametrize("name", PARAMETERS)
def test_bonferroni_pairs_are_those_of_the_tables(name):
    y = values(name)
    error = two_way(y)[2]
    found = {}
    for (i, a), (j, b) in itertools.combinations(enumerate(TIMING_POINTS), 2):
        t = abs(y[:, i].mean() - y[:, j].mean()) / np.sqrt(2 * error / len(y))
        p = min(1.0, 15 * 2 * stats.t.sf(t, 45))
        if p < printed_numbers.SIGNIFICANCE_LEVEL:
            found[a, b] = p
    assert dict(BONFERRONI_PAIRS[name]) == pytest.approx(found, rel=1e-5)
