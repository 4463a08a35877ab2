"""Where models, effects and rigs are found: what is built in, installed plug-ins, and a user's own files."""

from __future__ import annotations

import importlib
import importlib.util
import os
import pkgutil
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.effect import Effect
from specan.models.model import Model
from specan.schema import read_toml, regular

ENTRY_POINTS = "specan.effects"  # name = ``model:anything``
MODEL_ENTRY_POINTS = "specan.models"  # name = module with `build(rig) -> Model`, and perhaps `EXAMPLE_RIG`
# ending of a file = module with `model_from(path) -> Model` and `files_of(path)`, those that decide what it is
FILE_ENTRY_POINTS = "specan.model_files"


def model_names() -> list[str]:
    """Names of the models that specan and other installed packages bring."""
    return sorted({point.name for point in entry_points(group=MODEL_ENTRY_POINTS)})


def load_model(name: str | Path, rig: Mapping[str, Any] | str | Path | None = None) -> Model:
    """Build a model for a rig, installed plug-in effects included.

    Parameters
    ----------
    name : str or Path
        Name of a built-in or installed model, a Python file that holds one Model or a function
        ``build(rig) -> Model``, or an FMU with a TOML file beside it.
    rig : mapping or path, optional
        A rig file, or what it says; by default the example that comes with the model, to look at.

    Returns
    -------
    Model
        With its whole catalogue of effects.

    Raises
    ------
    RequestError
        Unknown model, a file that holds none, or a rig that is incomplete or impossible.

    Examples
    --------
    >>> "windage" in load_model("worm-gear").effects
    True
    """
    if not isinstance(name, (str, Path)):
        raise RequestError(
            f"{name!r} is not the name of a model",
            expected="a name, or the path of a file",
            remedy="give the rig where the model is loaded first: load_model(NAME, rig)",
        )
    if rig is None:
        rig = example_rig(str(name))
    elif not isinstance(rig, Mapping):
        rig = read_rig_file(Path(rig))
    if str(name).startswith(_MEMORY):
        if str(name) not in _KEPT:
            raise RequestError(
                "the model of this study was in the memory of a program that has ended",
                expected="a model in a file",
                remedy="write the model to a Python file and begin a study with it",
            )
        return _KEPT[str(name)].with_rig(rig) if rig else _KEPT[str(name)]
    if is_file(name):
        return model_from_file(Path(name), rig)
    model: Model = _package(str(name)).build(rig)
    plugins = entry_points(group=ENTRY_POINTS)
    return model.with_effect(*(p.load() for p in plugins if p.name.split(":")[0] == str(name)))


_MEMORY = "memory:"
_KEPT: dict[str, Model] = {}


def keep_in_memory(model: Model) -> str:
    """A name by which `load_model` finds a model that no file holds, as long as this program runs."""
    if not isinstance(model, Model):
        raise RequestError(
            f"{model!r:.60} is not a model", expected="a Model, the name of one, or a Python file"
        )
    name = f"{_MEMORY}{len(_KEPT)}"
    _KEPT[name] = model
    return name


def is_file(name: str | Path) -> bool:
    """Whether a model is named by its file."""
    return str(name).endswith(".py") or _format_of(Path(name)) is not None


def _format_of(path: Path) -> Any:
    """The module for model files with this ending; None for Python and for names of models."""
    found = entry_points(group=FILE_ENTRY_POINTS, name=path.suffix.removeprefix(".")) if path.suffix else ()
    return next((point.load() for point in found), None)


def source_of(path: Path, what: str) -> bytes:
    """A user's Python file as it is on disk; `what` it holds is for messages.

    Raises
    ------
    RequestError
        It cannot be read.
    """
    try:
        return regular(path).read_bytes()
    except OSError as fault:
        missing = isinstance(fault, FileNotFoundError)
        why = "does not exist" if missing else f"cannot be read ({fault.strerror})"
        raise RequestError(f"the {what} file {path} {why}", remedy="check the path") from None


def content_of(path: Path) -> bytes:
    """Everything that decides what a model file is."""
    return b"".join(regular(file).read_bytes() for file in files_of(path))


def files_of(path: Path) -> tuple[Path, ...]:
    """The model file and those that belong to it."""
    kind = _format_of(path)
    return (path,) if kind is None else kind.files_of(path)


def model_from_file(path: Path, rig: Mapping[str, Any], content: bytes | None = None) -> Model:
    """Load a user's own model from a Python file, or from the `content` that was hashed for it.

    Files of other endings are those of the entry points of the group ``specan.model_files``.

    Raises
    ------
    RequestError
        The file is missing, is not a valid Python, fails, or holds no model or several.
    """
    if (kind := _format_of(path)) is not None:
        model: Model = kind.model_from(path)
        return model.with_rig(rig) if rig else model
    module = _module_from(path, "model", content)
    build = getattr(module, "build", None)
    held = {id(value): value for value in vars(module).values() if isinstance(value, Model)}
    found = [_run(lambda: build(rig), path, "model")] if callable(build) else list(held.values())
    if len(found) != 1 or not isinstance(found[0], Model):
        raise RequestError(
            f"the model file {path} holds {len(found) or 'no'} model{'s' * (len(found) > 1)}",
            expected="one Model, or a function build(rig) that returns one",
            remedy="" if found else "specan model new FILE.py writes an example",
        )
    return found[0].with_rig(rig) if rig and not callable(build) else found[0]


