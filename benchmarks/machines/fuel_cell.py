"""A fuel cell with a polymer membrane: its voltage over current density, temperature and pressure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from machines.cases import Array, Machine, Table
from specan.models import Model, Parameter, effect


def voltage(reversible, activation, ohmic, transport):
    """Voltage of the cell."""
    return reversible - activation - ohmic - transport


def reversible(temperature, pressure):
    """By Nernst, pure hydrogen and air."""
    kelvin = temperature + 273.15
    return 1.229 - 0.00085 * (kelvin - 298.15) + 4.31e-5 * kelvin * 1.5 * np.log(pressure)


def reacting(current):
    """Current density that the cathode makes."""
    return current


def activation(reacting, temperature, tafel, exchange):
    """By Tafel; the slope goes with temperature."""
    return tafel * (temperature + 273.15) / 333.15 * np.log(reacting / (1e-6 * exchange))


def ohmic(current, resistance):
    """Membrane and contacts."""
    return resistance * current


def transport(current):
    """Nothing is short of gas yet."""
    return 0.0 * current


@effect("mass-transport", adds_to="transport", neutral={"size": 0.0})
def mass_transport(
    current, *, size=Parameter(1e-3, "V", min=1e-6, max=0.05, lower=0, upper=0.2),
    steepness=Parameter(3, "cm^2/A", min=1, max=8),
):  # fmt: skip
    """Oxygen runs short at high current."""
    return size * np.exp(steepness * current)


@effect("crossover", adds_to="reacting", neutral={"leak": 0.0})
def crossover(*, leak=Parameter(0.005, "A/cm^2", min=0.0005, max=0.2, lower=0, upper=0.5)):
    """Hydrogen goes through the membrane and reacts there."""
    return leak


@effect("membrane-drying", scales="ohmic", neutral={"rate": 0.0})
def membrane_drying(temperature, *, rate=Parameter(0.1, "1", min=0.01, max=1, lower=0, upper=2)):
    """A warm membrane loses water."""
    return 1 + rate * (temperature - 50) / 20


@effect("current-drying", scales="ohmic", neutral={"rate": 0.0})
def current_drying(current, *, rate=Parameter(0.1, "cm^2/A", min=0.01, max=1, lower=0, upper=2)):
    """Protons drag water from the anode's side."""
    return 1 + rate * current


@effect("flooding", adds_to="transport", neutral={"size": 0.0})
def flooding(
    current, temperature, *, size=Parameter(0.1, "V*cm^4/A^2", min=0.005, max=2, lower=0, upper=5),
    onset=Parameter(0.7, "A/cm^2", min=0.3, max=1.2),
):  # fmt: skip
    """Water fills the pores where it is cool and much is made."""
    return size * (80 - temperature) / 30 * np.maximum(current - onset, 0) ** 2


@effect("activated-exchange", adds_to="activation", neutral={"size": 0.0})
def activated_exchange(temperature, *, size=Parameter(0.05, "V", min=0.005, max=0.5, lower=-1, upper=1)):
    """The exchange current follows Arrhenius."""
    return -size * (temperature + 273.15) / 333.15 * (1 - 333.15 / (temperature + 273.15)) * 10


@effect("oxygen-order", adds_to="activation", neutral={"order": 0.0})
def oxygen_order(pressure, *, order=Parameter(0.02, "V", min=0.002, max=0.1, lower=0, upper=0.3)):
    """The exchange current goes with a power of the oxygen's pressure."""
    return -order * np.log(pressure)


@effect("carbon-monoxide", adds_to="activation", neutral={"size": 0.0})
def carbon_monoxide(
    current, temperature, *, size=Parameter(0.02, "V", min=0.002, max=0.2, lower=0, upper=0.5),
    limit=Parameter(0.3, "A/cm^2", min=0.05, max=0.8),
):  # fmt: skip
    """The anode is covered while it is cool; hydrogen needs an overvoltage too."""
    return size * (85 - temperature) / 35 * np.arcsinh(current / limit)


@effect("gas-film", adds_to="transport", neutral={"size": 0.0})
def gas_film(current, pressure, *, size=Parameter(0.02, "V*cm^2/A", min=0.002, max=0.3, lower=0, upper=1)):
    """Thin gas brings oxygen more slowly at low pressure."""
    return size * current * (1 / pressure - 0.4)


@effect("ohmic-short", adds_to="reacting", neutral={"conductance": 0.0})
def ohmic_short(current, *, conductance=Parameter(0.01, "A/cm^2", min=0.001, max=0.3, lower=0, upper=1)):
    """Electrons take a short way, the more the higher the voltage."""
    return conductance * np.exp(-2 * current)


EFFECTS = [
    mass_transport, crossover, membrane_drying, current_drying, flooding, activated_exchange, oxygen_order,
    carbon_monoxide, gas_film, ohmic_short,
]  # fmt: skip


def model(uncertainty: Mapping[str, float]) -> Model:
    """Conditions as on the bench."""
    return Model.from_function(
        voltage, reversible, reacting, activation, ohmic, transport,
        conditions={"current": ("A/cm^2", 0.02, 1.4), "temperature": ("degC", 50, 80), "pressure": ("bar", 1, 2.5)},
        observables={"voltage": "V"},
        parameters={
            "tafel": (0.028, 0.015, 0.06, "V"), "exchange": (1.0, 0.001, 300, "uA/cm^2"),
            "resistance": (0.15, 0.03, 0.5, "V*cm^2/A"),
        },
        units={"reversible": "V", "reacting": "A/cm^2", "activation": "V", "ohmic": "V", "transport": "V"},
        effects=EFFECTS, uncertainty=uncertainty,
    )  # fmt: skip


