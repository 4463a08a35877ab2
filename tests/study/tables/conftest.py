"""Small worm-gear tables for the tests of the study engine, made with the model itself."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.schema import read_toml

RIG = Path(__file__).parents[3] / "sample_data" / "worm_gear" / "rig.toml"
NOISE = 0.01  # N*m
SETTING = 0.05


def rig(**uncertainty):
    content = read_toml(RIG)
    content["uncertainty"] = {"model_discrepancy_percent": 0.0, **uncertainty}
    return content


def model(**uncertainty):
    return load_model("worm-gear", rig(**uncertainty))


def write_rig(path, **uncertainty):
    """The sample rig with other uncertainties, as a file."""
    lines, skip = [], False
    for line in RIG.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            skip = line.startswith("[uncertainty]")
        if not skip:
            lines.append(line)
    lines += [
        "[uncertainty]",
        *(f"{k} = {v}" for k, v in {"model_discrepancy_percent": 0.0, **uncertainty}.items()),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def grid(speeds=(800, 1500, 2800), torques=(5, 20, 50, 90), temperatures=(45, 70)):
    points = np.array([(n, t, c) for c in temperatures for t in torques for n in speeds], dtype=float)
    return {"speed_rpm": points[:, 0], "output_torque_Nm": points[:, 1], "oil_temperature_C": points[:, 2]}


def input_torque(columns, effects=None):
    """What the base model with `effects` ({"name.parameter": SI value}) needs at the input."""
    known = model()
    names = {name.rpartition(".")[0] for name in effects or {}}
    assembly = known.assemble([*known.base_effects, *names])
    conditions = {
        "worm_speed": columns["speed_rpm"] * np.pi / 30,
        "indicated_output_torque": columns["output_torque_Nm"],
        "indicated_oil_temperature": columns["oil_temperature_C"] + 273.15,
    }
    return assembly.evaluate(conditions, effects, ["indicated_input_torque"])["indicated_input_torque"]


def bench(seed=0, repeats=2, readings=1, effects=None, setting="read", noise=NOISE, marks=True, points=None):
    """A table as a bench gives it.

    Each condition is set anew for each repeat (torque scatters by 5 %), in rounds over all conditions, and
    read `readings` times. ``setting="set"``: the table holds the set torque, not the one that was there.
    """
    rng = np.random.default_rng(seed)
    plan = points or grid()
    size = plan["speed_rpm"].size
    columns = {name: np.tile(values, repeats) for name, values in plan.items()}
    actual = columns["output_torque_Nm"] * (1 + SETTING * rng.standard_normal(size * repeats))
    true = {**columns, "output_torque_Nm": actual}
    torque = np.repeat(input_torque(true, effects), readings)
    out = {name: np.repeat(values, readings) for name, values in columns.items()}
    if setting == "read":
        out["output_torque_Nm"] = np.round(np.repeat(actual, readings), 2)
        torque = np.repeat(
            input_torque({**columns, "output_torque_Nm": np.round(actual, 2)}, effects), readings
        )
    out["input_torque_Nm"] = np.round(torque + noise * rng.standard_normal(torque.size), 3)
    if marks:
        out["repeat"] = np.repeat(np.repeat(np.arange(1, repeats + 1), size), readings)
        if readings > 1:
            out["setup"] = np.repeat(np.arange(size * repeats), readings)
    return out


def write_table(path, columns, delimiter=","):
    rows = zip(*columns.values(), strict=True)
    text = [delimiter.join(columns), *(delimiter.join(f"{v:.10g}" for v in row) for row in rows)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def tables():
    """The functions above, for tests that cannot import them."""
    return SimpleNamespace(
        rig=rig, model=model, write_rig=write_rig, grid=grid, input_torque=input_torque, bench=bench,
        write_table=write_table, RIG=RIG, NOISE=NOISE, SETTING=SETTING,
    )  # fmt: skip
