"""Power of t tests against the R package pwr; ``make_power_reference.R`` made the reference."""

import json
from pathlib import Path

import numpy as np
import pytest

from jointz.kernels.statistics.power import smallest_effect, t_power

REFERENCE = json.loads((Path(__file__).parent / "power_reference.json").read_text())
DESIGNS = ("paired", "groups")


def rows(table, design):
    found = [row for row in REFERENCE[table] if row["design"] == design]
    assert len(found) > 10
    return found


@pytest.mark.parametrize("design", DESIGNS)
def test_power_is_that_of_pwr(design):
    for row in rows("power", design):
        power = t_power(row["effect"], row["n"], design=design, alpha=row["alpha"])
        assert power == pytest.approx(row["power"], abs=1e-6), row


@pytest.mark.parametrize("design", DESIGNS)
def test_the_smallest_effect_is_that_of_pwr(design):
    for row in rows("smallest", design):
        effect = smallest_effect(row["n"], row["power"], design=design)
        assert effect == pytest.approx(row["effect"], rel=1e-3), row


@pytest.mark.parametrize("design", DESIGNS)
def test_no_effect_is_found_as_often_as_alpha(design):
    assert t_power(0.0, 7, design=design, alpha=0.03) == pytest.approx(0.03, abs=1e-12)


@pytest.mark.parametrize("design", DESIGNS)
def test_the_sign_of_an_effect_is_of_no_matter(design):
    assert t_power(-0.7, 9, design=design) == t_power(0.7, 9, design=design)


@pytest.mark.parametrize("design", DESIGNS)
def test_power_grows_with_the_effect_up_to_one(design):
    powers = [t_power(d, 6, design=design) for d in np.geomspace(0.01, 1e4, 60)]

    assert np.isfinite(powers).all()
    assert (np.diff(powers) >= -1e-9).all()
    assert powers[-1] == pytest.approx(1.0, abs=1e-9)


def test_one_person_finds_nothing():
    assert t_power(5.0, 1) == 0.0
    assert smallest_effect(1, 0.8) == np.inf


@pytest.mark.parametrize("design", DESIGNS)
def test_the_smallest_effect_has_the_power(design):
    for n in (2, 4, 12, 40):
        effect = smallest_effect(n, 0.8, design=design)
        assert t_power(effect, n, design=design) == pytest.approx(0.8, abs=1e-9)
