"""``study.toml``: what a study consists of, as a person may read and edit it."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import tomlkit
from pydantic import Field

from specan.errors import RequestError
from specan.models import Use
from specan.models.catalogue import rig_files
from specan.models.effect import ParameterName
from specan.schema import Settings, parse, read_toml, regular

NAME = "study.toml"


class ParameterEntry(Settings):
    """What a study says about one parameter; numbers are in `unit`, by default the declared one."""

    value: float | tuple[float, ...] | None = None
    unit: str | None = None
    low: float | None = None
    high: float | None = None
    per: str | None = None
    fixed: bool | None = None
    prior_sd: float | None = Field(default=None, gt=0)


class EffectEntry(Settings):
    """One effect of the study's model."""

    name: str
    at: str = ""
    role: Literal["model", "nuisance"] = "model"
    prior_sd: float | None = Field(default=None, gt=0)
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)

    @property
    def use(self) -> Use:
        """The effect with its place."""
        written = Use.parse(self.name)
        return Use(written.name, self.at or written.at, written.copy)


class DataEntry(Settings):
    """A measured file."""

    file: str
    sha256: str
    kind: str = "table"
    estimator: str = ""
    sheet: str = ""
    conditions: dict[str, float | str] = Field(default_factory=dict)


class HoldOutEntry(Settings):
    """Rows or channels of the measurements that are held out: ``where = "load=60"``."""

    where: str
    file: str | None = None


class EffectFileEntry(Settings):
    """A user's own effects, copied into the study."""

    file: str
    sha256: str


class StudyFile(Settings):
    """The whole file."""

    schema_: Literal[1] = Field(alias="schema")
    model: str
    model_sha256: str | None = None
    rig: str = ""
    calibration: str | None = None
    columns: dict[str, str] = Field(default_factory=dict)
    groups: tuple[str, ...] = ()
    measurement: tuple[DataEntry, ...] = Field(min_length=1)
    validation: tuple[DataEntry, ...] = ()
    hold_out: tuple[HoldOutEntry, ...] = ()
    effect: tuple[EffectEntry, ...] = ()
    effect_file: tuple[EffectFileEntry, ...] = ()
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)


def read_study_file(directory: Path) -> StudyFile:
    """Read the study file of a directory.

    Raises
    ------
    RequestError
        There is none, or it has a fault, which is named with its key.
    """
    path = directory / NAME
    if not os.path.exists(path):  # Path raises where a name is too long
        raise RequestError(
            f"{directory} holds no study", expected=f"a file {NAME}", remedy="begin one with specan study new"
        )
    return parse(StudyFile, read_toml(path), str(path))


def content_hash(content: StudyFile) -> str:
    """Hash of what the file says, whatever its comments and layout.

    Own effect files are left out: those that are candidates only change no number, and the others are
    known by their own hash.
    """
    plain = content.model_dump(mode="json", by_alias=True, exclude_defaults=True, exclude={"effect_file"})
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes.

    Raises
    ------
    RequestError
        It cannot be read.
    """
    try:
        with regular(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as fault:
        raise RequestError(
            f"{path} cannot be read ({fault.strerror})",
            remedy="put it back, or correct its place in study.toml",
        ) from None


def rig_hash(path: Path) -> str:
    """Hash of a rig file; together with that of the files that it names, if it names some.

    Raises
    ------
    RequestError
        One of them cannot be read.
    """
    hashes = [file_hash(file) for file in rig_files(path)]
    return hashes[0] if len(hashes) == 1 else hashlib.sha256(" ".join(hashes).encode()).hexdigest()


class StudyText:
    """The file as text: changed in place, so that a person's comments and order stay."""

    def __init__(self, path: Path, document: Any = None) -> None:
        self.path = path
        self.document: Any = (
            tomlkit.parse(regular(path).read_text(encoding="utf-8-sig")) if document is None else document
        )

    @classmethod
    def begin(cls, path: Path, content: Mapping[str, Any]) -> StudyText:
        """A new file, not written yet: plain values as keys, lists as arrays of tables."""
        document: Any = tomlkit.document()
        document.add(tomlkit.comment("A specan study. It may be edited; every command reads it anew."))
        text = cls(path, document)
        for key, value in content.items():
            if not _are_tables(value):
                document.add(key, _inline(value))
        document.add(tomlkit.nl())
        for key, value in content.items():
            for entry in value if _are_tables(value) else ():
                text.append(key, entry)
        tidy = re.sub(r"\n{3,}", "\n\n", tomlkit.dumps(document))
        return cls(path, tomlkit.parse(tidy))

    def drop(self, key: str, wanted: Callable[[Any], bool]) -> None:
        """Remove the first entry of ``effect`` or ``effect_file`` that is wanted, and the key with the last one."""
        entries = self.document[key]
        place = next((k for k, entry in enumerate(entries) if wanted(entry)), None)
        if place is not None:
            del entries[place]
        if not entries:
            del self.document[key]

    def set_role(self, use: Use, role: str) -> None:
        """Make a nuisance a part of the model, or the reverse."""
        for entry in self.document["effect"]:
            if use_of(entry) == use:
                entry["role"] = role

    def fix_parameter(self, full_name: str) -> None:
        """Hold a parameter of an effect, or of a quantity, at its value."""
        owner, name = ParameterName(full_name).owner, ParameterName(full_name).own
        place = self.document
        for entry in self.document.get("effect", []):
            if str(use_of(entry)) == owner:
                place = entry
        name = full_name if place is self.document else name
        if "parameters" not in place:
            place.add("parameters", tomlkit.inline_table())
        if name not in place["parameters"]:
            place["parameters"].add(name, tomlkit.inline_table())
        place["parameters"][name]["fixed"] = True

    def set_hash(self, file: str, sha256: str) -> bool:
        """Note the new hash of a file; whether the study names it."""
        entries = [
            e for key in ("measurement", "validation", "effect_file") for e in self.document.get(key, [])
        ]
        named = [entry for entry in entries if entry["file"] == file]
        for entry in named:
            entry["sha256"] = sha256
        return bool(named)

    def copy(self) -> StudyText:
        """The same text, to be changed without changing this one."""
        return StudyText(self.path, tomlkit.parse(self.text))

    @property
    def text(self) -> str:
        """The file's text."""
        return tomlkit.dumps(self.document)

    @property
    def content(self) -> StudyFile:
        """What the text says.

        Raises
        ------
        RequestError
            It has a fault, which is named with its key.
        """
        return parse(StudyFile, self.document.unwrap(), str(self.path))

    def append(self, key: str, entry: Mapping[str, Any]) -> None:
        """Add an entry behind the others of ``effect``, ``measurement`` or the like."""
        made = tomlkit.table()
        for name, value in entry.items():
            made.add(name, _inline(value))
        made.add(tomlkit.nl())
        if key not in self.document:
            self.document.add(key, tomlkit.aot())
        self.document[key].append(made)


def use_of(entry: Any) -> Use:
    """The effect of an entry of the text."""
    return EffectEntry.model_validate(entry.unwrap()).use


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(entry, Mapping) for entry in value)


def _inline(value: Any) -> Any:
    """Tables of parameters on one line each, dotted, so that nothing but effects has a heading."""
    if not isinstance(value, Mapping):
        return value
    inline = tomlkit.inline_table()
    inline.update({k: _inline(v) for k, v in value.items()})
    return inline
