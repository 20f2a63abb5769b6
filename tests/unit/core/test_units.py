"""Units as people write them, and the ones that must be refused."""

import math
import re
import subprocess
import sys

import pytest

from jointz.core.channels import CHANNEL_UNITS, PARAMETER_UNITS
from jointz.core.errors import UnitError
from jointz.core.units import conversion, si_unit_of

INCH_M, POUND_N = 0.0254, 0.45359237 * 9.80665  # exact by definition


@pytest.mark.parametrize(
    ("unit", "si_unit", "factor"),
    [
        ("turns per second", "rad/s", 2 * math.pi),
        ("rev/s", "rad/s", 2 * math.pi),
        ("rps", "rad/s", 2 * math.pi),
        ("Nm", "N*m", 1.0),
        ("N m", "N*m", 1.0),
        ("N·m", "N*m", 1.0),
        ("mNm", "N*m", 1e-3),
        ("Nmm", "N*m", 1e-3),
        ("lbf*in", "N*m", POUND_N * INCH_M),
        ("Nm/deg", "N*m/rad", 180 / math.pi),
        ("Nms/rad", "N*m*s/rad", 1.0),
        ("Nm/(rad/s)", "N*m*s/rad", 1.0),
        ("deg", "rad", math.pi / 180),
        ("°", "rad", math.pi / 180),
        ("rev", "rad", 2 * math.pi),
        ("rpm", "rad/s", 2 * math.pi / 60),
        ("rad/s2", "rad/s^2", 1.0),
        ("deg s-2", "rad/s^2", math.pi / 180),
        ("deg·s⁻²", "rad/s^2", math.pi / 180),
        ("rad/s**2", "rad/s^2", 1.0),
        ("min", "s", 60.0),
        ("mm", "m", 1e-3),
        ("µV", "V", 1e-6),
        ("%", "1", 0.01),
        ("", "1", 1.0),
        ("1/s", "Hz", 1.0),
    ],
)
def test_units_are_read_as_people_write_them(unit, si_unit, factor):
    found, offset = conversion(unit, si_unit)
    assert found == pytest.approx(factor, rel=1e-15)
    assert offset == 0.0
    assert si_unit_of(unit) == (si_unit, found, 0.0)


@pytest.mark.parametrize(
    "unit", sorted({u for units in CHANNEL_UNITS.values() for u in units} | {"V", "Hz", "J", "W"})
)
def test_an_si_unit_is_its_own(unit):
    assert conversion(unit, unit) == (1.0, 0.0)
    assert si_unit_of(unit) == (unit, 1.0, 0.0)


@pytest.mark.parametrize(
    ("unit", "si_unit", "measured"),
    [
        ("N*m", "rad", "torque"),
        ("", "rad", "pure number"),
        ("N*m/rad", "N*m", "stiffness"),
        ("N*m/kg", "N*m", "torque per body mass"),
        ("Hz", "rad/s", "frequency"),
        ("lb*ft", "N*m", "kg*m"),
        ("J", "N*m", "energy"),
    ],
)
def test_a_unit_of_something_else_is_refused(unit, si_unit, measured):
    with pytest.raises(UnitError, match=f"'{re.escape(unit)}' measures {re.escape(measured)}"):
        conversion(unit, si_unit)


@pytest.mark.parametrize("unit", PARAMETER_UNITS.values())
def test_the_units_of_our_own_results_can_be_read(unit):
    assert conversion(unit, unit) == (1.0, 0.0)


def test_a_quantity_without_a_name_is_written_in_base_units():
    assert si_unit_of("mm^2/ms") == ("m^2/s", pytest.approx(1e-3), 0.0)


def test_a_temperature_has_an_offset():
    assert si_unit_of("°C") == ("K", 1.0, 273.15)


@pytest.mark.parametrize(
    "unit",
    [
        *("nm", "NM", "NMs/rad", "S", "Degrees", "degC/s", "N**/m", "(N", "N)m", ")", "/s", "s/"),
        *("Nm*", "^2", "m^m", "rad^99", "10 mV", "é", "s_", "Ns"),
    ],
)
def test_what_is_no_unit_is_refused(unit):
    for read in (si_unit_of, lambda unit: conversion(unit, "N*m")):
        with pytest.raises(UnitError, match=re.escape(f"'{unit}' is not a unit")):
            read(unit)


def test_importing_the_module_does_not_import_pint():
    code = "import sys, jointz.core.units; raise SystemExit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
