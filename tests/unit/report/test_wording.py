import pytest

from jointz.core.channels import pretty_unit
from jointz.core.codes import Exclusion, Failure
from jointz.report.wording import (
    exclusion_meaning,
    format_estimate,
    format_integer,
    format_interval,
    format_number,
    format_signed,
    format_spread,
    status_meaning,
)
from jointz.results.estimates import ParameterEstimate


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2e-14, "0"), (-3e-12, "0"), (0.0, "0"), (182.349, "182"), (3.0, "3.00"),
        (0.05321, "0.0532"), (0.00012345, "0.000123"), (-1.5, "\N{MINUS SIGN}1.50"),
        (None, "\N{EN DASH}"), (float("nan"), "\N{EN DASH}"), (float("inf"), "\N{EN DASH}"),
        (12345.0, "12\N{NARROW NO-BREAK SPACE}345"),
        (2.5e-6, "2.50 \N{MULTIPLICATION SIGN} 10⁻⁶"),
    ],
)  # fmt: skip
def test_a_number_has_three_digits_and_no_exponent(value, text):
    assert format_number(value) == text


def test_a_value_and_its_interval_share_their_decimals():
    assert format_interval(3.02, 2.8, 3.244) == "3.02 [2.80, 3.24]"
    assert format_interval(9.99, 1.0, 123.0) == "10 [1, 123]"


def test_no_end_but_zero_is_shown_as_zero():
    assert format_interval(0.05121, 0.001102, 2.343) == "0.051 [0.001, 2.343]"
    assert format_interval(0.8, 0.0, 2.343) == "0.80 [0.00, 2.34]"
    assert format_spread(0.0301, 0.05121, 0.001102, 2.343) == "0.030"
    assert format_spread(0.62, 34.2, None, None) == "0.6"


def test_negative_zero_is_zero():
    assert format_number(-0.001, like=100.0) == "0"


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (ParameterEstimate("damping", 2e-14, 0.0, 0.31, "at_bound"), "0 (at most 0.310)"),
        (ParameterEstimate("damping", 2e-14, None, None, "at_bound"), "0"),
        (ParameterEstimate("damping", 0.5, 0.4, 0.6, "undecided"), "\N{EN DASH}"),
        (ParameterEstimate("damping", 0.5, 0.4, 0.6, "ok"), "0.500 [0.400, 0.600]"),
    ],
)
def test_an_estimate_reads_as_its_status_allows(estimate, text):
    assert format_estimate(estimate) == text


def test_every_code_has_its_meaning():
    assert all(status_meaning(f.status) == f.meaning for f in Failure)
    assert all(exclusion_meaning(e.value) == e.meaning for e in Exclusion)
    assert exclusion_meaning("of_tomorrow") == "of tomorrow"


def test_units_and_counts_are_typeset():
    assert pretty_unit("N*m*s/rad/kg") == "N·m·s/rad/kg"
    assert format_integer(1234567) == "1\N{NARROW NO-BREAK SPACE}234\N{NARROW NO-BREAK SPACE}567"
    assert format_signed(-0.25, decimals=1) == "\N{MINUS SIGN}0.2"
