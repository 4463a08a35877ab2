"""The air: dispersion belongs to attenuation."""

import subprocess
import sys

import numpy as np
import pytest

from specan.errors import RequestError
from specan.room.model import air


@pytest.mark.parametrize("humidity", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("hertz", [150.0, 600.0, 1500.0])
def test_dispersion_follows_from_attenuation(humidity, hertz):
    """Kramers and Kronig: what is causal and lossy disperses.

    For the slowness s = k / w and attenuation a, ``Re s(w) - Re s(0) = (2 w^2 / pi) P int (a/v) / (v (v^2 - w^2)) dv``,
    taken numerically over ISO 9613-1's curve less its classical part, with the singularity subtracted
    (``P int dv / (v^2 - w^2) = 0``).
    """
    state = (293.15, 101325.0, humidity)
    f = np.geomspace(1e-2, 1e9, 600_001)
    attenuation = air.air_attenuation.function(f, *state)
    relaxing = attenuation - f**2 * attenuation[-1] / f[-1] ** 2
    v, w = 2 * np.pi * f, 2 * np.pi * hertz
    integrand = relaxing / v**2
    here = np.interp(w, v, integrand)
    apart = np.where(np.isclose(v, w, rtol=1e-9), np.inf, v**2 - w**2)
    slower = 2 * w**2 / np.pi * np.trapezoid((integrand - here) / apart, v)
    found = air.air_dispersion.function(np.array([hertz]), 343.2, *state)[0]
    assert found == pytest.approx(-343.2 * slower, rel=0.03)


@pytest.mark.parametrize(
    ("celsius", "humidity", "decibel_per_km"),
    [
        (10.0, 0.7, [0.1, 0.4, 1.0, 1.9, 3.7, 9.7, 32.8, 117.0]),
        (20.0, 0.7, [0.1, 0.3, 1.1, 2.8, 5.0, 9.0, 22.9, 76.6]),
        (15.0, 0.5, [0.1, 0.5, 1.2, 2.2, 4.2, 10.8, 36.2, 129.0]),
    ],
)
def test_attenuation_is_that_of_the_table_of_iso_9613_2(celsius, humidity, decibel_per_km):
    """ISO 9613-2:1996, table 2, at the exact mid-band frequencies of the octaves from 63 Hz to 8 kHz."""
    f = 1000 * 10 ** (0.3 * np.arange(-4, 4))
    neper = air.air_attenuation.function(f, celsius + 273.15, 101325.0, humidity)
    np.testing.assert_allclose(neper * 20 / np.log(10) * 1000, decibel_per_km, rtol=0.005, atol=0.051)


def test_the_room_model_loads_one_module_of_acoustics():
    code = (
        "import sys; from specan.models.catalogue import example_model; from specan.room.model import air; "
        "example_model('room'); air.air_attenuation.function(1000.0, 293.15, 101325.0, 0.5); "
        "print([m for m in ('acoustics', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setattr(air, "find_spec", lambda name: None)
    with pytest.raises(RequestError, match="pip install acoustics"):
        air.iso_9613_1.__wrapped__()
