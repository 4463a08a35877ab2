"""An FMU in a process of its own, seen from here: rows of numbers go in, rows of outputs come back, or an error."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import IO, Any

from specan.errors import ComputationError, RequestError
from specan.fmu.worker import AT_ROW, EVERY_S

START_S = 60.0  # for the process to load its libraries and the FMU


class FmuProcess:
    """Simulations of one FMU; the process starts with the first and is started again after a crash.

    Parameters
    ----------
    name : str
        File of the FMU, for messages.
    directory : str
        Where it is unpacked.
    settings : mapping
        Arguments of `specan.fmu.worker.Simulator`.
    time_limit : float
        s for one simulation.
    """

    def __init__(self, name: str, directory: str, settings: Mapping[str, Any], time_limit: float) -> None:
        self.name, self.directory, self.settings, self.time_limit = name, directory, settings, time_limit
        self._process: subprocess.Popen[bytes] | None = None

    def simulate(self, rows: Sequence[Sequence[float]]) -> list[list[float]]:
        """Outputs of every row.

        Raises
        ------
        ComputationError
            The FMU crashes, takes longer than the limit, or reports an error; the values of the row are named.
        RequestError
            It cannot be started.
        """
        self._start()
        assert self._process is not None
        assert self._process.stdin is not None
        found: list[list[float]] = []
        try:
            pickle.dump([list(map(float, row)) for row in rows], self._process.stdin)
            self._process.stdin.flush()
        except OSError:
            self._crashed(rows)
        while len(found) < len(rows):
            answer = self._next(rows)
            found += answer["done"]
            if "fault" in answer:
                self._fail(f"reports an error: {answer['fault']}", rows[len(found)])
        return found

    def stop(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            _end(self._process)
            self._process = None

    def _start(self) -> None:
        if self._process is not None and self._process.poll() is None:
            return
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        self._process = subprocess.Popen(
            [sys.executable, "-m", "specan.fmu.worker", self.directory],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
        )  # fmt: skip
        weakref.finalize(self, _end, self._process)
        self._answers: queue.Queue[dict[str, Any] | None] = queue.Queue()
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        threading.Thread(target=_receive, args=(self._process.stdout, self._answers), daemon=True).start()
        pickle.dump(dict(self.settings), self._process.stdin)
        self._process.stdin.flush()
        try:
            answer = self._answers.get(timeout=START_S)
        except queue.Empty:
            self.stop()
            answer = {"fault": f"it did not load within {START_S:g} s"}
        if answer is None or "fault" in answer:
            said = answer["fault"] if answer else self._last_words().removeprefix(": ")
            self.stop()
            raise RequestError(f"the FMU {self.name} cannot be loaded ({said})")

    def _next(self, rows: Sequence[Sequence[float]]) -> dict[str, Any]:
        try:
            answer = self._answers.get(timeout=self.time_limit + EVERY_S)
        except queue.Empty:
            self.stop()
            self._fail(
                f"takes longer than {self.time_limit:g} s for one simulation and was stopped",
                self._reached(rows),
            )
        if answer is None:
            self._crashed(rows)
        assert answer is not None
        return answer

    def _reached(self, rows: Sequence[Sequence[float]]) -> Sequence[float]:
        """The row that was simulated last."""
        with open(os.path.join(self.directory, AT_ROW), "rb") as file:
            return rows[min(int.from_bytes(file.read(8), "little"), len(rows) - 1)]

    def _crashed(self, rows: Sequence[Sequence[float]]) -> None:
        assert self._process is not None
        code = self._process.wait()
        said = self._last_words()
        self._process = None
        self._fail(
            f"crashed ({'signal ' + str(-code) if code < 0 else 'exit code ' + str(code)}{said})",
            self._reached(rows),
        )

    def _last_words(self) -> str:
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").strip().splitlines()
        return f": {lines[-1][:200]}" if lines else ""

    def _fail(self, what: str, row: Sequence[float]) -> None:
        place = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.settings["names"], row, strict=True))
        raise ComputationError(
            f"the FMU {self.name} {what}, at {place}",
            remedy="narrow the limits in its TOML file to where it works, or raise time_limit",
        )


def _receive(stream: IO[bytes], answers: queue.Queue[dict[str, Any] | None]) -> None:
    try:
        while True:
            answers.put(pickle.load(stream))
    except Exception:  # the end of the process, in whatever state its last answer is
        answers.put(None)


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):  # a request that was never read
                stream.close()
