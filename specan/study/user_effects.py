"""A user's own effect and model files: copied into the study, run on a machine only after someone named them there.

An effect file is a program. One that comes with somebody else's study runs only after its content was
named once on this machine; the record of what was named lies outside every study.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import RequestError
from specan.models import Effect, Model, Use
from specan.models.catalogue import content_of, effects_from_file, files_of, model_from_file, source_of
from specan.study.observation import Observation
from specan.study.study_file import EffectFileEntry
from specan.user_folder import user_folder

LAWS = "laws"  # that were proposed


def trust_record() -> Path:
    """File that lists the hashes of effect files that were named on this machine.

    It lies in the user's configuration directory, or where SPECAN_CONFIG_DIR points.
    """
    return user_folder() / "trusted_effects.txt"


def is_trusted(sha256: str) -> bool:
    """Whether an effect file of this content was named on this machine."""
    record = trust_record()
    return record.exists() and sha256 in record.read_text(encoding="utf-8").split()


def trust(sha256: str) -> None:
    """Remember that an effect file was named."""
    if is_trusted(sha256):
        return
    record = trust_record()
    record.parent.mkdir(parents=True, exist_ok=True)
    with record.open("a", encoding="utf-8", newline="\n") as stream:
        stream.write(sha256 + "\n")


def trust_file(path: Path) -> None:
    """Remember that a file was named."""
    trust(hashlib.sha256(content_of(path)).hexdigest())


def write_beside_older(path: Path, content: bytes) -> None:
    """Write a file; one of that name with other content, which its owner may have changed, is kept beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and path.read_bytes() != content:
        old = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
        path.replace(path.with_name(f"{path.name}.{old}"))
    path.write_bytes(content)


def rival_laws(path: Path) -> list[Path]:
    """Laws that were proposed together with an effect file and have not been changed: its rivals in every verdict."""
    beside = sorted(path.parent.glob("law-*.py")) if path.parent.name == LAWS else []
    return [p for p in beside if p != path and is_trusted(hashlib.sha256(p.read_bytes()).hexdigest())]


@dataclass(frozen=True, eq=False)
class EffectFile:
    """A user's effect file that was just named: read and loaded, not yet part of a study.

    Attributes
    ----------
    path : Path
        As the user typed it.
    content : bytes
    effects : tuple of Effect
    """

    path: Path
    content: bytes
    effects: tuple[Effect, ...]

    @property
    def entry(self) -> EffectFileEntry:
        """How a study file names it."""
        sha256 = hashlib.sha256(self.content).hexdigest()
        return EffectFileEntry(file=f"effects/{self.path.name}", sha256=sha256)

    def copy_to(self, directory: Path) -> None:
        """Copy it into a study and trust it; another version of the same name is kept beside it."""
        inside = directory / self.entry.file
        if inside.resolve() != self.path.resolve():
            write_beside_older(inside, self.content)
        trust(self.entry.sha256)


def read_effect_file(path: Path) -> EffectFile:
    """Load a user's effect file; nothing is written.

    Raises
    ------
    RequestError
        It is missing or cannot be loaded.
    """
    content = source_of(path, "effect")
    return EffectFile(path, content, tuple(effects_from_file(path, content)))


def with_own_effects(model: Model, known: Sequence[Effect], named: Sequence[EffectFile]) -> Model:
    """A model with the effects of a study's files, and of files that were just named.

    Raises
    ------
    RequestError
        An effect has the name of one that the model has already, or does not fit the model.
    """
    model = model.with_effect(*known)
    for file in named:
        for effect in file.effects:
            if effect.name in model.effects:
                raise RequestError(
                    f"the effect file {file.path} brings {effect.name!r}, a name that specan uses already",
                    remedy="give your effect another name",
                )
        model = model.with_effect(*file.effects)
    return model


def try_effects(file: EffectFile, model: Model, observations: Sequence[Observation]) -> None:
    """Evaluate each effect of a file once, at its default values, where the data were measured.

    Raises
    ------
    RequestError
        An effect raises, or gives values that are not finite; file and line, or the effect, are named.
    """
    for effect in file.effects:
        use = Use(effect.name, model.axes[effect.at][0] if effect.at else "")
        base = [u for u in model.assemble(model.base_effects).uses if u.name != effect.name]
        for observation in observations:
            # a value that is not finite is told below, with the effect's name
            with np.errstate(all="ignore"):
                without = model.assemble(base).evaluate(observation.conditions)
                with_it = model.assemble([*base, use]).evaluate(observation.conditions)
            for name in effect.changes:
                if not model.quantities[name].comparable:
                    continue
                bad = np.flatnonzero(np.ravel(np.isfinite(without[name]) & ~np.isfinite(with_it[name])))
                if bad.size:
                    raise RequestError(
                        f"the effect file {file.path}: {effect.name!r} makes {name} not finite (nan or inf) in "
                        f"{bad.size} of {np.size(with_it[name])} rows of {observation.name}, first in row {bad[0] + 1}",
                        expected="a finite value wherever something was measured",
                        remedy="look for a division by zero, or a root or logarithm of a negative number",
                    )


def load_own_effects(directory: Path, entries: Sequence[EffectFileEntry]) -> list[Effect]:
    """Load the effect files of a study.

    Raises
    ------
    RequestError
        A file is missing, was changed, or has not been named on this machine.
    """
    effects = []
    for entry in entries:
        path = directory / entry.file
        if not path.exists():
            raise RequestError(
                f"the study's effect file {entry.file} is missing", remedy="put it back, or drop its effects"
            )
        content = _trusted(
            f"effect file {entry.file}",
            entry.sha256,
            path.read_bytes(),
            f"accept the changed file with --effect {path}",
            f"--effect {path}",
        )
        effects += effects_from_file(path, content)
    return effects


def take_in_model(directory: Path, given: Path) -> tuple[str, str]:
    """Copy a model file into a study and trust it: the user has just named it.

    Returns
    -------
    file, sha256 : str
        Its path in the study, and the hash of its content.
    """
    sha256 = hashlib.sha256(content_of(given)).hexdigest()
    for file in files_of(given):
        inside = directory / "model" / file.name
        if inside.resolve() != file.resolve():
            inside.parent.mkdir(parents=True, exist_ok=True)
            inside.write_bytes(file.read_bytes())
    trust(sha256)
    return f"model/{given.name}", sha256


def load_own_model(directory: Path, file: str, sha256: str | None, rig: Mapping[str, Any]) -> Model:
    """Load the model file of a study.

    Raises
    ------
    RequestError
        The file is missing, was changed, or has not been named on this machine.
    """
    path = directory / file
    for needed in files_of(path):
        if not needed.exists():
            raise RequestError(
                f"the study's model file {needed.relative_to(directory).as_posix()} is missing",
                remedy="put it back",
            )
    content = _trusted(
        f"model file {file}",
        sha256,
        content_of(path),
        "begin a new study with it",
        f"specan model check {path}",
    )
    return model_from_file(path, rig, content)


def _trusted(what: str, sha256: str | None, content: bytes, otherwise: str, by: str) -> bytes:
    """Content that is what the study took in, and that has been named on this machine; `by` tells how."""
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise RequestError(
            f"the study's {what} was changed since it was added", remedy=f"restore it, or {otherwise}"
        )
    if not is_trusted(found):
        raise RequestError(
            f"the study brings its own {what}, which has not been run on this machine",
            remedy=f"read it, then name it once with {by}",
        )
    return content
