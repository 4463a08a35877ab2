"""Configuration that a person writes: unknown keys are errors, and every message says what to do."""

from __future__ import annotations

import stat
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from specan.divisions import DIVISIONS
from specan.errors import RequestError, SpecanError, nearest


class Settings(BaseModel):
    """A frozen group of settings; the base of everything that is read from TOML."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def _offered(value: int | str) -> int | str:
    value = int(value) if str(value).isdigit() else value
    if value not in DIVISIONS:
        raise ValueError(f"{', '.join(map(str, DIVISIONS[:-1]))} or {DIVISIONS[-1]!r}")
    return value


# 1/n octave, or the name of a table of bands.
Division = Annotated[int | str, AfterValidator(_offered)]

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
        first = _nearest_to_intended(fault.errors())
        keys = _keys_in(content, first["loc"], first["type"] in ("missing", "extra_forbidden"))
        place = _spoken(keys)
        entries = 1 + max((k for k, key in enumerate(keys) if isinstance(key, int)), default=-1)
        key, within = _spoken(keys[entries:]), f" in {_spoken(keys[:entries])}" if entries else ""
        if first["type"] == "extra_forbidden":
            known = _keys_at(kind, first["loc"][:-1])
            hint = nearest(str(first["loc"][-1]), known)
            raise RequestError(f"{where}: unknown key {key}{within}", remedy=hint) from None
        if first["type"] == "missing" and isinstance(keys[-1], int):
            raise RequestError(
                f"{where}: {_spoken(keys[:-1])} is {first['input']!r}",
                expected=f"at least {keys[-1] + 1} entries",
            ) from None
        if first["type"] == "missing":
            raise RequestError(f"{where}: the key {key} is missing{within}", remedy="add it") from None
        if not place:  # the keys contradict each other
            message = first["msg"].removeprefix("Value error, ")
            raise RequestError(f"{where}: {message}", remedy="correct it") from None
        raise RequestError(
            f"{where}: {place} is {first['input']!r}", expected=_expected(first), remedy="correct it"
        ) from None


WORDS = {
    "tuple_type": "a list in square brackets", "list_type": "a list in square brackets",
    "model_type": "a table of keys", "dict_type": "a table of keys", "string_type": "a text in quotes",
    "float_type": "a number", "float_parsing": "a number", "int_type": "a whole number",
    "int_from_float": "a whole number", "int_parsing": "a whole number", "bool_type": "true or false",
    "too_short": "at least {min_length} entries", "too_long": "at most {max_length} entries",
    "greater_than": "more than {gt:g}", "greater_than_equal": "at least {ge:g}",
    "less_than": "less than {lt:g}", "less_than_equal": "at most {le:g}",
}  # fmt: skip


def _expected(fault: Any) -> str:
    """What a value should be, in a user's words."""
    if fault["type"] in WORDS:
        return WORDS[fault["type"]].format(**fault.get("ctx", {}))
    message = str(fault["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return message[:1].lower() + message[1:]


def _nearest_to_intended(faults: Sequence[Any]) -> Any:
    """The first fault; of a value that may be of several forms, the one of the form that was meant.

    A form of another kind fails as a whole (``tuple_type``); what was meant fails within.
    """
    first = faults[0]
    alike = [f for f in faults if f["loc"][: len(first["loc"]) - 1] == first["loc"][:-1]]
    return max(alike, key=lambda f: (not f["type"].endswith("_type"), len(f["loc"])))


def _keys_in(content: Any, place: Sequence[str | int], of_a_key: bool) -> list[str | int]:
    """Keys and numbers of entries on the way to a fault, without the names of the forms that a value may have."""
    found: list[str | int] = []
    for number, part in enumerate(place):
        last = number == len(place) - 1
        if isinstance(content, Mapping):
            if part in content or (last and of_a_key):
                found.append(part)
                content = content.get(part)
        elif isinstance(content, Sequence) and isinstance(part, int):
            found.append(part)
            content = content[part] if part < len(content) else None
    return found


def _spoken(keys: Sequence[str | int]) -> str:
    """``'mics.position_m' entry 2 entry 3``, as a user counts them."""
    words: list[str] = []
    for kind, some in groupby(keys, type):
        names = [f"entry {key + 1}" if isinstance(key, int) else key for key in some]
        words.append(" ".join(names) if kind is int else f"'{'.'.join(names)}'")
    return " ".join(words)


def regular(path: Path) -> Path:
    """The path of a file; a pipe would be waited for, and a device has no end.

    Raises
    ------
    RequestError
        It is one of those.
    """
    with suppress(OSError, ValueError):  # whoever opens it says what is wrong
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
            what = "a pipe" if stat.S_ISFIFO(mode) else "a socket" if stat.S_ISSOCK(mode) else "a device"
            raise RequestError(f"{path} is {what}", expected="a file", remedy="write it to a file first")
    return path


def decoded(raw: bytes) -> str:
    """Text as editors and spreadsheets save it: UTF-8, UTF-16 that says so, else the code page of Western Windows.

    The end may be in the middle of a character.

    Raises
    ------
    UnicodeDecodeError
        It is none of them.

    Examples
    --------
    >>> decoded("Tür µm".encode("cp1252")), decoded("Tür".encode()[:2])
    ('Tür µm', 'T')
    """
    encoding = "utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    for cut in range(4):
        with suppress(UnicodeDecodeError):
            return raw[: len(raw) - cut].decode(encoding)
    return raw.decode("cp1252")


def read_text(path: Path, expected: str, kind: type[SpecanError] = RequestError) -> str:
    """The text of a small file; a fault names the file.

    Raises
    ------
    SpecanError
        Of this kind: it cannot be read.
    """
    try:
        return decoded(regular(path).read_bytes()).replace("\r\n", "\n")
    except FileNotFoundError:
        raise kind(f"the file {path} does not exist", remedy="check the path") from None
    except (OSError, UnicodeDecodeError) as fault:
        raise kind(f"{path} cannot be read ({fault})", expected=expected) from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file into plain values; a fault names the file and the line."""
    text = read_text(path, "a TOML file in UTF-8")
    try:
        return tomllib.loads(text)
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
