"""A small analytic model on which everything that a diagnosis says can be worked out by hand."""

import numpy as np
import pytest

from specan.models import (
    Condition,
    Model,
    Nuisance,
    Observable,
    Parameter,
    RigStatement,
    effect,
    quantity,
)
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import base_problem


@quantity(unit="W")
def heat(x):
    "What is lost."
    return np.zeros_like(x)


@quantity(unit="W")
def reading(heat):
    "What the instrument shows."
    return heat


@effect("line", adds_to="heat", neutral={"offset": 0.0, "slope": 0.0})
def line(
    x,
    *,
    offset=Parameter(1.0, "W", min=-1e4, max=1e4),
    slope=Parameter(1.0, "W", min=-1e4, max=1e4),
):
    "A straight line."
    return offset + slope * x


@effect("square", adds_to="heat", neutral={"c": 0.0})
def square(x, *, c=Parameter(1.0, "mW", min=-1e5, max=1e5)):
    "A parabola."
    return c * x**2


@effect("twin", adds_to="heat", neutral={"c": 0.0}, separate_by="a second instrument")
def twin(x, *, c=Parameter(1.0, "W", min=-50.0, max=50.0)):
    "The same parabola by another name."
    return c * x**2


@effect("wave", adds_to="heat", neutral={"c": 0.0})
def wave(x, *, c=Parameter(1.0, "W", min=0.0, max=50.0), rate=Parameter(5.0, "1", min=4.0, max=12.0)):
    "A wave of one sign and unknown wavelength."
    return c * np.cos(rate * x)


@effect("saturating", adds_to="heat", neutral={"a": 0.0})
def saturating(x, z, *, a=Parameter(1.0, "1", min=0.0, max=200.0)):
    "Rises steeply and then no more."
    return 3.0 * (1.0 - np.exp(-a * x)) * z


@effect("tilt", adds_to="heat", neutral={"c": 0.0})
def tilt(x, *, c=Parameter(1.0, "W", min=-10.0, max=10.0)):
    "What the straight line is collinear with."
    return c * x


@effect("cross", adds_to="heat", neutral={"c": 0.0})
def cross(x, z, *, c=Parameter(1.0, "W", min=-50.0, max=50.0)):
    "A product of both variables."
    return c * x * z


@effect("nearly-cross", adds_to="heat", neutral={"c": 0.0})
def nearly_cross(x, z, *, c=Parameter(1.0, "W", min=-50.0, max=50.0)):
    "Nearly the same product."
    return c * x * (z + 0.1 * z**2)


@effect("drift", adds_to="heat", neutral={"c": 0.0}, needs=("clock",))
def drift(clock, *, c=Parameter(1.0, "W/s", min=-1.0, max=1.0)):
    "Ordered in time."
    return c * clock


@effect("zero-error", adds_to="reading", neutral={"shift": 0.0}, instrument=True)
def zero_error(z, *, shift=Parameter(0.5, "W", min=-5.0, max=5.0, lower=-50.0, upper=50.0)):
    "The instrument shows too much on its second range."
    return shift * (np.asarray(z) > 0)


EFFECTS = (line, square, twin, wave, saturating, tilt, cross, nearly_cross, drift, zero_error)


class Toy:
    """Builds problems over a grid of x and z with noise of standard deviation one."""

    x = np.tile(np.linspace(0.1, 2.0, 8), 6)
    z = np.repeat(np.linspace(-1.0, 1.5, 6), 8)

    def model(self, *names, **more):
        known = {e.name: e for e in (*EFFECTS, *more.get("also", ()))}
        chosen = {n: known[n] for n in ("line", *names)}
        nuisances = (Nuisance("zero-error", "shift", 0.5, "certificate"),) if "zero-error" in chosen else ()
        return Model(
            "toy", "a toy",
            {
                "x": Condition("x", "1", "", "x", "1"),
                "z": Condition("z", "1", "", "z", "1"),
                "clock": Condition("clock", "s", "", "clock_s", "s"),
            },
            {q.name: q for q in (heat, reading)},
            chosen,
            {"reading": Observable("reading", "reading", "W", "")},
            base_effects=("line",),
            nuisances=nuisances,
            rig=RigStatement(limits={"x": (0.1, 4.0), "z": (-1.0, 1.5)}, discrepancy_percent=0.5),
            law="heat",
        )  # fmt: skip

    def observation(self, values, **more):
        return TableObservation(
            "toy",
            np.full(values.size, "reading"),
            values,
            {"x": self.x, "z": self.z},
            np.eye(values.size),
            labels={"x": self.x, "z": self.z},
            **more,
        )

    def problem(self, truth, names, seed=0, noise=1.0, **more):
        """A straight line plus `truth(x, z)`, and the named effects as candidates."""
        values = 2.0 + 3.0 * self.x + truth(self.x, self.z)
        values = values + noise * np.random.default_rng(seed).standard_normal(values.size)
        return base_problem(self.model(*names, **more), [self.observation(values)])


@pytest.fixture
def toy():
    return Toy()
