"""Which effects look alike is declared in words and compared with numbers.

Seen is what a refitted base leaves of an effect: its derivative less its projection on the base's. Two effects
whose remainders point the same way cannot be distinguished on that grid.
"""

import itertools
import math

import numpy as np
import pytest

from specan.models.catalogue import example_model

MODEL = example_model("worm-gear")
BASE = MODEL.assemble(MODEL.base_effects)
NODE = "indicated_input_torque"
TRUTH = {
    "tooth-friction.mu": 0.045,
    "churning.power": 50.0,
    "churning.exponent": 1.5,
    "churning.viscosity_exponent": 0.4,
    "churning.constant": 5.0,
    "bearing-friction.scale": 0.6,
}
FREE = BASE.free({"indicated_oil_temperature"})
GRID = {
    name: axis.ravel()
    for name, axis in zip(
        ("worm_speed", "indicated_output_torque", "indicated_oil_temperature"),
        np.meshgrid(
            np.array([300, 600, 1000, 1500, 2000, 2500, 3000.0]) * math.pi / 30,
            [0.0, 5, 10, 20, 40, 60, 80, 100],
            np.array([25.0, 40, 60, 80]) + 273.15,
        ),
        strict=True,
    )
}
GRID["elapsed_time"] = np.random.default_rng(0).permutation(GRID["worm_speed"].size) * 600.0


def torque(assembly, values):
    return assembly.evaluate(GRID, values, wanted=[NODE])[NODE]


REFERENCE = torque(BASE, TRUTH)
SIGMA = np.hypot(0.01, 0.003 * REFERENCE)


def base_jacobian():
    columns = []
    for name in FREE:
        step = 1e-4 * max(abs(TRUTH[name]), 0.1)
        up, down = (torque(BASE, {**TRUTH, name: TRUTH[name] + s * step}) for s in (1, -1))
        columns.append((up - down) / (2 * step * SIGMA))
    return np.array(columns).T


def remainders():
    """Unit vectors of what is seen of each amplitude, and how much that is at its default."""
    basis, _ = np.linalg.qr(base_jacobian())
    seen, size = {}, {}
    for name, effect in MODEL.effects.items():
        if name in MODEL.base_effects:
            continue
        assembly = MODEL.assemble([*BASE.uses, name])
        for amplitude in effect.neutral:
            others = {f"{name}.{n}": v for n, v in effect.neutral_si.items() if n != amplitude}
            change = (torque(assembly, {**TRUTH, **others}) - REFERENCE) / SIGMA
            rest = change - basis @ (basis.T @ change)
            size[name, amplitude] = float(rest @ rest)
            seen[name, amplitude] = rest / np.linalg.norm(rest)
    return seen, size


SEEN, SIZE = remainders()


def one_signed(name, amplitude):
    """Whether the amplitude only goes one way from where the effect vanishes."""
    effect = MODEL.effects[name]
    domain = effect.parameters[amplitude].si
    return effect.neutral_si[amplitude] in (domain.lower, domain.upper)


def cosine_to_taken(one, other):
    """Largest cosine between amplitudes of two effects; opposite signatures differ where neither can turn its sign."""
    cosines = []
    for a, b in itertools.product(SEEN, SEEN):
        if (a[0], b[0]) == (one, other):
            cosine = float(SEEN[a] @ SEEN[b])
            cosines.append(cosine if one_signed(*a) and one_signed(*b) else abs(cosine))
    return max(cosines)


def test_the_base_is_identified_on_a_full_grid():
    assert len(FREE) == 6
    columns = base_jacobian()
    columns /= np.linalg.norm(columns, axis=0)
    assert np.linalg.svd(columns, compute_uv=False)[-1] > 0.1


@pytest.mark.parametrize("name", [n for n in MODEL.effects if n not in MODEL.base_effects])
def test_declared_look_alikes_look_alike(name):
    for other in MODEL.effects[name].aliases:
        if other not in MODEL.base_effects:
            assert cosine_to_taken(name, other) > 0.6, other


def test_what_looks_alike_is_declared():
    names = sorted({name for name, _ in SEEN})
    for one, other in itertools.combinations(names, 2):
        # an error of a gain leaves next to nothing, and the direction of next to nothing says nothing
        if cosine_to_taken(one, other) > 0.8 and "torque-gain-error" not in (one, other):
            assert other in MODEL.effects[one].aliases, (one, other)
            assert one in MODEL.effects[other].aliases, (other, one)


def test_a_seal_and_a_zero_error_are_one():
    assert cosine_to_taken("seal-drag", "torque-zero-error") == pytest.approx(1.0, abs=1e-9)


def test_the_base_takes_up_what_it_is_declared_to_take_up():
    assert SIZE["torque-gain-error", "input"] < 1
    assert SIZE["temperature-bias", "bias"] < 1
    for name in ("speed-dependent-friction", "viscosity-dependent-friction", "load-dependent-friction"):
        assert max(v for (n, _), v in SIZE.items() if n == name) > 100
