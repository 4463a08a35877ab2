"""A radial fan: its pressure rise and its shaft power over flow, speed and the air's temperature."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def pressure(rise, losses):
    """Rise of pressure between inlet and outlet."""
    return rise - losses


def power(flow, rise, drag):
    """Power at the shaft."""
    return flow * rise + drag


def turning(speed):
    """Speed of the wheel over that of the drawing."""
    return speed / 1500


def density(temperature):
    """Of air, over that at 20 degC."""
    return 293.15 / (temperature + 273.15)


def inner(flow):
    """Flow through the wheel."""
    return flow


def rise(density, turning, inner, head, slope):
    """What the wheel gives, by Euler."""
    return density * (head * turning**2 - slope * turning * inner)


def losses(density, flow, drop):
    """Friction in the casing."""
    return density * drop * flow**2


def drag(turning, bearing):
    """Bearings and seal."""
    return bearing * turning


@effect("incidence", adds_to="losses", neutral={"size": 0.0})
def incidence(
    density, flow, turning, *, size=Parameter(50, "Pa*s^2/m^6", min=5, max=1000, lower=0, upper=3000),
    design=Parameter(0.9, "m^3/s", min=0.5, max=1.3),
):  # fmt: skip
    """Off the design flow air meets the blades at an angle."""
    return size * density * (flow - design * turning) ** 2


@effect("gap-leakage", adds_to="inner", neutral={"leak": 0.0})
def gap_leakage(turning, *, leak=Parameter(0.05, "m^3/s", min=0.005, max=0.5, lower=0, upper=1)):
    """Air goes back through the gap at the inlet, and through the wheel again."""
    return leak * turning


@effect("disc-friction", adds_to="drag", neutral={"size": 0.0})
def disc_friction(density, turning, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000)):
    """The discs drag air around."""
    return size * density * turning**3


@effect("grease", adds_to="drag", neutral={"size": 0.0})
def grease(turning, temperature, *, size=Parameter(20, "W", min=1, max=300, lower=0, upper=1000)):
    """Cold grease is stiff."""
    return size * turning**2 * np.exp(-(temperature - 20) / 40)


@effect("belt-slip", scales="turning", neutral={"slip": 0.0})
def belt_slip(flow, *, slip=Parameter(0.01, "s/m^3", min=0.001, max=0.1, lower=0, upper=0.3)):
    """The belt slips under load."""
    return 1 - slip * flow


@effect("stall", adds_to="losses", neutral={"size": 0.0})
def stall(
    density, flow, turning, *, size=Parameter(200, "Pa*s^2/m^6", min=10, max=5000, lower=0, upper=10000),
    onset=Parameter(0.55, "m^3/s", min=0.4, max=0.9),
):  # fmt: skip
    """Below some flow it separates from the blades."""
    return size * density * np.maximum(onset * turning - flow, 0) ** 2


@effect("filter", adds_to="losses", neutral={"size": 0.0})
def filter_(flow, *, size=Parameter(20, "Pa*s/m^3", min=1, max=300, lower=0, upper=1000)):
    """A filter before the inlet."""
    return size * flow


@effect("reynolds", scales="losses", neutral={"power": 0.0})
def reynolds(flow, *, power=Parameter(0.1, "1", min=0.01, max=0.5, lower=0, upper=1)):
    """Friction falls with Reynolds' number."""
    return np.asarray(flow, dtype=float) ** -power


@effect("belt-loss", adds_to="drag", neutral={"share": 0.0})
def belt_loss(flow, rise, *, share=Parameter(0.02, "1/kW", min=0.002, max=0.3, lower=0, upper=1)):
    """The belt takes the more the more it carries."""
    return share * (flow * rise) ** 2 / 1000


@effect("inlet-swirl", adds_to="rise", neutral={"size": 0.0})
def inlet_swirl(density, inner, *, size=Parameter(30, "Pa*s^2/m^6", min=3, max=300, lower=0, upper=1000)):
    """The duct makes the air turn with the wheel."""
    return -size * density * inner**2


@effect("pressure-zero", adds_to="losses", neutral={"offset": 0.0})
def pressure_zero(*, offset=Parameter(5, "Pa", min=-60, max=60)):
    """The gauge does not read zero at rest."""
    return offset


@effect("torque-zero", adds_to="drag", neutral={"offset": 0.0})
def torque_zero(temperature, *, offset=Parameter(10, "W", min=-100, max=100)):
    """The torque meter's zero goes with its temperature."""
    return offset * (temperature - 20) / 25


