"""Results of single files on disk, and how a file is known again, so that a batch can be resumed."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import specan
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.settings import BatchSettings
from specan.data.tone import ToneTable
from specan.errors import RequestError, SpecanError
from specan.io.open import channel_table_of
from specan.io.output_file import remove_parts, text_file
from specan.result import picked

# What results are computed by; the rest of the package only shows them.
_COMPUTING = ("data", "dsp", "io", "analysis")


@lru_cache(maxsize=1)
def program_identity() -> str:
    """Version of specan with a hash of its source, and of the libraries that compute.

    Results of another program are not mixed with those of this one, not even of one that only a developer has
    changed.
    """
    import scipy

    place = Path(specan.__file__).parent
    sources = [*place.glob("*.py"), *(path for part in _COMPUTING for path in (place / part).rglob("*.py"))]
    digest = hashlib.sha256()
    for path in sorted(sources, key=lambda path: path.relative_to(place).as_posix()):
        digest.update(path.relative_to(place).as_posix().encode() + b"\0")
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return f"specan {specan.__version__} ({digest.hexdigest()[:12]}), numpy {np.__version__}, scipy {scipy.__version__}"


_SCHEMA, _SUFFIX = 7, ".result"


@dataclass(frozen=True)
class Kept(FileResult):
    """A result that is in the store, without its lines; see `lines`.

    Attributes
    ----------
    path : Path
    places : mapping of str to (int, int)
        First byte and number of bytes of the lines of each table.
    rows : mapping of str to int
        Number of lines of each table.
    """

    path: Path = Path()
    places: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    rows: Mapping[str, int] = field(default_factory=dict)

    def lines(self, table: str) -> str:
        """Lines of one table."""
        start, size = self.places[table]
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(size).decode("utf-8")


class Store:
    """A directory with one file for each result, named by what it was made from: a line of JSON, then lines of tables.

    A result is written beside its place and put there as a whole: what is in the store is complete.

    Parameters
    ----------
    place : Path
        Made if it does not exist; what an interrupted write has left there is removed.
    """

    def __init__(self, place: Path) -> None:
        self.place = place
        try:
            place.mkdir(exist_ok=True)
            remove_parts(place)
        except OSError as fault:
            raise RequestError(f"{place} cannot be used ({fault.strerror})", remedy="remove it") from None

    def find(self, key: str) -> Kept | None:
        """The result that was made from this; None where there is none, or a damaged one."""
        path = self._path(key)
        try:
            with path.open("rb") as file:
                head = file.readline()
                found = json.loads(head)
                places, end = {}, len(head)
                for table, size in found["lines"].items():
                    places[table] = (end, size)
                    end += size
                if zlib.crc32(file.read()) != found["checksum"] or file.tell() != end:
                    return None
                tones = tuple(map(_tone, found["tones"]))
                about, aside = _tuples(found["about"]), _tuples(found["set_aside"])
                said = found["label"], found["kind"], found["reason"]
                return Kept(*said, about, {}, tones, aside, path, places, found["rows"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def put(self, result: FileResult, key: str) -> Kept:
        """Keep a result; it is read back, so that a new result and a kept one are the same to whoever asks.

        Raises
        ------
        RequestError
            There is no room, or the store cannot be written to.
        """
        encoded = {table: lines.encode() for table, lines in result.blocks.items()}
        head = {
            **picked(result, "label kind reason about set_aside"),
            "tones": [vars(tone) for tone in result.tones],
            "checksum": zlib.crc32(b"".join(encoded.values())),
            "lines": {table: len(lines) for table, lines in encoded.items()},
            "rows": {table: lines.count(b"\n") for table, lines in encoded.items()},
        }
        try:
            # Not waited for: what a power cut has left half written does not have its checksum, and is made again.
            with text_file(self._path(key), durable=False) as file:
                file.write(json.dumps(head, default=np.ndarray.tolist) + "\n")
                file.writelines(result.blocks.values())
        except RequestError as fault:
            raise RequestError(
                f"the result of {result.label} cannot be kept: {fault.found}",
                expected="space in the output directory",
                remedy="free some space and repeat the command; finished results are kept",
            ) from None
        kept = self.find(key)
        assert kept is not None
        return kept

    def keep_only(self, keys: Iterable[str]) -> None:
        """Remove all other results."""
        wanted = set(map(self._path, keys))
        for path in self.place.glob(f"*{_SUFFIX}"):
            if path not in wanted:
                path.unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        return self.place / f"{key}{_SUFFIX}"


def _tone(found: Mapping[str, Any]) -> ToneTable:
    """A tone table from JSON, whose numbers keep every digit."""
    arrays = {each.name for each in fields(ToneTable) if each.type == "Real"}
    known: dict[str, Any] = {
        name: np.array(v, dtype=float) if name in arrays else _tuples(v) for name, v in found.items()
    }
    return ToneTable(**known)


def _tuples(value: Any) -> Any:
    """Lists of JSON as the tuples that they were."""
    if isinstance(value, dict):
        return {key: _tuples(entry) for key, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def keys_of(settings: BatchSettings) -> Callable[[Input], str]:
    """A function that names what the result of a file is made from.

    That is the recording, known by its label, size and time, the program and the settings, the calibration, the channel
    table, and the index file that may be told to belong to another recording.
    """
    common = f"{_SCHEMA}\n{program_identity()}\n{settings.as_json()}"

    @cache
    def digest_of(path: str) -> str:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()

    def key(entry: Input) -> str:
        parts = [common, entry.label, str(state_of(entry.path))]
        parts.append(digest_of(entry.calibration) if entry.calibration else "none")
        try:
            table = entry.channel_table or channel_table_of(Path(entry.path), Path(entry.root))
            index = Path(entry.path + "_index")
            parts += [digest_of(str(table)) if table else "none"]
            parts += [hashlib.sha256(index.read_bytes()).hexdigest() if index.is_file() else "none"]
        except (SpecanError, OSError) as fault:
            parts.append(str(fault))  # the analysis fails on it as well, and a failure is not kept
        return hashlib.sha256("\n".join(parts).encode("utf-8", "surrogatepass")).hexdigest()[:32]

    return key


def state_of(path: str) -> tuple[int, int] | None:
    """Size and time of a file; None where there is none."""
    try:
        now = os.stat(path)
    except OSError:
        return None
    return now.st_size, now.st_mtime_ns
