"""Configuration that a person writes: unknown keys are errors, and every message says what to do."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from specan.errors import RequestError, nearest


class Settings(BaseModel):
    """A frozen group of settings; the base of everything that is read from TOML."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Kind = TypeVar("Kind", bound=BaseModel)


def parse(kind: type[Kind], content: Mapping[str, Any], where: str) -> Kind:
    """Turn a mapping into `kind`; the first fault becomes a RequestError that names its key.

    Parameters
    ----------
    kind : type
        The settings class to build.
    content : mapping
        Keys and values as read from a file.
    where : str
        The file or option, for the message.
    """
    try:
        return kind.model_validate(dict(content))
    except ValidationError as fault:
        first = fault.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            known = _keys_at(kind, first["loc"][:-1])
            hint = nearest(str(first["loc"][-1]), known)
            raise RequestError(f"{where}: unknown key '{place}'", remedy=hint) from None
        if first["type"] == "missing":
            raise RequestError(f"{where}: the key '{place}' is missing", remedy="add it") from None
        value = first.get("input")
        message = first["msg"].removeprefix("Value error, ")
        if not place:  # the keys contradict each other
            raise RequestError(f"{where}: {message}", remedy="correct it") from None
        raise RequestError(
            f"{where}: '{place}' is {value!r}",
            expected=message[:1].lower() + message[1:],
            remedy="correct it",
        ) from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file into plain values; a fault names the file and the line."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise RequestError(f"the file {path} does not exist", remedy="check the path") from None
    except (OSError, UnicodeDecodeError) as fault:
        raise RequestError(f"{path} cannot be read ({fault})", expected="a TOML file in UTF-8") from None
    except (ValueError, RecursionError) as fault:  # also a date that is none, and brackets within brackets
        raise RequestError(f"{path} is not valid TOML ({fault})", remedy="correct that line") from None


def _keys_at(kind: type[BaseModel], path: tuple[Any, ...]) -> list[str]:
    """Keys that are known where a fault was found, one level of nesting after another."""
    for part in path:
        if isinstance(part, str) and part in kind.model_fields:
            inner = _settings_inside(kind.model_fields[part].annotation)
            if inner is None:
                return []
            kind = inner
    return [field.alias or name for name, field in kind.model_fields.items()]


def _settings_inside(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        found = _settings_inside(inner)
        if found is not None:
            return found
    return None