EFFECTS = [
    incidence, gap_leakage, disc_friction, grease, belt_slip, stall, filter_, reynolds, belt_loss,
    inlet_swirl,
    pressure_zero, torque_zero,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as on the bench; each row has both readings."""
    return Model.from_function(
        pressure, power, turning, density, inner, rise, losses, drag,
        conditions={"flow": ("m^3/s", 0.2, 1.7), "speed": ("1/min", 900, 1800), "temperature": ("degC", -5, 45)},
        observables={"pressure": "Pa", "power": "W"},
        parameters={
            "head": (900.0, 400, 1600, "Pa"), "slope": (150.0, 0, 500, "Pa*s/m^3"),
            "drop": (150.0, 10, 500, "Pa*s^2/m^6"), "bearing": (40.0, 5, 200, "W"),
        },
        units={"turning": "1", "density": "1", "inner": "m^3/s", "rise": "Pa", "losses": "Pa", "drag": "W"},
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Curves from throttled to open, at speeds and in cold and warm air."""
    coefficients = np.linspace(0.3, 1.3, rng.integers(6, 10))
    warm, speed, coefficient = (
        x.ravel()
        for x in np.meshgrid([-5.0, 20.0, 45.0], [900.0, 1350.0, 1800.0], coefficients, indexing="ij")
    )
    return {"flow": np.round(coefficient * speed / 1500, 3), "speed": speed, "temperature": warm}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Exponents of the truth."""
    return {
        "head": rng.uniform(700, 1100), "slope": rng.uniform(100, 200), "drop": rng.uniform(100, 200),
        "bearing": rng.uniform(25, 60), "wall": rng.uniform(1.95, 2.0), "slip": rng.uniform(0.001, 0.006),
        "rub": rng.uniform(0.95, 1.05), "design": rng.uniform(0.7, 1.1), "shock": rng.uniform(1.75, 2.1),
        "disc": rng.uniform(2.75, 2.9), "thin": rng.uniform(30, 60),
        "creep": rng.uniform(0.9, 1.3), "stall": rng.uniform(0.5, 0.75),
        "stall_width": rng.uniform(0.02, 0.06),
        "stall_power": rng.uniform(1.7, 2.2), "felt": rng.uniform(0.05, 0.25), "rough": rng.uniform(1.5, 3),
        "carried": rng.uniform(1.85, 2.15), "swirl": rng.uniform(1.8, 2.2), "duct": rng.uniform(0.6, 1.1),
        "duct_width": rng.uniform(0.08, 0.15), "blade": rng.uniform(1250, 1500), "ice": rng.uniform(3, 10),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """A wheel with a slip factor of its own, losses of other powers, round corners."""
    q, n, warm = table["flow"], table["speed"] / 1500, table["temperature"]
    rho = 293.15 / (warm + 273.15)
    n = n * (1 - s["belt-slip"] * (q * n * rho) ** f["creep"] / n**0.2)
    phi = q / n
    rise = rho * n * (f["head"] * n * (1 - f["slip"] * (phi - 0.8) ** 2) - f["slope"] * q)
    rise = rise - s["inlet-swirl"] * rho * q ** f["swirl"]
    # Friction by Swamee and Jain's falling line over that at 1 m3/s.
    falling = (np.log10(10 ** f["rough"]) / np.log10(10 ** f["rough"] * q**0.9)) ** (
        2 * f["rough"] * s["reynolds"]
    )
    loss = rho * f["drop"] * q ** f["wall"] * falling
    loss = loss + s["incidence"] * rho * n**2 * np.abs(phi - f["design"]) ** f["shock"]
    separated = f["stall_width"] * np.logaddexp(0, (f["stall"] - phi) / f["stall_width"])
    loss = loss + s["stall"] * rho * n**2 * separated ** f["stall_power"]
    loss = loss + s["filter"] * q * ((warm + 273.15) / 293.15) ** 0.7 * (1 + f["felt"] * (q - 0.8))
    loss = loss + s["pressure-zero"] * (1 + 0.002 * (warm - 20))
    loss = loss + s["duct-resonance"] * np.exp(-0.5 * ((phi - f["duct"]) / f["duct_width"]) ** 2)
    loss = loss + s["ice"] * rho * q**2 / (1 + np.exp((warm - f["ice"]) / 2))
    drag = f["bearing"] * n ** f["rub"] + s["disc-friction"] * rho**0.8 * n ** f["disc"]
    drag += s["grease"] * n**1.67 * np.exp(-(warm - 20) / f["thin"])
    drag += (
        s["belt-loss"] * 1000 * (q * rise / 1000) ** f["carried"]
        + s["torque-zero"] * np.sinh((warm - 20) / 25) / 1.05
    )
    drag += s["blade-flutter"] / (1 + ((1500 * n - f["blade"]) / 90) ** 2) * q
    return {"pressure": rise - loss, "power": q * rise + drag}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "incidence": (0, 500), "disc-friction": (0, 200), "grease": (0, 150), "belt-slip": (0, 0.06),
        "stall": (0, 2000), "filter": (0, 150), "reynolds": (0, 0.3), "belt-loss": (0, 0.2),
        "inlet-swirl": (0, 150),
        "pressure-zero": (-40, 40), "torque-zero": (-60, 60),
    },
    outside={"duct-resonance": (0, 150), "ice": (0, 150), "blade-flutter": (0, 300)},
)  # fmt: skip
