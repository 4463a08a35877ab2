"""Diagnoses that were made of a study, kept beside its history: why each step was taken can be read later."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan import __version__
from specan.errors import RequestError
from specan.study.commit import changing
from specan.study.history import finite

if TYPE_CHECKING:
    from specan.study.study import Study
    from specan.study.verdict import Diagnosis

NAME = "diagnoses.jsonl"
STATE = ("study", "rig", "files", "effect_files")


def diagnose_and_keep(
    study: Study, *, bootstrap: bool = False, progress: Callable[[str], None] | None = None
) -> Diagnosis:
    """Diagnose a study and keep what was found; see `keep`."""
    found = study.diagnose(bootstrap=bootstrap, progress=progress)
    keep(study, found)
    return found


def keep(study: Study, found: Diagnosis) -> None:
    """Append a diagnosis, with the state of the study that it is about, to `NAME` in the study's directory.

    Nothing is kept in a directory that cannot be written to, or that another command is changing.
    """
    if diagnosis_of(study.directory, study.hashes) == finite(found.to_json()):
        return
    content = {"version": __version__, "hashes": study.hashes, "diagnosis": finite(found.to_json())}
    line = json.dumps(content, ensure_ascii=False, sort_keys=True) + "\n"
    with (
        contextlib.suppress(OSError, RequestError),
        changing(study.directory),
        (study.directory / NAME).open("a", encoding="utf-8") as file,
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
