"""Where models and effects are found: the built-in ones, installed plug-ins, and a user's own file."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.effect import Effect
from specan.models.model import Model

# name -> package that holds `build(rig) -> Model` and `EXAMPLE_RIG`
MODELS = {
    "planetary-gear": "specan.models.planetary_gear",
    "room": "specan.models.room",
    "worm-gear": "specan.models.worm_gear",
}

ENTRY_POINTS = "specan.effects"


def model_names() -> list[str]:
    """Names of the models that specan has."""
    return sorted(MODELS)


def load_model(name: str, rig: Mapping[str, Any]) -> Model:
    """Build a model for a rig (the parsed rig file), installed plug-in effects included.

    Raises
    ------
    RequestError
        Unknown model, or a rig that is incomplete or impossible.
    """
    model: Model = _package(name).build(rig)
    return model.with_effect(*_plugins(name))


def example_model(name: str) -> Model:
    """Build a model for the example rig that comes with it: to look at, not to compare with anything."""
    rig = getattr(_package(name), "EXAMPLE_RIG", None)
    if rig is None:
        raise RequestError(f"the model {name!r} comes with no example rig", remedy="name a rig file")
    return load_model(name, rig)


def model_summary(name: str) -> str:
    """What a model is, in a line."""
    return (_package(name).__doc__ or "").split("\n")[0]


def _package(name: str) -> Any:
    if name not in MODELS:
        raise RequestError(f"there is no model {name!r}", remedy=nearest(name, MODELS))
    return importlib.import_module(MODELS[name])


def effects_in(package: str) -> dict[str, Effect]:
    """Every effect in the modules of a package, one module an effect."""
    found: dict[str, Effect] = {}
    home = importlib.import_module(package)
    for entry in pkgutil.iter_modules(home.__path__):
        module = importlib.import_module(f"{package}.{entry.name}")
        for effect in _effects_of(module):
            found[effect.name] = effect
    return dict(sorted(found.items()))


def effects_from_file(path: Path, content: bytes | None = None) -> list[Effect]:
    """Load a user's own effects from a Python file, or from the `content` that was hashed for it.

    Raises
    ------
    RequestError
        The file is missing, is no valid Python, fails on import, or holds no effect.
    """
    try:
        source = path.read_bytes() if content is None else content
        code = compile(source, str(path), "exec")
    except FileNotFoundError:
        raise RequestError(f"the effect file {path} does not exist", remedy="check the path") from None
    except (SyntaxError, ValueError) as fault:
        line = getattr(fault, "lineno", None)
        raise RequestError(
            f"the effect file {path} is not valid Python ({fault.args[0]}, line {line})",
            remedy="correct that line",
        ) from None
    spec = importlib.util.spec_from_loader(f"specan_user_effect_{path.stem}", loader=None, origin=str(path))
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    _run(lambda: exec(code, module.__dict__), path)
    effects = _effects_of(module)
    if not effects:
        raise RequestError(
            f"the effect file {path} holds no effect",
            expected="a function under @effect(...) from specan.models",
        )
    return effects


def _run(load: Callable[[], None], path: Path) -> None:
    try:
        load()
    except RequestError as fault:
        raise RequestError(
            f"the effect file {path}: {fault.found}", expected=fault.expected, remedy=fault.remedy
        ) from None
    except Exception as fault:  # whatever a user's file raises is the file's fault, and is said as such
        raise RequestError(
            f"the effect file {path} fails when it is loaded ({type(fault).__name__}: {fault})",
            remedy="correct it",
        ) from None


def _effects_of(module: Any) -> list[Effect]:
    own = [value for value in vars(module).values() if isinstance(value, Effect)]
    return [e for e in own if e.function.__module__ == module.__name__]


def _plugins(model: str) -> list[Effect]:
    """Effects of installed packages: entry points named ``model:anything`` in the group specan.effects."""
    found = []
    for point in entry_points(group=ENTRY_POINTS):
        if point.name.split(":")[0] == model:
            found.append(point.load())
    return found
