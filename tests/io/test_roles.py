"""What a channel is taken for, without a channel table."""

import numpy as np
import pytest

from specan.data.channel import gain_of, si_unit
from specan.errors import RequestError
from specan.io.roles import identify
from specan.io.tdms import full_scale_of


@pytest.mark.parametrize(
    ("name", "properties", "role", "why"),
    [
        ("Mic 1", {}, "microphone", "name"),
        ("MIC24", {}, "microphone", "name"),
        ("micA", {}, "microphone", "name"),
        ("Micrometer", {}, "other", "neither"),
        ("Mikrofon_3", {}, "microphone", "name"),
        ("Vibrometer", {}, "vibrometer", "name"),
        ("Laser", {}, "vibrometer", "name"),
        ("Generator", {}, "generator", "name"),
        ("Generator 2", {}, "generator", "name"),
        ("Acc 1", {}, "accelerometer", "name"),
        ("Accuracy", {}, "other", "neither"),
        ("Tacho sun", {"PulsesPerRevolution": 32}, "tacho", "PulsesPerRevolution"),
        ("Torque carrier", {"QuantityUnit": "Nm"}, "torque", "name"),
        ("Sun-planet 1 force normal", {"QuantityUnit": "N"}, "force", "name"),
        ("Polytec OFV-505", {}, "vibrometer", "name"),
        ("OFV505", {}, "vibrometer", "name"),
        ("Wibrometr", {}, "vibrometer", "name"),
        ("Disp", {"unit_string": "m"}, "vibrometer", "name"),
        ("Displacement 1", {"unit_string": "um"}, "vibrometer", "unit"),
        ("Displacement 1", {"unit_string": "V"}, "other", "neither"),
        ("Wear", {"unit_string": "mm"}, "other", "neither"),
        ("Dispatch", {"unit_string": "m"}, "other", "neither"),
        ("Hammer", {}, "force", "name"),
        ("Impact hammer", {"unit_string": "N"}, "force", "name"),
        ("Force", {}, "force", "name"),
        ("Dev1/ai3", {"unit_string": "kN"}, "force", "unit"),
        ("Reinforced", {}, "other", "neither"),
        ("Source", {}, "generator", "name"),
        ("Source 2", {}, "generator", "name"),
        ("Source mic", {}, "microphone", "name"),
        ("Noise source temperature", {}, "other", "neither"),
        ("Source 1 position", {}, "other", "neither"),
        ("Torque hammer drill", {}, "torque", "name"),
        ("M7", {}, "other", "neither"),
        ("Dev1/ai3", {"Sensor": "Microphone 40AE"}, "microphone", "Sensor"),
        ("Dev1/ai3", {"QuantityUnit": "m/s^2"}, "accelerometer", "QuantityUnit"),
        ("Dev1/ai3", {"unit_string": "Pascals"}, "microphone", "unit Pa"),
        ("Dev1/ai3", {"unit_string": "V"}, "other", "neither"),
    ],
)
def test_roles_and_their_reasons(name, properties, role, why):
    found = identify(name, properties)
    assert found.role == role
    assert why in found.decisions["role"]


def test_the_laboratory_s_own_properties():
    found = identify(
        "Mic 7", {"unit_string": "V", "QuantityUnit": "Pa", "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"}
    )
    assert (found.unit, found.raw_unit, found.gain) == ("Pa", "V", pytest.approx(20.0))
    assert "nominal" in found.decisions["sensitivity"]


def test_a_quantity_that_contradicts_the_sensitivity_is_told():
    properties = {"unit_string": "V", "QuantityUnit": "m/s", "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"}
    assert "'m/s' contradicts" in identify("Mic", properties).decisions["unit"]


def test_samples_whose_quantity_alone_is_named_are_that_quantity():
    """The article: measured data are written as sound pressure."""
    found = identify("Mic", {"QuantityUnit": "kPa"})
    assert (found.unit, found.raw_unit, found.gain) == ("Pa", "Pa", 1000.0)
    assert "QuantityUnit" in found.decisions["unit"]


def test_samples_in_pascals_are_not_divided_by_a_sensitivity_again():
    found = identify("Mic", {"unit_string": "Pa", "Sensitivity": 50.0, "SensitivityUnit": "mV/Pa"})
    assert (found.unit, found.gain) == ("Pa", 1.0)
    assert "already in Pa" in found.decisions["sensitivity"]


def test_a_quantity_without_a_sensitivity_stays_in_volts():
    found = identify("Mic", {"unit_string": "V", "QuantityUnit": "Pa"})
    assert (found.unit, found.gain) == ("V", 1.0)
    assert "needs a sensitivity" in found.decisions["unit"]


