"""A recording as TDMS: volts with sensitivities beside them, one segment a second."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError

STARTED = datetime.datetime(2012, 3, 14, 9, 30)  # no clock time: the same content gives the same bytes


def write_tdms(
    path: Path,
    sampling_rate: float,
    channels: Sequence[tuple[str, NDArray[np.floating], Mapping[str, object]]],
    properties: Mapping[str, object],
) -> None:
    """Write channels of one rate as float32.

    Parameters
    ----------
    path : Path
    sampling_rate : float
    channels : sequence of (name, samples, properties)
        Samples as the converter gave them, in the unit that the property ``unit_string`` names.
    properties : mapping
        Of the group.

    Raises
    ------
    RequestError
        The file cannot be written.
    """
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    block = max(1, int(sampling_rate))
    length = len(channels[0][1])
    common = {
        "wf_start_time": STARTED,
        "wf_start_offset": 0.0,
        "wf_increment": 1.0 / sampling_rate,
        "wf_samples": block,
    }
    try:
        with TdmsWriter(str(path)) as writer:
            for start in range(0, length, block):
                objects = [
                    ChannelObject(
                        "Measurement",
                        name,
                        np.asarray(samples[start : start + block], dtype=np.float32),
                        {**common, "NI_ChannelName": name, **own} if start == 0 else {},
                    )
                    for name, samples, own in channels
                ]
                head = [RootObject({"name": path.stem}), GroupObject("Measurement", dict(properties))]
                writer.write_segment([*(head if start == 0 else []), *objects])
    except OSError as fault:
        raise RequestError(
            f"the recording {path} cannot be written ({fault.strerror})", remedy="name another place"
        ) from None
