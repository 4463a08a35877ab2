"""Fits and diagnoses of a study, kept by the hash of everything that they depend on.

What is kept is believed only if nothing has changed: the study, its data, its own files, the last step, and the
programs that computed it. A file that is damaged, or of another state, is as if it were not there. See
docs/decisions/study_data.md.

Diagnoses are kept beside the history as well, so that why each step was taken can be read later.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import sys
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

import specan
from specan import __version__
from specan.errors import RequestError
from specan.models.catalogue import ENTRY_POINTS, MODEL_ENTRY_POINTS
from specan.study.history import changing

if TYPE_CHECKING:
    from specan.study.verdict import Diagnosis

FOLDER = ".kept"
MOST_FILES = 12  # the oldest go
# Parts of the program that change no number of a study.
_ASIDE = ("report", "inspect", "api")
_PACKAGES = {"site-packages", "dist-packages"}
_ARRAY = "float64 array"

Kept = TypeVar("Kept")

NAME = "diagnoses.jsonl"
STATE = ("study", "rig", "files", "effect_files")


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
                return cast("Kept", _built(kind, json.loads(content)))
        return None

    def keep(self, name: str, result: Kept) -> Kept:
        """Keep a result under a name; a directory that cannot be written to keeps nothing."""
        path, key = self._place(name)
        content = json.dumps(_plain(result))
        text = json.dumps({"key": key, "sha256": _sha256(content), "content": content})
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        with contextlib.suppress(OSError):
            self._folder.mkdir(exist_ok=True)
            part.write_text(text, encoding="utf-8")
            part.replace(path)
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
        if inside.parts[0] not in _ASIDE:
            digest.update(f"{inside.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    found = {"specan": digest.hexdigest(), "python": sys.version}
    for name in ("numpy", "scipy", "numba"):
        with contextlib.suppress(ImportError):
            found[name] = version(name)
    for group in (ENTRY_POINTS, MODEL_ENTRY_POINTS):
        for point in entry_points(group=group):
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
        if _PACKAGES.isdisjoint(Path(file).parts):
            with contextlib.suppress(OSError):
                found[name] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
    return found


def _plain(value: Any) -> Any:
    """Data classes, arrays and numbers as plain values."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        text = base64.b64encode(np.ascontiguousarray(value).astype("<f8").tobytes()).decode()
        return {_ARRAY: text, "shape": value.shape}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return value


def _built(hint: Any, value: Any) -> Any:
    """The value of this type that `_plain` made plain."""
    if isinstance(value, dict) and _ARRAY in value:
        flat = np.frombuffer(base64.b64decode(value[_ARRAY]), dtype="<f8")
        return flat.astype(np.float64).reshape(value["shape"])
    origin, of = get_origin(hint), get_args(hint)
    if value is None:
        return None
    if origin in (Union, types.UnionType):
        return _built(next(each for each in of if each is not type(None)), value)
    if is_dataclass(hint) and isinstance(hint, type):
        hints = get_type_hints(hint)
        return hint(**{field.name: _built(hints[field.name], value[field.name]) for field in fields(hint)})
    if origin is tuple:
        each = [of[0]] * len(value) if of[-1] is Ellipsis else of
        return tuple(_built(one, item) for one, item in zip(each, value, strict=True))
    if isinstance(value, dict):
        one = of[1] if len(of) == 2 else Any
        return {name: _built(one, item) for name, item in value.items()}
    if isinstance(hint, type) and issubclass(hint, str):
        return hint(value)
    return value


def keep_diagnosis(directory: Path, hashes: Mapping[str, Any], found: Diagnosis) -> None:
    """Append a diagnosis, with the state of the study that it is about, to `NAME` in the study's directory.

    Nothing is kept in a directory that cannot be written to, or that another command is changing.
    """
    diagnosis = found.to_json()
    if diagnosis_of(directory, hashes) == diagnosis:
        return
    content = {"version": __version__, "hashes": hashes, "diagnosis": diagnosis}
    line = json.dumps(content, ensure_ascii=False, sort_keys=True) + "\n"
    with (
        contextlib.suppress(OSError, RequestError),
        changing(directory),
        (directory / NAME).open("a", encoding="utf-8") as file,
    ):
        file.write(line)


def diagnosis_of(directory: Path, hashes: Mapping[str, Any]) -> dict[str, Any] | None:
    """What was last diagnosed of a state of the study, as ``study diagnose --json`` prints it; None if nothing was.

    Parameters
    ----------
    hashes : mapping
        The state: those of a step of the history, or of the study as it is.
    """
    path = directory / NAME
    if not path.exists():
        return None
    wanted = {name: hashes[name] for name in STATE}
    found = None
    for line in path.read_text(encoding="utf-8").splitlines():
        with contextlib.suppress(ValueError, KeyError, TypeError):  # a line that was cut off tells nothing
            content = json.loads(line)
            if {name: content["hashes"][name] for name in STATE} == wanted:
                found = dict(content["diagnosis"])
    return found
