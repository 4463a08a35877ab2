"""What is written for other programs: excerpts as CSV, WAV, Parquet, TDMS, UFF; results as tables, JSON, UFF."""

from __future__ import annotations

import csv
import json
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from specan import __version__
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.frequency_response import FrequencyResponse
from specan.data.recording import Recording
from specan.data.spectrum import Spectrum
from specan.errors import RequestError, library
from specan.io.output_file import text_file, whole_file
from specan.io.results_text import escaped, harmless, table_lines, word, write_table
from specan.result import RecordingResult, finite, gathered, shortened

if TYPE_CHECKING:
    import pandas as pd

BLOCK = 1 << 16


@dataclass(frozen=True)
class Excerpt:
    """Channels of one sampling rate, from sample `start` to `stop`."""

    recording: Recording
    channels: tuple[Channel, ...]
    start: int
    stop: int

    @property
    def rate(self) -> float:
        """Sampling rate in hertz."""
        return self.channels[0].sampling_rate

    @property
    def n(self) -> int:
        """Number of samples of each channel."""
        return self.stop - self.start

    def blocks(self) -> Iterator[tuple[Real, Real]]:
        """Time in seconds from the beginning of the recording, and samples (channels, n)."""
        first = self.start
        for samples in self.recording.blocks(self.channels, BLOCK, self.start, self.stop):
            yield (first + np.arange(samples.shape[1])) / self.rate, samples
            first += samples.shape[1]


def write_excerpt(excerpt: Excerpt, path: Path, decimal: str = ".") -> None:
    """Write it in the format of the ending, CSV without one; `decimal` is the decimal sign of CSV."""
    writers = {
        ".uff": write_uff, ".unv": write_uff, ".wav": write_wav, ".parquet": write_parquet, ".tdms": write_tdms,
    }  # fmt: skip
    writer = writers.get(path.suffix.lower())
    if writer is None:
        write_csv(excerpt, path, decimal)
    elif decimal != ".":
        raise RequestError(f"--decimal is for CSV, not for {path.suffix}", remedy="leave it out")
    else:
        writer(excerpt, path)


def together(channels: Sequence[Channel]) -> str:
    """Units of several channels in words: ``Pa (Mic 1, Mic 2), V (Generator)``."""
    named = gathered((c.unit, c.label) for c in channels)
    return ", ".join(f"{unit} ({shortened(names)})" for unit, names in named.items())


def write_csv(excerpt: Excerpt, path: Path, decimal: str = ".") -> None:
    """Write time and samples, one column a channel, nine significant digits.

    Parameters
    ----------
    decimal : {".", ","}
        With a comma, as Polish and German spreadsheets expect it, columns are separated by semicolons and
        the file begins with a byte order mark, by which these programs know UTF-8.

    Notes
    -----
    A name that a spreadsheet would take for a formula has an apostrophe before it; see `specan.io.results_text`.

    Raises
    ------
    RequestError
        The decimal sign is another one, or the file cannot be written.
    """
    if decimal not in (".", ","):
        raise RequestError(f"the decimal sign is {decimal!r}", expected="a point or a comma")
    separator = "," if decimal == "." else ";"
    header = ["time_s", *(harmless(f"{c.label} [{c.unit}]") for c in excerpt.channels)]
    row = separator.join(["%.9g"] * len(header)) + "\n"
    encoding = "utf-8" if decimal == "." else "utf-8-sig"
    with whole_file(path) as half, half.open("w", encoding=encoding, newline="") as file:
        csv.writer(file, delimiter=separator, lineterminator="\n").writerow(header)
        for time, samples in excerpt.blocks():
            columns = [time.tolist(), *samples.tolist()]
            text = "".join(row % values for values in zip(*columns, strict=True))
            file.write(text if decimal == "." else text.replace(".", ","))


_LARGEST = 2**32 - 256  # bytes; sizes are 32-bit numbers
_IEEE_FLOAT = 3


def write_wav(excerpt: Excerpt, path: Path) -> None:
    """Write all channels interleaved; 1.0 is 1 Pa, 1 m/s, 1 V.

    Raises
    ------
    RequestError
        The sampling rate is no whole number, or the samples need more than the 4 GB that WAV can hold.
    """
    channels, rate = len(excerpt.channels), excerpt.rate
    if rate != round(rate):
        raise RequestError(
            f"{excerpt.recording.label} is sampled at {rate:.9g} Hz",
            expected="a whole number of hertz for WAV",
            remedy="export to Parquet or CSV",
        )
    size = excerpt.n * channels * 4
    if size > _LARGEST:
        raise RequestError(
            f"{channels} channels of {excerpt.n} samples need {size / 1e9:.1f} GB",
            expected="at most 4.3 GB for WAV",
            remedy="choose fewer channels or a shorter section, or export to Parquet",
        )
    form = struct.pack(
        "<HHIIHH", _IEEE_FLOAT, channels, round(rate), round(rate) * channels * 4, channels * 4, 32
    )
    # Other than PCM wants the size of the extension (none) and a fact chunk with the number of samples.
    chunks = b"fmt " + struct.pack("<I", 18) + form + struct.pack("<H", 0)
    chunks += b"fact" + struct.pack("<II", 4, excerpt.n) + b"data" + struct.pack("<I", size)
    with whole_file(path) as half, half.open("wb") as file:
        file.write(b"RIFF" + struct.pack("<I", 4 + len(chunks) + size) + b"WAVE" + chunks)
        for _, samples in excerpt.blocks():
            file.write(samples.T.astype("<f4").tobytes())


