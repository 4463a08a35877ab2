"""Which results of an earlier batch still hold."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from specan.analysis.batch.identity import identify, program_identity
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import Kept, Store
from specan.errors import SpecanError
from specan.io.open import channel_table_of

Context = Callable[[Input], str]


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
        kept = store.renew(kept, replace(now, whole=before.whole))
    return kept


def context_of(settings: BatchSettings) -> Context:
    """A function that says of what else than the recording the result of a file is made.

    That is the program, the settings, the calibration, the channel table, and the index file that may
    be told to belong to another recording.
    """
    common = f"{program_identity()}\n{settings.as_json()}"
    read: dict[str, str] = {}

    def digest_of(path: str) -> str:
        if path not in read:
            read[path] = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        return read[path]

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
