"""Effects of the shelf: each has a source, does nothing where it is neutral, and marches with numba or without."""

import numpy as np
import pytest

from specan import shelf
from specan.errors import RequestError
from specan.models import Model, Signal, State, march
from tests.rates.test_solver import damper, dv, dx, spring

TIME = np.arange(400) / 500
FORCE = 30 * np.sin(2 * np.pi * (3 * TIME + 12 * TIME**2))


def model():
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm", 0.05)},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"), "mass": (1, 0.1, 10, "kg")},
        units={"spring": "N", "damper": "N"},
        effects=[
            *shelf.mechanics(force=("spring", 60, "N"), x=("x", 6e-3, "m"), v=("v", 0.6, "m/s")),
            *shelf.sensor(of=("x", 6, "mm"), input="force"), *shelf.actuator(of=("force", 30, "N")),
        ],
    )  # fmt: skip


def response(known, effects=(), values=None):
    given = {"time": TIME, "force_channel": FORCE}
    return known.assemble(effects).evaluate(given, values, wanted=["x_measured"])["x_measured"]


@pytest.fixture(scope="module")
def known():
    return model()


@pytest.fixture(scope="module")
def plain(known):
    return response(known)


def test_thirty_effects_with_sources(known):
    assert len(known.effects) >= 30
    assert all(e.reference and e.explanation for e in known.effects.values())


@pytest.mark.parametrize("name", model().effects)
def test_neutral_does_nothing_and_the_default_something(known, plain, name):
    neutral = known.assemble([name]).neutral
    assert np.allclose(response(known, [name], neutral), plain, rtol=0, atol=5e-3)
    changed = response(known, [name])
    assert np.all(np.isfinite(changed))
    assert np.sqrt(np.mean((changed - plain) ** 2)) > 1e-3 * np.std(plain)


@pytest.mark.parametrize("name", ["bouc-wen", "tuned-mass", "dry-friction", "x-lag"])
def test_the_same_without_numba(known, name, monkeypatch):
    monkeypatch.setattr(march, "_numba", lambda: None)
    slow = model()
    assert np.allclose(response(slow, [name]), response(known, [name]), rtol=1e-9, atol=1e-9)
    assert 'pip install "specan[fast]"' in slow.solver.method()


def test_a_delay_and_a_filter_of_the_sensor_in_closed_form(known, plain):
    late = response(known, ["x-delay"], {"x-delay.size": 0.004})
    assert np.allclose(late[2:], plain[:-2], atol=1e-9)  # two samples


@pytest.mark.parametrize("name", ["x-delay", "x-lag"])
def test_a_delay_or_a_filter_of_a_tone_of_few_samples_in_closed_form(known, name):
    """1 / (1 + i w T) and what the filter begins from, of a tone with thirteen samples a period; a delay of 1.65."""
    w, size = 2 * np.pi * 40, 0.0033
    value = np.exp(1j * (w * TIME + 0.3))
    gain = np.exp(-1j * w * size) if name == "x-delay" else 1 / (1 + 1j * w * size)
    expected = (value * gain).imag
    if name == "x-lag":
        expected += (value - value * gain).imag[0] * np.exp(-TIME / size)
    changed = known.effects[name].function(value.imag, TIME, size=size)
    assert np.max(np.abs(value.imag + changed - expected)[5:]) < 2e-4


def test_a_size_without_a_unit_is_refused_in_words():
    with pytest.raises(RequestError, match="does not state its size; expected its name, or also its"):
        shelf.mechanics(force=("spring", 60), x=("x", 5, "mm"), v=("v", 400, "mm/s"))


def test_sizes_are_those_of_a_recording(known):
    """A tone: 95 % of its samples stay below 0.997 of its amplitude; what is not measured goes with what is."""
    with_names = Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm", 0.05)},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (200, 1, 300, "N*s/m"), "mass": (1, 0.1, 10, "kg")},
        units={"spring": "N", "damper": "N"},
        effects=shelf.mechanics(force="spring", x="x", v="v") + shelf.sensor(of="x", input="force")
        + shelf.actuator(of="force"),
    )  # fmt: skip
    assert list(with_names.effects) == list(known.effects)
    assert "ranges for values of about 1" in with_names.notes[0]
    omega, clock = 2 * np.pi * 5, np.arange(5000) / 1000
    given = {"time": clock, "force_channel": 30 * np.sin(omega * clock)}
    sized = with_names.rates.sized(with_names, [(given, {"x": 4 * np.sin(omega * clock)})])
    assert not sized.notes
    expected = {
        "dry-friction": 0.1 * 1e4 * 4e-3, "viscous-friction": 0.1 * 1e4 / omega, "x-zero": 0.1 * 4,
        "force-zero": 0.1 * 30, "quadratic-spring": 0.1 * 1e4 * 4e-3 / 4e-3**2,
    }  # fmt: skip
    for name, size in expected.items():
        assert sized.effects[name].parameters["size"].default == pytest.approx(size, rel=0.02)


def test_a_name_that_the_model_lacks_is_told():
    with pytest.raises(RequestError, match=r"no 'sprung'.*spring"):
        Model.from_rates(
            dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
            observables={"x": Signal("mm")}, units={"spring": "N", "damper": "N"},
            parameters={"stiffness": 1e4, "damping": 20, "mass": 1},
            effects=shelf.mechanics(force="sprung", x="x", v="v"),
        )  # fmt: skip