def write_parquet(excerpt: Excerpt, path: Path) -> None:
    """Write time and samples, one column a channel; unit, role and group are in the columns' metadata.

    Raises
    ------
    RequestError
        pyarrow is not installed, or the file cannot be written.
    """
    pyarrow, parquet = library("pyarrow", "parquet"), library("pyarrow.parquet", "parquet")
    fields = [pyarrow.field("time_s", pyarrow.float64(), metadata={"unit": "s"})]
    for channel in excerpt.channels:
        about = {"unit": channel.unit, "role": channel.role, "group": escaped(channel.group)}
        fields.append(pyarrow.field(escaped(channel.label), pyarrow.float64(), metadata=about))
    whole = {
        "writer": f"specan {__version__}",
        "recording": escaped(excerpt.recording.label),
        "sampling_rate_hz": repr(excerpt.rate),
    }
    schema = pyarrow.schema(fields, metadata=whole)
    with whole_file(path) as half, parquet.ParquetWriter(half, schema) as writer:
        for time, samples in excerpt.blocks():
            writer.write_table(pyarrow.table([time, *samples], schema=schema))


def write_tdms(excerpt: Excerpt, path: Path) -> None:
    """Write all channels in double precision, with unit, role and time step as properties; groups are kept."""
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    recording = excerpt.recording
    start = {"wf_increment": 1.0 / excerpt.rate, "wf_start_offset": excerpt.start / excerpt.rate}
    groups = dict.fromkeys(c.group or "Measurement" for c in excerpt.channels)
    about = {"Description": f"specan {__version__}: {recording.label}"}
    heads = [RootObject(about), *map(GroupObject, groups)]
    with whole_file(path) as half, half.open("wb") as file, TdmsWriter(file) as writer:
        for _, samples in excerpt.blocks():
            made = [
                ChannelObject(c.group or "Measurement", c.name, row, {**start, "unit_string": c.unit})
                for c, row in zip(excerpt.channels, samples, strict=True)
            ]
            writer.write_segment([*heads, *made])


# Specific data types of data set 58, record 9, and what a general one is.
_QUANTITIES = {"m": 8, "N": 9, "m/s": 11, "m/s^2": 12, "Pa": 15}
_GENERAL = 1


def write_uff(excerpt: Excerpt, path: Path) -> None:
    """Write one data set 58 a channel: a time response in double precision, binary.

    Raises
    ------
    RequestError
        pyuff is not installed, or the file cannot be written.
    """
    _write_58(path, _responses(excerpt))


def _write_58(path: Path, sets: Iterable[Mapping[str, Any]]) -> None:
    pyuff = library("pyuff", "uff")
    always = {
        "binary": 1, "id4": f"specan {__version__}", "ver_num": 1, "load_case_id": 0, "rsp_dir": 0, "ref_dir": 0,
        "abscissa_spacing": 1, "ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
    }  # fmt: skip
    with whole_file(path) as half:
        # `add` to a file that does not exist yet: in overwrite mode pyuff destroys binary sets.
        file = pyuff.UFF(str(half))
        for one in sets:
            names = {key: str(one[key])[:10].strip() or "NONE" for key in ("rsp_ent_name", "ref_ent_name")}
            try:
                file.write_sets(pyuff.prepare_58(**{**always, **one, **names}), "add")
            except Exception as fault:  # pyuff wraps every error, those of the disk as well
                raise RequestError(f"{path} cannot be written as a universal file ({fault})") from None


def _transfer_functions(found: FrequencyResponse) -> Iterator[Mapping[str, Any]]:
    below = found.reference_unit
    common = {
        "id3": f"{found.estimator}, {found.n_blocks} blocks",
        "ref_ent_name": found.reference,
        "ref_node": len(found.channels) + 1,
    }
    for row, unit in enumerate(found.units):
        units = _unit("ordinate", _above(unit, below)) | _unit("orddenom", below)
        yield _over_frequency(found, row, found.response[row], 4, **common, **units)
        if np.all(np.isfinite(found.coherence[row])):
            yield _over_frequency(found, row, found.coherence[row], 6, **common)


def _densities(found: Spectrum) -> Iterator[Mapping[str, Any]]:
    scale = found.scale
    if scale.scaling != "psd":
        raise RequestError(
            f"a universal file holds no spectrum of {scale.scaling}",
            expected="a power spectral density",
            remedy="add --scaling psd, or write .csv",
        )
    about = f"psd, window {scale.window}, {scale.enbw_hz:.6g} Hz wide"
    for row, unit in enumerate(found.value_units):
        yield _over_frequency(found, row, found.values[row], 9, id3=about, **_unit("ordinate", unit))


