"""Write samples as TDMS, the way a National Instruments acquisition program does: one segment a second."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

RANGE_V = 10.0  # input range of the converter cards (NI PXI-4472B)
VOLTS_PER_COUNT = RANGE_V / 2**23  # 24 bit
STARTED = datetime.datetime(2012, 3, 14, 9, 30)  # a fixed time, so that equal samples give equal bytes

Volts = NDArray[np.floating]
_LINEAR_SCALE = {
    "NI_Scaling_Status": "unscaled",
    "NI_Number_Of_Scales": np.uint32(1),
    "NI_Scale[0]_Scale_Type": "Linear",
    "NI_Scale[0]_Linear_Slope": VOLTS_PER_COUNT,
    "NI_Scale[0]_Linear_Y_Intercept": 0.0,
    "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),  # the raw samples
}


def write_tdms(
    path: Path,
    names: Sequence[str],
    volts: Volts,
    sampling_rate: float,
    *,
    channels: Sequence[Mapping[str, object]],
    group: Mapping[str, object],
    samples: Literal["int32", "float32"] = "int32",
) -> None:
    """Write channels of voltage into one TDMS file.

    Parameters
    ----------
    path : Path
        The file; its directory is made where it is missing.
    names : sequence of str
        Names of the channels.
    volts : array (channels, samples)
        Voltages at the converter, V.
    sampling_rate : float
        Samples a second, Hz.
    channels : sequence of mapping
        Further properties of each channel, such as ``QuantityUnit``, ``Sensitivity`` and ``SensitivityUnit``.
    group : mapping
        Properties of the group, such as ``Excitation`` and ``Description``.
    samples : {"int32", "float32"}
        Integers of 24 bits that the file's own linear scale turns into volts, or volts as they are.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    name, block = "Measurement", int(sampling_rate)
    counts = samples == "int32"
    described = [
        {
            "wf_start_time": STARTED,
            "wf_start_offset": 0.0,
            "wf_increment": 1.0 / sampling_rate,
            "wf_samples": block,  # the size of one write, as LabVIEW leaves it
            "NI_ChannelName": channel,
            "unit_string": "V",
            **(_LINEAR_SCALE if counts else {}),
            **given,
        }
        for channel, given in zip(names, channels, strict=True)
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    with TdmsWriter(str(path)) as writer:
        for start in range(0, volts.shape[1], block):
            part: NDArray[np.generic] = volts[:, start : start + block].astype(np.float32)
            if counts:
                exact = np.rint(volts[:, start : start + block] / VOLTS_PER_COUNT)
                part = np.clip(exact, -(2**23), 2**23 - 1).astype(np.int32)
            objects = [
                ChannelObject(name, channel, row, {} if start else about)
                for channel, row, about in zip(names, part, described, strict=True)
            ]
            # A file that gets its name when it is finished is hidden until then.
            file = {} if path.name.startswith(".") else {"name": path.stem}
            head = [] if start else [RootObject(file), GroupObject(name, dict(group))]
            writer.write_segment([*head, *objects])
