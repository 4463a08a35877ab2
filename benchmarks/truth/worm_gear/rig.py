"""The rig file of the simulated bench."""

from __future__ import annotations

from typing import Any

RIG: dict[str, Any] = {
    "gear": {
        "z_worm": 4,
        "z_wheel": 30,
        "worm_pitch_diameter_mm": 35.0,
        "wheel_pitch_diameter_mm": 90.0,
        "lead_angle_deg": 18.92,
        "normal_pressure_angle_deg": 20.0,
        "worm_width_mm": 39.4,
        "wheel_width_mm": 25.0,
        "worm_bearing_positions_mm": [-31.0, 31.0],
        "wheel_bearing_positions_mm": [-54.8, 62.2],
    },
    "bearing": [
        {"designation": "6211", "shaft": "wheel", "count": 2},
        {"designation": "6009", "shaft": "worm", "count": 1},
        {"designation": "6202", "shaft": "worm", "count": 1},
    ],
    "oil": {
        "density_kg_m3": 1000.0,
        "viscosity_40C_mm2_s": 220.0,
        "viscosity_100C_mm2_s": 36.0,
        "volume_ml": 180.0,
    },
    "operation": {
        "oil_temperature_C": 58.0,
        "oil_level_percent": 100.0,
        "ambient_temperature_C": 22.0,
    },
    "uncertainty": {
        "torque_setting_percent": 5.0,
        "input_torque_Nm": 0.005,
        "input_torque_gain_percent": 0.2,
        "input_torque_zero_Nm": 0.01,
        "output_torque_gain_percent": 0.2,
        "output_torque_zero_Nm": 0.1,
        "oil_temperature_K": 0.5,
        "model_discrepancy_percent": 0.5,
    },
    "limits": {
        "speed_rpm": [300.0, 3000.0],
        "output_torque_Nm": [0.0, 100.0],
        "oil_temperature_C": [25.0, 80.0],
    },
}


def _lines(name: str, values: dict[str, Any], brackets: tuple[str, str]) -> list[str]:
    rows = [f"{brackets[0]}{name}{brackets[1]}"]
    for key, value in values.items():
        rows.append(f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}")
    return rows


def as_toml(rig: dict[str, Any]) -> str:
    """The rig as the text of a TOML file.

    Examples
    --------
    >>> print(as_toml({"oil": {"density_kg_m3": 1000.0}}), end="")
    [oil]
    density_kg_m3 = 1000.0
    """
    rows: list[str] = []
    for name, value in rig.items():
        if isinstance(value, list):
            for entry in value:
                rows += _lines(name, entry, ("[[", "]]"))
        else:
            rows += _lines(name, value, ("[", "]"))
    return "\n".join(rows) + "\n"
