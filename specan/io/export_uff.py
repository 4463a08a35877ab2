"""Samples as universal file, data set 58, for modal analysis programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from specan import __version__
from specan.data.recording import Channel
from specan.errors import RequestError
from specan.io.export_file import Excerpt, library
from specan.io.output_file import whole_file

# Specific data types of data set 58, record 9, and what a general one is.
_QUANTITIES = {"m": 8, "N": 9, "m/s": 11, "m/s^2": 12, "Pa": 15}
_GENERAL = 1


def write_uff(excerpt: Excerpt, path: Path) -> None:
    """Write one data set 58 a channel: a time response in double precision, binary.

    The format gives the time step six digits: at 51.2 kHz time is 0.0002 % off, samples are not.

    Raises
    ------
    RequestError
        pyuff is not installed, or the file cannot be written.
    """
    pyuff = library("pyuff", "uff")
    with whole_file(path) as half:
        # `add` to a file that does not exist yet: in overwrite mode pyuff destroys binary sets.
        file = pyuff.UFF(str(half))
        for number, (name, channel) in enumerate(zip(excerpt.names(), excerpt.channels, strict=True), 1):
            try:
                file.write_sets(_data_set(pyuff, excerpt, number, name, channel), "add")
            except Exception as fault:  # pyuff wraps every error, those of the disk as well
                raise RequestError(f"{path} cannot be written as a universal file ({fault})") from None


def _data_set(pyuff: Any, excerpt: Excerpt, number: int, name: str, channel: Channel) -> Any:
    samples = excerpt.recording.read([channel], excerpt.start, excerpt.stop)[0]
    return pyuff.prepare_58(
        binary=1,
        id1=name[:80],
        id2=excerpt.recording.label[-80:],
        id3=f"role {channel.role}",
        id4=f"specan {__version__}",
        func_type=1,  # time response
        ver_num=1,
        load_case_id=0,
        rsp_ent_name=name[:10].strip() or "NONE",
        rsp_node=number,
        rsp_dir=0,
        ref_ent_name="NONE",
        ref_node=0,
        ref_dir=0,
        ord_data_type=4,  # real, double precision
        abscissa_spacing=1,
        abscissa_min=excerpt.start / excerpt.rate,
        abscissa_inc=1.0 / excerpt.rate,
        num_pts=excerpt.n,
        abscissa_spec_data_type=17,
        abscissa_axis_units_lab="s",
        ordinate_spec_data_type=_QUANTITIES.get(channel.unit, _GENERAL),
        ordinate_axis_units_lab=channel.unit,
        orddenom_spec_data_type=0,  # a response has none
        z_axis_spec_data_type=0,
        data=samples,
        x=(excerpt.start + np.arange(excerpt.n)) / excerpt.rate,
    )
