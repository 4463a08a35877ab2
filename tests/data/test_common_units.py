"""Conversions of frequent units beside the unit library, which is not loaded for them."""

import subprocess
import sys
from itertools import product

import numpy as np
import pint
import pytest

from specan import units
from specan.errors import RequestError
from specan.units import base_unit, convert

LIBRARY = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
BY_BASE: dict[str, list[str]] = {}
for _name, _scale in units._COMMON.items():
    BY_BASE.setdefault(_scale.base, []).append(_name)
PAIRS = [pair for names in BY_BASE.values() for pair in product(names, names)]


@pytest.mark.parametrize(("unit", "target"), PAIRS)
def test_numbers_are_those_of_the_library(unit, target):
    values = [0.0, 1.0, -3.5, *(10 ** np.random.default_rng(5).uniform(-6, 6, 50)).tolist()]
    for value in values:
        assert convert(value, unit, target) == LIBRARY.Quantity(value, unit).to(target).magnitude
    expected = LIBRARY.Quantity(np.array(values), unit).to(target).magnitude
    np.testing.assert_array_equal(convert(np.array(values), unit, target), expected)


@pytest.mark.parametrize("unit", units._COMMON)
def test_base_units_are_those_of_the_library(unit):
    assert base_unit(unit) == str(LIBRARY.Quantity(1.0, unit).to_base_units().units)


def test_the_library_is_not_loaded_for_them():
    code = (
        "import sys; from specan.units import base_unit, convert; "
        "print(convert(20.0, 'degC', 'K'), convert(30.0, 'rpm', 'rad/s'), base_unit('Nm'), 'pint' in sys.modules)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said == "293.15 3.141592653589793 kilogram * meter ** 2 / second ** 2 False\n"


@pytest.mark.parametrize("unit", ["m/s?", "m/s\ufffd", "m/s¿", "V/√Hz", "Pa`"])
def test_a_unit_with_a_character_that_no_unit_has_is_refused(unit):
    """An acceleration whose ² was lost must not become a velocity; pint reads "m/s?" as "m/s"."""
    with pytest.raises(RequestError, match="holds"):
        base_unit(unit)


@pytest.mark.parametrize("unit", ["m/s²", "m·s⁻²", "m/s^2", "m/s2", "m/s**2"])
def test_accelerations_as_people_write_them(unit):
    assert convert(3.0, unit, "m/s^2") == 3.0
