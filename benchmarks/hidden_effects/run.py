"""Runs cases in worker processes and keeps what they found, one JSON line a case."""

from __future__ import annotations

import hashlib
import importlib
import json
import math
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import specan
import truth
from hidden_effects.benches import Case
from hidden_effects.judge import Record

_SHORTENED_RANKING = 6


def fingerprint() -> str:
    """Of the code that decides: models, study and simulators. Results of different code are not mixed."""
    root = Path(specan.__file__).parent
    digest = hashlib.sha256()
    for part in (root / "models", root / "study", Path(truth.__file__).parent):
        for path in sorted(part.rglob("*.py")):
            digest.update(path.relative_to(part.parent).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def run_case(case: Case, engine: str = "", cache: Path | None = None) -> Record:
    """Simulate, ask for a verdict, measure what the data could know. A failure is a record, not an end.

    Parameters
    ----------
    case : Case
    engine : str
        Module with ``diagnose(case, directory)`` and ``measure(case, truth, directory, verdict)``, which add to the
        record; the case's own by default.
    cache : path, optional
        Directory for what is expensive to simulate.
    """
    module = importlib.import_module(engine or case.engine)
    record: Record = {**case.as_dict(), "key": case.key, "truth": list(case.truth)}
    try:
        truth = case.simulate(cache)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            case.write(truth, folder, cache)
            start = time.process_time()
            verdict = module.diagnose(case, folder)
            record["cpu_s"] = round(time.process_time() - start, 3)
            record["verdict"] = {**verdict, "ranking": verdict["ranking"][:_SHORTENED_RANKING]}
            record |= module.measure(case, truth, folder, verdict)
    except Exception:  # whatever breaks in one case is counted and shown, the others go on
        record["error"] = traceback.format_exc(limit=-3)
    return record


def _run(arguments: tuple[Case, str, Path | None]) -> Record:
    return run_case(*arguments)


def read(path: Path, code: str) -> list[Record]:
    """Records in a result file that the present code has made; a half line at the end is ignored."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        if record.get("code") == code:
            found.append(record)
    return found


def run(
    cases: Sequence[Case], path: Path, workers: int = 2, engine: str = "", cache: Path | None = None
) -> Iterator[Record]:
    """Run what the file does not hold yet, append every result as it comes, and yield all records of the cases.

    Parameters
    ----------
    cases : sequence of Case
        What to run.
    path : Path
        Result file, one JSON object a line.
    workers : int
        Processes; 1 runs in this one.
    engine, cache
        See `run_case`.
    """
    code = fingerprint()
    wanted = {case.key: json.loads(json.dumps(case.as_dict())) for case in cases}
    done = {}
    for record in read(path, code):
        asked = wanted.get(record["key"])
        if asked is not None and all(record[name] == value for name, value in asked.items()):
            done[record["key"]] = record
    yield from done.values()
    left = [(case, engine, cache) for case in cases if case.key not in done]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8", newline="\n") as file:
        for number, record in enumerate(_results(left, workers), 1):
            file.write(json.dumps(_finite({**record, "code": code})) + "\n")
            file.flush()
            if sys.stderr.isatty() or number % 20 == 0 or number == len(left):
                print(f"\r{number} of {len(left)} cases", end="", file=sys.stderr, flush=True)
            yield record
    if left:
        print(file=sys.stderr)


def _results(left: Sequence[tuple[Case, str, Path | None]], workers: int) -> Iterator[Record]:
    if workers <= 1 or len(left) < 2:
        yield from map(_run, left)
        return
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # the cores belong to the workers
        os.environ.setdefault(name, "1")
    with get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(_run, left, chunksize=1)


def _finite(value: Any) -> Any:
    """JSON has no NaN: what is not finite becomes null."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
