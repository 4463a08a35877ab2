"""What a study keeps: its steps, and its fits and diagnoses.

Steps are one line of JSON each, only ever appended to, with the diagnosis that led to them. Fits and diagnoses are kept
by the hash of everything that they depend on: the study, its data, its own files, the last step, and the programs that
computed them. What is damaged, or of another state, is as if it were not there. See
docs/decisions/study_data.md.

Study file and history are replaced together, by one process at a time. What is to be written is first kept whole in a
file of its own. A process that ends in the middle leaves that file behind, and whoever opens the study next finishes
the change. So a study is always as it was before a change or as it is after it.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import to_json
from typing_extensions import TypedDict  # of pydantic, which takes no other before Python 3.12

import specan
from specan.errors import RequestError
from specan.io.output_file import locked, text_file
from specan.models.catalogue import ENTRY_POINTS, MODEL_ENTRY_POINTS
from specan.result import Result, counted, finite
from specan.study.study_file import NAME as STUDY_FILE

NAME = "history.jsonl"

LOCK = ".lock"
PENDING = ".pending.json"

FOLDER = ".kept"
MOST_FILES = 12  # the oldest go
_ARRAY = "float64 array"
Kept = TypeVar("Kept")


class _Error(TypedDict):
    value: float
    unit: str
    metric: str


class _OfObservable(TypedDict):
    observable: str
    rms: float
    unit: str
    n: int


class _Parameter(TypedDict):
    value: float


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes
    ----------
    action : str
        ``new``, ``add``, ``drop``, ``edit`` (the study file or the rig was changed by hand) or ``data``
        (changed data were accepted).
    because : str
        The user's reason.
    model_effects : tuple of str
        Effects of the model after the step, nuisances left out.
    fit_error, held_out_error : mapping or None
        ``{"value", "unit", "metric"}``.
    errors : mapping
        The same for every observable: ``{"fit": [...], "held_out": [...]}``.
    parameters : mapping
        ``{"effect.parameter": {"value", "low", "high", "unit"}}``.
    about : mapping
        SI values about which covariances were taken, where they depend on values.
    hashes : mapping
        Of the study's content, the rig, every file.
    diagnosis : mapping or None
        What was diagnosed before the step, as ``study diagnose --json`` prints it.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="allow")  # what is read is checked, no more

    step: int
    action: str
    model_effects: tuple[str, ...]
    fit_error: _Error
    held_out_error: _Error | None
    reduced_chi2: float | None
    p_value: float | None
    parameters: Mapping[str, _Parameter]
    hashes: Mapping[str, str | dict[str, str]]
    effect: str = ""
    because: str = ""
    held_out_reduced_chi2: float | None = None
    errors: Mapping[str, tuple[_OfObservable, ...]] = field(default_factory=dict)
    about: Mapping[str, Any] = field(default_factory=dict)
    at_bound: tuple[str, ...] = ()
    model_discrepancy_percent: float = 0.0
    version: str = ""
    diagnosis: Mapping[str, Any] | None = None

    def of_each(self, kind: str) -> dict[str, Mapping[str, Any]]:
        """Error of every observable, in the form of `fit_error`; `kind` as in `errors`."""
        return {
            e["observable"]: {
                "value": e["rms"],
                "unit": e["unit"],
                "metric": f"RMS of {e['observable']}",
                "n": e["n"],
            }
            for e in self.errors.get(kind, ())
        }


def error_pairs(before: Step, after: Step) -> list[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    """Errors at two steps on ``fitted`` and on ``held-out`` data; of several observables, with their names."""
    found = []
    for data, kind in (("fitted", "fit"), ("held-out", "held_out")):
        old, new = before.of_each(kind), after.of_each(kind)
        names = [name for name in new if name in old]
        found += [(data if len(names) == 1 else f"{data} {name}", old[name], new[name]) for name in names]
    return found


def line_of(step: Step) -> str:
    """A step as the line that is kept of it."""
    return json.dumps(finite(step), ensure_ascii=False, sort_keys=True) + "\n"


class History(Result):
    """The steps that were taken in a directory."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / NAME
        self.ignored: list[str] = []  # lines that cannot be read: they stay in the file
        self.steps = self._read()

    dimensions = ("step",)

    def summary(self) -> str:
        """Where it is kept, and what the last step did."""
        last = f", last: {self.last.action} {self.last.effect}".rstrip() if self.last else ""
        return f"{self.path.parent}, {counted(len(self.steps), 'step')}{last}"

    def columns(self) -> dict[str, Any]:
        """One row for each step; errors are RMS in `unit`."""
        names = ("step", "action", "effect", "because")
        return {
            **{name: [getattr(s, name) for s in self.steps] for name in names},
            "fit_error": [s.fit_error["value"] for s in self.steps],
            "held_out_error": [s.held_out_error["value"] if s.held_out_error else None for s in self.steps],
            "unit": [s.fit_error["unit"] for s in self.steps],
            "reduced_chi2": [s.reduced_chi2 for s in self.steps],
            "held_out_reduced_chi2": [s.held_out_reduced_chi2 for s in self.steps],
        }

    @property
    def last(self) -> Step | None:
        """The latest step."""
        return self.steps[-1] if self.steps else None

    def _read(self) -> list[Step]:
        if not self.path.exists():
            return []
        steps = []
        text = self.path.read_text(encoding="utf-8", errors="replace")
        for number, line in enumerate(text.split("\n"), 1):
            if not line.strip():
                continue
            try:
                steps.append(TypeAdapter(Step).validate_json(line))
            except ValidationError as fault:
                self.ignored.append(f"{self.path}, line {number} is damaged ({_said(fault)}) and ignored")
        return steps


