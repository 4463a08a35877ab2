"""Simulated recordings as the laboratory's acquisition program would have written them."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specan.testing.rig import Rig, Take

RANGE_V = 10.0  # input range of the converter cards (NI PXI-4472B)
VOLTS_PER_COUNT = RANGE_V / 2**23  # 24 bit
STARTED = datetime.datetime(2012, 3, 14, 9, 30)


def write_tdms(
    path: Path,
    rig: Rig,
    take: Take,
    *,
    description: str = "",
    samples: Literal["int32", "float32"] = "int32",
    with_excitation: bool = True,
) -> None:
    """Write a take as TDMS: one segment a second, samples as 24-bit integers with a linear NI scale.

    Parameters
    ----------
    samples : {"int32", "float32"}
        Integers that the file's own scale turns into volts, or volts as they are.
    with_excitation : bool
        Whether the group says what excitation was on; without, it has to be found in the signal.
    """
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    group = "Measurement"
    properties = {**(take.properties if with_excitation else {}), "SamplingRate": take.sampling_rate}
    if description:
        properties["Description"] = description
    block = int(take.sampling_rate)
    described = [_channel_properties(rig, take, name, samples, block) for name in take.names]
    path.parent.mkdir(parents=True, exist_ok=True)
    with TdmsWriter(str(path)) as writer:
        for first, part in _segments(take.volts, block):
            objects = [
                ChannelObject(group, name, _encode(row, samples), described[i] if first else {})
                for i, (name, row) in enumerate(zip(take.names, part, strict=True))
            ]
            head = [RootObject({"name": path.stem}), GroupObject(group, properties)] if first else []
            writer.write_segment([*head, *objects])


def _segments(volts: NDArray[np.floating], block: int) -> Iterator[tuple[bool, NDArray[np.floating]]]:
    for start in range(0, volts.shape[1], block):
        yield start == 0, volts[:, start : start + block]


def _encode(volts: NDArray[np.floating], samples: str) -> NDArray[np.int32] | NDArray[np.float32]:
    if samples == "float32":
        return volts.astype(np.float32)
    top = 2**23
    return np.clip(np.rint(volts / VOLTS_PER_COUNT), -top, top - 1).astype(np.int32)


def _channel_properties(rig: Rig, take: Take, name: str, samples: str, block: int) -> dict[str, object]:
    """Properties of one channel; `wf_samples` is the size of one write, as LabVIEW leaves it."""
    properties: dict[str, object] = {
        "wf_start_time": STARTED,
        "wf_start_offset": 0.0,
        "wf_increment": 1.0 / take.sampling_rate,
        "wf_samples": block,
        "NI_ChannelName": name,
        "unit_string": "V",
    }
    if samples == "int32":
        properties |= {
            "NI_Scaling_Status": "unscaled",
            "NI_Number_Of_Scales": np.uint32(1),
            "NI_Scale[0]_Scale_Type": "Linear",
            "NI_Scale[0]_Linear_Slope": VOLTS_PER_COUNT,
            "NI_Scale[0]_Linear_Y_Intercept": 0.0,
            "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),  # the raw samples
        }
    if name.startswith("Mic"):
        number = int(name.split()[1])
        return properties | {
            "QuantityUnit": "Pa",
            "Sensitivity": 1000 * rig.nominal_V_per_Pa,
            "SensitivityUnit": "mV/Pa",
            "Sensor": "1/4 inch array microphone",
            "Module": f"PXI-4472B {(number - 1) // 8 + 1}",
        }
    if name == "Vibrometer":
        return properties | {
            "QuantityUnit": "m/s",
            "Sensitivity": rig.vibrometer_m_s_per_V,
            "SensitivityUnit": "(m/s)/V",
            "Sensor": "laser vibrometer",
            "Module": "PXI-4461",
        }
    return properties | {"QuantityUnit": "V", "Module": "PXI-4461"}
