"""Simulated recordings as the laboratory's acquisition program would have written them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from specan.io.write_tdms import write_tdms as write_channels
from truth.rig import Rig, Take


def write_tdms(
    path: Path,
    rig: Rig,
    take: Take,
    *,
    description: str = "",
    samples: Literal["int32", "float32"] = "int32",
    with_excitation: bool = True,
) -> None:
    """Write a take as TDMS, with the properties that the acquisition program leaves.

    Parameters
    ----------
    samples : {"int32", "float32"}
        Integers that the file's own scale turns into volts, or volts as they are.
    with_excitation : bool
        Whether the group says what excitation was on; without, it has to be found in the signal.
    """
    group = {**(take.properties if with_excitation else {}), "SamplingRate": take.sampling_rate}
    if description:
        group["Description"] = description
    write_channels(
        path,
        take.names,
        take.volts,
        take.sampling_rate,
        channels=[_sensor(rig, name) for name in take.names],
        group=group,
        samples=samples,
    )


def _sensor(rig: Rig, name: str) -> dict[str, object]:
    if name.startswith("Mic"):
        number = int(name.split()[1])
        return {
            "QuantityUnit": "Pa",
            "Sensitivity": 1000 * rig.nominal_V_per_Pa,
            "SensitivityUnit": "mV/Pa",
            "Sensor": "1/4 inch array microphone",
            "Module": f"PXI-4472B {(number - 1) // 8 + 1}",
        }
    if name == "Vibrometer":
        return {
            "QuantityUnit": "m/s",
            "Sensitivity": rig.vibrometer_m_s_per_V,
            "SensitivityUnit": "(m/s)/V",
            "Sensor": "laser vibrometer",
            "Module": "PXI-4461",
        }
    return {"QuantityUnit": "V", "Module": "PXI-4461"}