def _said(fault: ValidationError) -> str:
    """The first of what is wrong, after its place in the line."""
    first = fault.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    return f"{place}: {first['msg']}" if place else first["msg"]


@contextlib.contextmanager
def changing(directory: Path) -> Iterator[None]:
    """Keep other processes from changing the study in a directory meanwhile.

    Raises
    ------
    RequestError
        Another process is changing it, or the directory cannot be written to.
    """
    with contextlib.ExitStack() as held:
        busy = f"another command is changing the study {directory}"
        try:
            held.enter_context(locked(directory / LOCK, busy, "wait until it has finished"))
        except OSError as fault:
            raise RequestError(
                f"the study {directory} cannot be written to ({fault.strerror})",
                expected="a directory that may be changed",
                remedy="copy the study to another place",
            ) from None
        yield


def commit(directory: Path, study_text: str | None, history_lines: str) -> None:
    """Write the study file (where it changes) and append to the history, both or neither.

    Parameters
    ----------
    directory : Path
        Of the study; the caller is `changing` it.
    study_text : str or None
        New content of the study file; None where it stays.
    history_lines : str
        Lines to append to the history.
    """
    history = directory / NAME
    size = history.stat().st_size if history.exists() else 0
    if size and not history.read_bytes().endswith(b"\n"):  # half a line, which stays a line of its own
        history_lines = "\n" + history_lines
    pending = {"study": study_text, "history_size": size, "history": history_lines}
    with text_file(directory / PENDING) as file:
        file.write(json.dumps(pending))
    _finish(directory)


def recover(directory: Path) -> None:
    """Finish a change that a process left half done; nothing where there is none.

    Raises
    ------
    RequestError
        The change cannot be finished here.
    """
    # A change that is being written takes milliseconds; a longer wait means a process that hangs.
    end = time.monotonic() + 5.0
    while os.path.exists(directory / PENDING):  # Path.exists raises where a name is too long
        try:
            with changing(directory):
                if (directory / PENDING).exists():
                    _finish(directory)
            return
        except RequestError:  # a process that is alive is writing it
            if time.monotonic() > end:
                raise
            time.sleep(0.02)


def _finish(directory: Path) -> None:
    """Apply what is pending; the same whether none, half or all of it was applied before."""
    pending = json.loads((directory / PENDING).read_text(encoding="utf-8"))
    with (directory / NAME).open("a+b") as stream:
        stream.truncate(pending["history_size"])
        stream.seek(0, os.SEEK_END)
        stream.write(pending["history"].encode("utf-8"))
        stream.flush()
        os.fsync(stream.fileno())
    if pending["study"] is not None:
        with text_file(directory / STUDY_FILE) as file:
            file.write(pending["study"])
    (directory / PENDING).unlink()