@pytest.mark.parametrize(
    ("unit", "derivatives"), [("m", 1), ("m/s", 0), ("m/s^2", -1), ("mm", 1), ("um/s", 0)]
)
def test_a_vibrometer_is_brought_to_velocity(unit, derivatives):
    found = identify("Vibrometer", {"unit_string": unit})
    assert found.derivatives == derivatives
    assert ("derivatives" in found.decisions) == (derivatives != 0)


def test_an_accelerometer_stays_an_acceleration():
    assert identify("Acc 1", {"unit_string": "g"}).derivatives == 0
    assert identify("Acc 1", {"unit_string": "g"}).gain == pytest.approx(9.80665)


def test_a_private_gain_is_a_remark():
    found = identify("Pressure", {"Unit_String": "V", "Gain": 50.0, "Offset": 0.85, "Units": "kPa"})
    assert (found.unit, found.gain) == ("V", 1.0)
    assert "Gain 50, Offset 0.85, Units 'kPa' are not applied" in found.decisions["unit"]


@pytest.mark.parametrize("value", ["n/a", float("nan"), 0.0, ""])
def test_a_sensitivity_that_is_none_is_not_used(value):
    found = identify("Mic", {"unit_string": "V", "Sensitivity": value, "SensitivityUnit": "mV/Pa"})
    assert (found.unit, found.gain) == ("V", 1.0)


@pytest.mark.parametrize(
    ("text", "unit", "scale"),
    [
        ("V", "V", 1.0), ("Volts", "V", 1.0), ("mV", "V", 1e-3), ("MV", "V", 1e6), ("Pascals", "Pa", 1.0),
        ("mPa", "Pa", 1e-3), ("MPa", "Pa", 1e6), ("µm/s", "m/s", 1e-6), ("m/s²", "m/s^2", 1.0), ("g", "m/s^2", 9.80665),
        ("N·m", "Nm", 1.0), ("Nm", "Nm", 1.0), ("nm", "m", 1e-9), ("degC", "degC", 1.0), ("kN", "N", 1e3),
        ("V AC", "V AC", 1.0), ("CAD", "CAD", 1.0),
    ],
)  # fmt: skip
def test_units_as_people_write_them(text, unit, scale):
    assert si_unit(text) == (unit, pytest.approx(scale))


@pytest.mark.parametrize(
    ("value", "unit", "gain", "quantity"),
    [
        (50.0, "mV/Pa", 20.0, "Pa"), (0.05, "V/Pa", 20.0, "Pa"), (100.0, "mV/g", 98.0665, "m/s^2"),
        (10.0, "mV/(m/s^2)", 100.0, "m/s^2"), (10.0, "mV/m/s²", 100.0, "m/s^2"), (0.05, "(m/s)/V", 0.05, "m/s"),
        (50.0, "mm/s/V", 0.05, "m/s"), (20.0, "Nm/V", 20.0, "Nm"), (200.0, "N / V", 200.0, "N"), (1.0, "V/V", 1.0, "V"),
    ],
)  # fmt: skip
def test_sensitivities(value, unit, gain, quantity):
    assert gain_of(value, unit) == (pytest.approx(gain), quantity)
    assert gain_of(value, unit, 1e-3)[0] == pytest.approx(gain / 1000)


@pytest.mark.parametrize(
    ("value", "unit"), [(0.0, "mV/Pa"), (float("nan"), "mV/Pa"), (1.0, "Pa"), (1.0, "pC/N"), (1.0, "")]
)
def test_what_is_no_sensitivity(value, unit):
    with pytest.raises(RequestError, match="sensitivity"):
        gain_of(value, unit)


@pytest.mark.parametrize(
    ("dtype", "line", "properties", "value"),
    [
        ("i2", (10 / 2**15, 0.0), {}, 10 * (1 - 2**-15)),
        ("i2", (10 / 2**15, -1.0), {}, 10 * (1 - 2**-15) - 1),
        ("i4", (10 / 2**23, 0.0), {}, 10 * (1 - 2**-23)),
        ("i4", (42.4 / 2**23, 0.0), {}, 42.4 * (1 - 2**-23)),
        ("i4", (10 / 2**31, 0.0), {}, 10 * (1 - 2**-31)),
        ("i4", (1.2345678e-6, 0.0), {}, None),
        ("i4", (1.2345678e-6, 0.0), {"ADC_Bits": 24}, 1.2345678e-6 * (2**23 - 1)),
        ("i4", (1.0, 0.0), {}, None),
        ("f4", (1.0, 0.0), {}, None),
        ("f4", (1.0, 0.0), {"Range_V": 3.16}, 3.16),
        ("i2", None, {}, None),
    ],
)
def test_full_scale(dtype, line, properties, value):
    found, how = full_scale_of(np.dtype(dtype), line, properties)
    assert found == (None if value is None else pytest.approx(value, rel=1e-9))
    assert (how == "not known") == (value is None)