def example_model(name: str) -> Model:
    """Build a model for the example rig that comes with it: to look at, not to compare with anything."""
    return load_model(name, example_rig(name))


def example_rig(name: str) -> Mapping[str, Any]:
    """The content of the example rig file that comes with a model; empty for a file that states none."""
    python = str(name).endswith(".py")
    if is_file(name) and not python:
        return {}
    module = _module_from(Path(name), "model") if python else _package(name)
    found: Mapping[str, Any] | None = getattr(module, "EXAMPLE_RIG", {} if python else None)
    if found is None:
        raise RequestError(f"the model {name!r} comes with no example rig", remedy="name a rig file")
    return found


def model_summary(name: str) -> str:
    """What a model is, in a line."""
    return (_package(name).__doc__ or "").split("\n")[0]


def _package(name: str) -> Any:
    for point in entry_points(group=MODEL_ENTRY_POINTS):
        if point.name == name:
            return point.load()
    endings = [f"a file .{point.name}" for point in entry_points(group=FILE_ENTRY_POINTS)]
    raise RequestError(
        f"there is no model {name!r}",
        expected=" or ".join(["the name of a model", "a file .py", *endings]),
        remedy=nearest(name, model_names()),
    )


def effects_in(package: str) -> dict[str, Effect]:
    """Every effect in the modules of a package; a module may hold several. One of two that look alike says so."""
    home = importlib.import_module(package)
    names = [f"{package}.{entry.name}" for entry in pkgutil.iter_modules(home.__path__)]
    found = [effect for name in names for effect in _effects_of(importlib.import_module(name))]
    found.sort(key=lambda effect: effect.name)
    alike = [(one.name, other) for one in found for other in one.aliases]
    return {
        name: replace(
            one, aliases=(*one.aliases, *(a for a, b in alike if b == name and a not in one.aliases))
        )
        for name, one in ((effect.name, effect) for effect in found)
    }


def effects_from_file(path: Path, content: bytes | None = None) -> list[Effect]:
    """Load a user's own effects from a Python file, or from the `content` that was hashed for it.

    Raises
    ------
    RequestError
        The file is missing, is not a valid Python, fails on import, or holds no effect.
    """
    module = _module_from(path, "effect", content)
    effects = _effects_of(module)
    if not effects:
        raise RequestError(
            f"the effect file {path} holds no effect",
            expected="a function under @effect(...) from specan.models",
        )
    return effects


def _module_from(path: Path, what: str, content: bytes | None = None) -> Any:
    """Run a user's file as a module of its own; `what` it holds is for messages."""
    try:
        code = compile(source_of(path, what) if content is None else content, str(path), "exec")
    except (SyntaxError, ValueError, MemoryError, RecursionError) as fault:
        line = f", line {fault.lineno}" if isinstance(fault, SyntaxError) else ""
        why = next(iter(fault.args), "it is nested too deeply")
        raise RequestError(
            f"the {what} file {path} is not valid Python ({why}{line})",
            remedy="correct that line",
        ) from None
    spec = importlib.util.spec_from_loader(f"specan_user_{what}_{path.stem}", loader=None, origin=str(path))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where what numba keeps on disk looks for it
    _run(lambda: exec(code, module.__dict__), path, what)
    return module


def _run(load: Callable[[], Any], path: Path, what: str) -> Any:
    try:
        return load()
    except (Exception, SystemExit) as fault:  # whatever a user's file raises is said as the file's fault
        frames = traceback.extract_tb(fault.__traceback__)
        lines = [f", line {frame.lineno}" for frame in frames if frame.filename == str(path)]
        where = f"the {what} file {path}{''.join(lines[-1:])}"
        if isinstance(fault, RequestError):
            raise fault.within(where) from None
        raise RequestError(
            f"{where} fails when it is loaded ({type(fault).__name__}: {fault})", remedy="correct it"
        ) from None


def _effects_of(module: Any) -> list[Effect]:
    own = [value for value in vars(module).values() if isinstance(value, Effect)]
    return [e for e in own if e.function.__module__ == module.__name__]


def read_rig_file(path: Path) -> dict[str, Any]:
    """Read a rig file; texts in it that name a file beside it become its absolute path.

    Raises
    ------
    RequestError
        It does not exist or is not valid TOML.
    """
    content = read_toml(path)
    for table, key, file in _naming_files(content, path.parent):
        table[key] = str(file)
    return content


def _naming_files(content: dict[str, Any], folder: Path) -> list[tuple[dict[str, Any], str, Path]]:
    """Tables and keys of a rig file whose values name a file, and the files; what stands in lists names none."""
    found = []
    for key, value in content.items():
        if isinstance(value, dict):
            found += _naming_files(value, folder)
        elif isinstance(value, str) and os.path.isfile(folder / value):  # is_file raises over a long text
            found.append((content, key, (folder / value).resolve()))
    return found


def rig_files(path: Path) -> tuple[Path, ...]:
    """The rig file and the files that it names: everything that decides what the rig is."""
    return (path, *(file for _, _, file in _naming_files(read_toml(path), path.parent)))