def plan(rng: np.random.Generator) -> Table:
    """Polarisation curves at temperatures and pressures."""
    currents = np.concatenate([[0.02, 0.05, 0.1], np.linspace(0.2, 1.4, rng.integers(6, 13))])
    pressure, temperature, current = (
        x.ravel() for x in np.meshgrid([1.0, 1.6, 2.5], [50.0, 60.0, 70.0, 80.0], currents, indexing="ij")
    )
    return {"current": np.round(current, 3), "temperature": temperature, "pressure": pressure}


def forms(rng: np.random.Generator) -> dict[str, float]:
    """Kinetics and transport of the truth."""
    return {
        "alpha": rng.uniform(0.85, 1.15), "exchange": np.exp(rng.uniform(np.log(3e-7), np.log(5e-6))),
        "resistance": rng.uniform(0.09, 0.22), "entropy": rng.uniform(0.82e-3, 0.88e-3),
        "limit": rng.uniform(1.46, 1.75),
        "leak_heat": rng.uniform(0, 1500), "springer": rng.uniform(0.6, 1.5), "drag": rng.uniform(0.8, 1.3),
        "flood": rng.uniform(0.55, 0.95), "flood_width": rng.uniform(0.03, 0.1),
        "cool": rng.uniform(0.9, 1.3),
        "cover": rng.uniform(0.1, 0.4), "desorb": rng.uniform(16, 22), "warm": rng.uniform(-0.006, 0.006),
        "bend": rng.uniform(-0.03, 0.03), "film": rng.uniform(0.85, 1.15), "spot": rng.uniform(0.4, 1.0),
        "spot_width": rng.uniform(0.05, 0.12), "dew": rng.uniform(57, 72), "dead": rng.uniform(1.2, 2.0),
    }  # fmt: skip


def readings(table: Table, f: Mapping[str, float], s: Mapping[str, float]) -> dict[str, Array]:
    """Butler and Volmer, a limiting current, a membrane that conducts as Springer has it."""
    i, celsius, p = table["current"], table["temperature"], table["pressure"]
    kelvin = celsius + 273.15
    thermal = 8.314 * kelvin / 96485
    reversible = 1.229 - f["entropy"] * (kelvin - 298.15) + thermal / 2 * np.log(p**1.5)
    open_circuit = 0.95 - 0.4 * i  # roughly what drives a short
    made = i + s["crossover"] * np.exp(f["leak_heat"] * (1 / 333.15 - 1 / kelvin)) * p**0.1
    made = made + s["ohmic-short"] * np.maximum(open_circuit, 0)
    arrhenius = 10 * s["activated-exchange"] * (1 - 333.15 / kelvin) * kelvin / 333.15
    kinetics = (
        thermal / f["alpha"] * (1 + f["warm"] * (celsius - 65) / 15) * np.arcsinh(made / (2 * f["exchange"]))
        - arrhenius
    )
    kinetics -= s["oxygen-order"] * np.log(p) * kelvin / 333.15
    kinetics += s["carbon-monoxide"] * 1.3 * np.log1p(i / f["cover"]) * np.exp(-(celsius - 50) / f["desorb"])
    dry = s["membrane-drying"] * np.expm1(f["springer"] * (celsius - 50) / 30) / np.expm1(f["springer"]) * 1.5
    pull = s["current-drying"] * i ** f["drag"]
    ohmic = f["resistance"] * (1 + f["bend"] * np.tanh(3 * (i - 0.7))) * i * (1 + dry) * (1 + pull)
    transport = -s["mass-transport"] * thermal * np.log(1 - i / f["limit"])
    wet = f["flood_width"] * np.logaddexp(0, (i - f["flood"]) / f["flood_width"])
    transport += s["flooding"] * wet**2 * ((80 - celsius) / 30) ** f["cool"]
    transport += s["gas-film"] * i * (p ** -f["film"] - 0.4)
    transport += s["membrane-bubble"] * np.exp(-0.5 * ((i - f["spot"]) / f["spot_width"]) ** 2)
    transport += s["dew"] * i * np.exp(-0.5 * ((celsius - f["dew"]) / 4) ** 2)
    transport += s["dead-end"] / (1 + np.exp((p - f["dead"]) / 0.05)) * i**2
    return {"voltage": reversible - kinetics - ohmic - transport}


MACHINE = Machine(
    model, plan, forms, readings,
    inside={
        "mass-transport": (0, 3), "crossover": (0, 0.12), "membrane-drying": (0, 0.6),
        "current-drying": (0, 0.6),
        "flooding": (0, 0.8), "activated-exchange": (0, 0.2), "oxygen-order": (0, 0.06),
        "carbon-monoxide": (0, 0.1),
        "gas-film": (0, 0.15), "ohmic-short": (0, 0.15),
    },
    outside={"membrane-bubble": (0, 0.1), "dew": (0, 0.15), "dead-end": (0, 0.15)},
)  # fmt: skip
