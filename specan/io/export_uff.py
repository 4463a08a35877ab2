"""Samples and transfer functions as universal file, data set 58, for modal analysis programs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from specan import __version__
from specan.data.channel import Channel
from specan.data.frequency_response import FrequencyResponse
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
    named = enumerate(zip(excerpt.names(), excerpt.channels, strict=True), 1)
    _write(
        pyuff, path, (_data_set(pyuff, excerpt, number, name, channel) for number, (name, channel) in named)
    )


def write_uff_transfer(found: FrequencyResponse, path: Path) -> None:
    """Write a data set 58 of function type 4 for each response, and one of its coherence (type 6); binary.

    Response and reference are named as entities; responses are nodes 1, 2, ... in their order, the reference is
    the node behind them.

    Raises
    ------
    RequestError
        pyuff is not installed, or the file cannot be written.
    """
    pyuff = library("pyuff", "uff")
    _write(pyuff, path, _transfer_sets(pyuff, found))


def _write(pyuff: Any, path: Path, sets: Iterable[Any]) -> None:
    with whole_file(path) as half:
        # `add` to a file that does not exist yet: in overwrite mode pyuff destroys binary sets.
        file = pyuff.UFF(str(half))
        for one in sets:
            try:
                file.write_sets(one, "add")
            except Exception as fault:  # pyuff wraps every error, those of the disk as well
                raise RequestError(f"{path} cannot be written as a universal file ({fault})") from None


def _transfer_sets(pyuff: Any, found: FrequencyResponse) -> Iterator[Any]:
    f, below = found.frequency_hz, found.reference_unit
    for row, name in enumerate(found.channels):
        above = _above(found.units[row], below)
        common = {
            "binary": 1,
            "id1": name[:80],
            "id2": found.label[-80:],
            "id3": f"{found.estimator}, {found.n_blocks} blocks",
            "id4": f"specan {__version__}",
            "ver_num": 1,
            "load_case_id": 0,
            "rsp_ent_name": name[:10].strip() or "NONE",
            "rsp_node": row + 1,
            "rsp_dir": 0,
            "ref_ent_name": found.reference[:10].strip() or "NONE",
            "ref_node": len(found.channels) + 1,
            "ref_dir": 0,
            "abscissa_spacing": 1,
            "abscissa_min": float(f[0]),
            "abscissa_inc": float(f[1] - f[0]) if f.size > 1 else 0.0,
            "num_pts": f.size,
            "abscissa_spec_data_type": 18,
            "abscissa_axis_units_lab": "Hz",
            "z_axis_spec_data_type": 0,
            "x": f,
        }
        yield pyuff.prepare_58(
            func_type=4,
            ord_data_type=6,  # complex, double precision
            ordinate_spec_data_type=_QUANTITIES.get(above, _GENERAL),
            ordinate_axis_units_lab=above,
            orddenom_spec_data_type=_QUANTITIES.get(below, _GENERAL),
            orddenom_axis_units_lab=below,
            data=found.response[row],
            **common,
        )
        if np.all(np.isfinite(found.coherence[row])):
            yield pyuff.prepare_58(
                func_type=6,
                ord_data_type=4,
                ordinate_spec_data_type=0,
                orddenom_spec_data_type=0,
                data=found.coherence[row],
                **common,
            )


def _above(unit: str, below: str) -> str:
    """Unit of the response of a transfer function, whose reference has the unit `below`.

    Examples
    --------
    >>> _above("Pa/(m/s)", "m/s"), _above("m/N", "N"), _above("1", "Pa")
    ('Pa', 'm', 'Pa')
    """
    if unit == "1":
        return below
    return unit.removesuffix(f"/({below})").removesuffix(f"/{below}")


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