def _over_frequency(
    found: FrequencyResponse | Spectrum, row: int, data: Any, kind: int, **more: Any
) -> dict[str, Any]:
    f = found.frequency_hz
    step = float(f[1] - f[0]) if f.size > 1 else 0.0
    names = {"id1": found.channels[row][:80], "rsp_ent_name": found.channels[row], "rsp_node": row + 1}
    return _data_set(data, f, step, (kind, 18, "Hz"), id2=found.label[-80:], **names, **more)


def _responses(excerpt: Excerpt) -> Iterator[Mapping[str, Any]]:
    x = (excerpt.start + np.arange(excerpt.n)) / excerpt.rate
    for row, channel in enumerate(excerpt.channels):
        samples = excerpt.recording.read([channel], excerpt.start, excerpt.stop)[0]
        names = {"id1": channel.label[:80], "rsp_ent_name": channel.label, "rsp_node": row + 1}
        more = names | _unit("ordinate", channel.unit) | {"id3": f"role {channel.role}"}
        yield _data_set(
            samples, x, 1.0 / excerpt.rate, (1, 17, "s"), id2=excerpt.recording.label[-80:], **more
        )


def _data_set(data: Any, x: Real, step: float, kinds: tuple[int, int, str], **more: Any) -> dict[str, Any]:
    """Numbers in double precision over an axis; the types of the function and of the axis, and its unit."""
    return {
        "func_type": kinds[0],
        "ref_ent_name": "NONE",
        "ref_node": 0,
        "abscissa_min": float(x[0]),
        "abscissa_inc": step,
        "num_pts": x.size,
        "abscissa_spec_data_type": kinds[1],
        "abscissa_axis_units_lab": kinds[2],
        "x": x,
        "ord_data_type": 6 if np.iscomplexobj(data) else 4,
        "data": data,
        **more,
    }


def _unit(axis: str, unit: str) -> dict[str, Any]:
    return {f"{axis}_spec_data_type": _QUANTITIES.get(unit, _GENERAL), f"{axis}_axis_units_lab": unit}


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


def _write_json(content: Mapping[str, Any], path: Path) -> None:
    with text_file(path) as file:
        json.dump({"written_by": f"specan {__version__}", **content}, file, indent=2, ensure_ascii=False)
        file.write("\n")


def write_frame(frame: pd.DataFrame, path: Path, header: Sequence[str], decimal: str = ".") -> None:
    """Write a data frame as a table; the header says what it is."""
    if path.suffix.lower() == ".json":
        _write_json({"rows": finite(frame.to_dict("records"))}, path)
        return
    columns = {
        n: list(map(word, v)) if v.dtype.kind in "OUT" else v.to_numpy(float) for n, v in frame.items()
    }
    whole = [f"specan {__version__}", *header]
    write_table(path, whole, list(columns), [table_lines(columns)], decimal)


_PIECE = 1 << 15  # rows at once: as text they are ten times as large


def _pieces(columns: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    count = next(len(values) for values in columns.values() if not np.isscalar(values))
    for first in range(0, count, _PIECE):
        rows = slice(first, first + _PIECE)
        yield {name: v if np.isscalar(v) else v[rows] for name, v in columns.items()}


def write_result(
    found: RecordingResult, path: Path, tables: Iterable[Mapping[str, Any]] = (), decimal: str = "."
) -> None:
    """Write a result: ``.json``, ``.uff``, or a table.

    Parameters
    ----------
    found : RecordingResult
        What a verb has found.
    path : Path
        ``.json`` holds what ``--json`` prints, ``.uff`` and ``.unv`` functions of frequency; every other ending is that
        of a table (`specan.io.results_text.write_table`). Its header says which verb made it, and ends with its
        settings, calibration and notes.
    tables : iterable of mapping
        Tables in place of those of the result: named columns as `table_lines` takes them, one set after the other.
    decimal : {".", ","}
        Decimal sign of a table that is text.
    """
    ending = path.suffix.lower()
    if ending == ".json":
        _write_json(found.to_dict(), path)
        return
    if ending in (".uff", ".unv") and isinstance(found, (FrequencyResponse, Spectrum)):
        _write_58(path, _densities(found) if isinstance(found, Spectrum) else _transfer_functions(found))
        return
    settings = dict(found.settings)
    said = settings.pop("calibration", None)
    stated = [f"settings: {json.dumps(finite(settings))}", *([f"calibration: {said}"] if said else [])]
    header = [f"specan {__version__} {found.verb}", *found.about(), *stated]
    parts = iter(tables or found.tables())
    first = next(parts)
    lines = (table_lines(piece) for part in chain([first], parts) for piece in _pieces(part))
    write_table(path, [*header, *found.notes], list(first), lines, decimal)