class KeptResults:
    """Results of one state of a study.

    Parameters
    ----------
    directory : Path
        Of the study.
    state : mapping
        Plain values that say what the results depend on, beside the programs.
    """

    def __init__(self, directory: Path, state: Mapping[str, Any]) -> None:
        self._folder = directory / FOLDER
        self._state = {"state": state, "programs": _programs(), "own": _own_modules()}

    def find(self, name: str, kind: type[Kept]) -> Kept | None:
        """What is kept under a name, of the class `kind`; None where nothing is."""
        path, key = self._place(name)
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            envelope = json.loads(path.read_text(encoding="utf-8"))
            content = envelope["content"]
            if envelope["key"] == key and envelope["sha256"] == _sha256(content):
                plain = json.loads(content, object_hook=_with_arrays)
                arrays = ConfigDict(arbitrary_types_allowed=True)
                of_kind = TypeAdapter[Any](tuple[kind], config=arrays)  # type: ignore[valid-type]
                return of_kind.validate_python((plain,))[0]
        return None

    def made(self, name: str, kind: type[Kept], make: Callable[[], Kept]) -> Kept:
        """What is kept under a name, or is made and kept now."""
        found = self.find(name, kind)
        return self.keep(name, make()) if found is None else found

    def keep(self, name: str, result: Kept) -> Kept:
        """Keep a result under a name; a directory that cannot be written to keeps nothing."""
        path, key = self._place(name)
        content = to_json(result, inf_nan_mode="constants", fallback=_plain).decode()
        text = json.dumps({"key": key, "sha256": _sha256(content), "content": content})
        with contextlib.suppress(OSError, RequestError):
            self._folder.mkdir(exist_ok=True)
            with text_file(path, durable=False) as file:
                file.write(text)
            for old in sorted(self._folder.iterdir(), key=lambda p: p.stat().st_mtime)[:-MOST_FILES]:
                old.unlink()
        return result

    def _place(self, name: str) -> tuple[Path, str]:
        """File of a name, and the hash of all that its content depends on."""
        key = _sha256(json.dumps([name, self._state], sort_keys=True))
        return self._folder / f"{name}-{key[:32]}.json", key


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@lru_cache(maxsize=1)
def _programs() -> dict[str, str]:
    """The source of specan as far as numbers go through it, and versions of what it computes with."""
    root, digest = Path(specan.__file__).parent, hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        inside = path.relative_to(root)
        if inside.parts[0] not in ("report", "inspect", "api"):  # they change no number of a study
            digest.update(f"{inside.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    found = {"specan": digest.hexdigest(), "python": sys.version}
    for name in ("numpy", "scipy", "numba"):
        with contextlib.suppress(ImportError):
            found[name] = version(name)
    installed = entry_points()  # once: each call reads what every installed package declares
    for group in (ENTRY_POINTS, MODEL_ENTRY_POINTS):
        for point in installed.select(group=group):
            found[f"{group} {point.name}"] = f"{point.value} {point.dist.version if point.dist else ''}"
    return found


def _own_modules() -> dict[str, str]:
    """Hashes of modules that somebody works on: neither specan's nor those of an installed package."""
    places = (sys.prefix, sys.base_prefix, Path(specan.__file__).parent.parent)
    installed = tuple(str(Path(place)) + os.sep for place in places)
    found = {}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if not isinstance(file, str) or file.startswith(installed):
            continue
        if {"site-packages", "dist-packages"}.isdisjoint(Path(file).parts):
            with contextlib.suppress(OSError):
                found[name] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return found


def _plain(value: Any) -> Any:
    """Arrays and numbers of numpy as plain values."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        text = base64.b64encode(np.ascontiguousarray(value).astype("<f8").tobytes()).decode()
        return {_ARRAY: text, "shape": value.shape}
    return value.tolist()


def _with_arrays(value: dict[str, Any]) -> Any:
    """What `_plain` made of an array as one again; any other mapping as it is."""
    if _ARRAY not in value:
        return value
    flat = np.frombuffer(base64.b64decode(value[_ARRAY]), dtype="<f8")
    return flat.astype(np.float64).reshape(value["shape"])
