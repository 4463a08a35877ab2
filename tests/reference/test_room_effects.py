"""Effects of the room against closed forms, published values and simulated signals, not against themselves."""

import numpy as np
import pytest
from scipy import signal

from specan.models.catalogue import load_model

LENGTHS = np.array([0.9, 0.6, 0.7])
RIG = {
    "room": {"dims_m": LENGTHS.tolist()},
    "piston": {"wall": "x0", "centre_m": [0.0, 0.246, 0.3229], "radius_m": 0.05},
    "band": {"f_max_hz": 700.0},
    "mics": {"position_m": [[0.2, 0.1, 0.3], [0.7, 0.5, 0.1]], "cards": [[1, 1], [2, 2]]},
}
DENSITY, SOUND_SPEED = 1.2, 343.0


@pytest.fixture(scope="module")
def model():
    return load_model("room", RIG)


def admittance(model, name, frequency, **parameters):
    """What an effect adds to rho c / Z of its wall."""
    return model.effects[name].function(np.asarray(frequency), DENSITY, SOUND_SPEED, **parameters)


def test_a_panel_is_a_spring_below_its_resonance_a_mass_above_it_and_a_resistance_at_it(model):
    """Z = r + j (w m - s / w) with s = m w0^2 and r = eta m w0 (Kuttruff, Room Acoustics)."""
    mass, resonance, loss = 4.0, 120.0, 0.1
    f = np.array([30.0, 120.0, 480.0])
    beta = admittance(
        model, "panel-resonance", f, coverage=1.0, mass=mass, resonance=resonance, loss_factor=loss
    )
    impedance = DENSITY * SOUND_SPEED / beta
    omega, omega0 = 2 * np.pi * f, 2 * np.pi * resonance
    stiffness = mass * omega0**2
    np.testing.assert_allclose(
        impedance, loss * mass * omega0 + 1j * (omega * mass - stiffness / omega), rtol=1e-12
    )
    assert impedance[0].imag < 0 < impedance[2].imag  # exp(+j w t): a stiffness has a negative reactance


def test_a_porous_layer_has_mikis_coefficients(model):
    """Miki 1990, eqs 33 to 36, at f / sigma = 1 where the powers are one: Zc / rho c and k c / w by hand."""
    f = sigma = 4000.0
    depth = 0.01
    beta = admittance(model, "porous-absorber", [f], coverage=1.0, flow_resistivity=sigma, thickness=depth)[0]
    characteristic = 1.0699 - 0.1071j
    wavenumber = 2 * np.pi * f / SOUND_SPEED * (1.1093 - 0.1597j)
    expected = 1 / (-1j * characteristic / np.tan(wavenumber * depth))
    assert beta == pytest.approx(expected, rel=5e-3)  # coefficients are printed with three or four digits
    assert beta.real > 0  # it takes energy


def test_a_late_vibrometer_channel_lets_the_pressure_lead(model):
    """H1 of a simulated pair of channels, the vibrometer's shifted by whole samples, as scipy estimates it."""
    rate, late = 51200.0, 41
    velocity = np.random.default_rng(0).standard_normal(1 << 17)
    indicated = np.roll(velocity, late)  # the channel shows what was there 41 samples before
    f, cross = signal.csd(indicated, velocity, rate, nperseg=8192)
    _, power = signal.welch(indicated, rate, nperseg=8192)
    chosen = (f > 100) & (f < 600)
    turned = np.angle(cross[chosen] / power[chosen])  # of pressure = velocity over what is indicated
    ours = indicated_phase(model, "vibrometer-delay", {"vibrometer-delay.delay": late / rate}, f[chosen])
    np.testing.assert_allclose(ours, turned, atol=0.03)
    assert np.all(ours > 0)


def test_a_late_card_lets_the_pressure_lag(model):
    rate, late = 51200.0, 41
    velocity = np.random.default_rng(0).standard_normal(1 << 17)
    indicated = np.roll(velocity, late)
    f, cross = signal.csd(velocity, indicated, rate, nperseg=8192)
    chosen = (f > 100) & (f < 600)
    use = f"microphone-delay@{model.axes['card'][0]}"
    ours = indicated_phase(model, use, {f"{use}.delay": late / rate}, f[chosen])
    np.testing.assert_allclose(ours, np.angle(cross[chosen]), atol=0.03)
    assert np.all(ours < 0)


def indicated_phase(model, use, values, frequency):
    """By how much an instrument error turns the indicated transfer function of the first microphone."""
    conditions = {"frequency": frequency, "velocity_psd": np.full(frequency.size, 1e-11)}
    plain = model.assemble().evaluate(conditions)["indicated_frf"][0]
    turned = model.assemble([use]).evaluate(conditions, values)["indicated_frf"][0]
    return np.angle(turned / plain)


@pytest.mark.parametrize(("temperature", "speed"), [(0.0, 331.3), (20.0, 343.2), (30.0, 349.0)])
def test_sound_speed_follows_the_temperature(temperature, speed):
    rig = {**RIG, "air": {"nominal_temperature_C": temperature}}
    found = (
        load_model("room", rig)
        .assemble()
        .evaluate({"frequency": np.array([1000.0]), "velocity_psd": np.ones(1)})
    )
    assert np.real(found["sound_speed"]) == pytest.approx(speed, rel=2e-3)


def test_a_helmholtz_resonator_resonates_where_kinsler_says(model):
    """f0 = (c / 2 pi) sqrt(S / (V l')): the neck's impedance has no reactance there and is a mass above it."""
    area, volume, length = 3e-4, 1e-3, 0.035
    f0 = SOUND_SPEED / (2 * np.pi) * np.sqrt(area / (volume * length))
    f = np.array([0.5 * f0, f0, 2 * f0])
    patch = {"radius": 0.02, "end": 8 / (3 * np.pi)}
    load = model.effects["helmholtz-resonator"].function(
        f,
        DENSITY,
        neck_area=area,
        resonance=f0,
        quality=20.0,
        neck_length=length,
        across=0.5,
        along=0.5,
        **patch,
    )
    # Volume stiffness rho c^2 / V against the neck's mass rho l' / S, as impedances p over volume flow. The mass of the
    # air before a baffled patch of radius a, 8 rho / (3 pi^2 a), is in the field already and is taken off.
    omega, before = 2 * np.pi * f, 8 * DENSITY / (3 * np.pi**2 * load.port.radius)
    reactance = omega * (DENSITY * length / area - before) - DENSITY * SOUND_SPEED**2 / (omega * volume)
    flow = np.ravel(load.strength)
    found = (1 / flow).imag
    np.testing.assert_allclose(found[[0, 2]], reactance[[0, 2]], rtol=0.02)
