"""Results of single files on disk, and how a file is known again, so that a batch can be resumed."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
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
from specan.io.tdms_headers import metadata_of
from specan.result import picked

BLOCK, BLOCKS = 1 << 16, 64
# What results are computed by; the rest of the package only shows them.
_COMPUTING = ("data", "dsp", "io", "analysis")


@dataclass(frozen=True)
class Identity:
    """A file at one moment.

    Attributes
    ----------
    size, mtime_ns : int
        Bytes, and the time of its last change.
    digest : str
        SHA-256 of the size, of the metadata and of 64 blocks of 64 KiB that are spread over the file.
    whole : str
        SHA-256 of all bytes; empty where that was not asked for.
    """

    size: int
    mtime_ns: int
    digest: str
    whole: str = ""

    def untouched(self, path: str) -> bool:
        """Whether size and time are still the same; a file that is gone is not."""
        try:
            now = os.stat(path)
        except OSError:
            return False
        return (now.st_size, now.st_mtime_ns) == (self.size, self.mtime_ns)


def identify(path: str, *, whole: bool = False) -> Identity:
    """What a file is now.

    Raises
    ------
    OSError
        It cannot be read.
    """
    now = os.stat(path)
    if not stat.S_ISREG(now.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", path)  # a pipe would be waited for
    return Identity(
        now.st_size, now.st_mtime_ns, _spread_digest(path, now.st_size), _whole(path) if whole else ""
    )


def _spread_digest(path: str, size: int) -> str:
    digest = hashlib.sha256(str(size).encode())
    for part in metadata_of(Path(path)):
        digest.update(part)
    with open(path, "rb", buffering=0) as file:
        for start in _starts(size):
            file.seek(start)
            digest.update(file.read(BLOCK))
    return digest.hexdigest()


def _starts(size: int) -> Iterable[int]:
    """Beginnings of the blocks: without a gap in a small file, else evenly from the first to the last byte."""
    if size <= BLOCK * BLOCKS:
        return range(0, size, BLOCK)
    return [(size - BLOCK) * number // (BLOCKS - 1) for number in range(BLOCKS)]


def _whole(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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


_SCHEMA, _SUFFIX = 6, ".result"


@dataclass(frozen=True)
class Kept:
    """A result that is in the store.

    Attributes
    ----------
    result : FileResult
        Without its lines; see `lines`.
    identity : Identity
        Of the recording that it was made from.
    context : str
        What else it was made from: settings, calibration, program.
    path : Path
    places : mapping of str to (int, int)
        First byte and number of bytes of the lines of each table.
    rows : mapping of str to int
        Number of lines of each table.
    """

    result: FileResult
    identity: Identity
    context: str
    path: Path
    places: Mapping[str, tuple[int, int]]
    rows: Mapping[str, int]

    def lines(self, table: str) -> str:
        """Lines of one table."""
        start, size = self.places[table]
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(size).decode("utf-8")


class Store:
    """A directory with one file for each result: one line of JSON, then the lines of the tables.

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

    def find(self, label: str) -> Kept | None:
        """The result of a file; None where there is none, or none that this version can read."""
        path = self._path(label)
        try:
            with path.open("rb") as file:
                head = file.readline()
                found = json.loads(head)
                if found["schema"] != _SCHEMA or found["label"] != label:
                    return None
                places, end = {}, len(head)
                for table, size in found["lines"].items():
                    places[table] = (end, size)
                    end += size
                if zlib.crc32(file.read()) != found["checksum"] or file.tell() != end:
                    return None
                tones = tuple(map(_tone, found["tones"]))
                about, aside = _tuples(found["about"]), _tuples(found["set_aside"])
                result = FileResult(label, found["kind"], found["reason"], about, {}, tones, aside)
                identity = Identity(**found["identity"])
                return Kept(result, identity, found["context"], path, places, found["rows"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def put(self, result: FileResult, identity: Identity, context: str) -> Kept:
        """Keep a result; it is read back, so that a new result and a kept one are the same to whoever asks.

        Raises
        ------
        RequestError
            There is no room, or the store cannot be written to.
        """
        encoded = {table: lines.encode() for table, lines in result.blocks.items()}
        head = {
            "schema": _SCHEMA,
            **picked(result, "label kind reason about set_aside"),
            "context": context,
            "identity": asdict(identity),
            "tones": [vars(tone) for tone in result.tones],
            "checksum": zlib.crc32(b"".join(encoded.values())),
            "lines": {table: len(lines) for table, lines in encoded.items()},
            "rows": {table: lines.count(b"\n") for table, lines in encoded.items()},
        }
        try:
            # Not waited for: what a power cut has left half written does not have its checksum, and is made again.
            with text_file(self._path(result.label), durable=False) as file:
                file.write(json.dumps(head, default=np.ndarray.tolist) + "\n")
                file.writelines(result.blocks.values())
        except RequestError as fault:
            raise RequestError(
                f"the result of {result.label} cannot be kept: {fault.found}",
                expected="space in the output directory",
                remedy="free some space and repeat the command; finished results are kept",
            ) from None
        kept = self.find(result.label)
        assert kept is not None
        return kept

    def keep_only(self, labels: Iterable[str]) -> None:
        """Remove the results of all other files."""
        wanted = {self._path(label).name for label in labels}
        for path in self.place.glob(f"*{_SUFFIX}"):
            if path.name not in wanted:
                path.unlink(missing_ok=True)

    def _path(self, label: str) -> Path:
        return self.place / (
            hashlib.sha256(label.encode("utf-8", "surrogatepass")).hexdigest()[:32] + _SUFFIX
        )


def _tone(found: Mapping[str, Any]) -> ToneTable:
    """A tone table from JSON, whose numbers keep every digit."""
    arrays = {field.name for field in fields(ToneTable) if field.type == "Real"}
    known: dict[str, Any] = {
        name: np.array(v, dtype=float) if name in arrays else _tuples(v) for name, v in found.items()
    }
    return ToneTable(**known)


def _tuples(value: Any) -> Any:
    """Lists of JSON as the tuples that they were."""
    if isinstance(value, dict):
        return {key: _tuples(entry) for key, entry in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def unchanged(entry: Input, store: Store, *, verify: bool) -> Kept | None:
    """The kept result of a file that is still what it was; None where there is none.

    Size and time unchanged: the same file. Else metadata and spread blocks decide; with `verify` all
    bytes do, and a result that was kept without their hash does not hold.
    """
    kept = store.find(entry.label)
    if kept is None:
        return None
    if kept.identity.untouched(entry.path) and not verify:
        return kept
    if verify and not kept.identity.whole:
        return None
    try:
        now = identify(entry.path, whole=verify)
    except Exception:  # the analysis says why
        return None
    before = kept.identity
    if (now.size, now.digest) != (before.size, before.digest) or (verify and now.whole != before.whole):
        return None
    if now.mtime_ns != before.mtime_ns:
        blocks = {table: kept.lines(table) for table in kept.places}
        same = replace(kept.result, blocks=blocks)
        kept = store.put(same, replace(now, whole=before.whole), kept.context)
    return kept


def context_of(settings: BatchSettings) -> Callable[[Input], str]:
    """A function that says of what else than the recording the result of a file is made.

    That is the program and the settings, the calibration, the channel table, and the index file that may be told to
    belong to another recording.
    """
    common = f"{program_identity()}\n{settings.as_json()}"

    @cache
    def digest_of(path: str) -> str:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()

    def context(entry: Input) -> str:
        parts = [common, digest_of(entry.calibration) if entry.calibration else "none"]
        try:
            table = entry.channel_table or channel_table_of(Path(entry.path), Path(entry.root))
            index = Path(entry.path + "_index")
            parts += [digest_of(str(table)) if table else "none"]
            parts += [hashlib.sha256(index.read_bytes()).hexdigest() if index.is_file() else "none"]
        except (SpecanError, OSError) as fault:
            parts.append(str(fault))  # the analysis fails on it as well, and a failure is not kept
        return hashlib.sha256("\n".join(parts).encode("utf-8", "surrogatepass")).hexdigest()

    return context
