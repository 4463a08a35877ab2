"""An FMU in a process of its own, seen from here: rows of numbers go in, rows of outputs come back, or an error."""

from __future__ import annotations

import contextlib
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
        RequestError
            The FMU cannot be loaded.
        ComputationError
            It crashed, hangs, or reports an error; names the row.
        """
        self._start()
        found = []
        for row in rows:
            answer, fault = self._ask(list(map(float, row)), self.time_limit)
            if fault:
                place = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.settings["names"], row, strict=True))
                raise ComputationError(
                    f"the FMU {self.name} {fault}, at {place}",
                    remedy="narrow the limits in its TOML file to where it works, or raise time_limit",
                )
            found.append(answer)
        return found

    def _start(self) -> None:
        if self._process is not None and self._process.poll() is None:
            return
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        self._process = subprocess.Popen(
            [sys.executable, "-m", "specan.fmu.worker", self.directory],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
        )  # fmt: skip
        weakref.finalize(self, _end, self._process)
        self._answers: queue.Queue[Any] = queue.Queue()
        assert self._process.stdout is not None
        threading.Thread(target=_receive, args=(self._process.stdout, self._answers), daemon=True).start()
        _, fault = self._ask(dict(self.settings), START_S)
        if fault:
            _end(self._process)
            raise RequestError(f"the FMU {self.name} cannot be loaded: it {fault}")

    def _ask(self, request: Any, limit_s: float) -> tuple[Any, str]:
        """The answer to a request; or what became of the FMU."""
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            pickle.dump(request, self._process.stdin)
            self._process.stdin.flush()
            answer = self._answers.get(timeout=limit_s)
        except OSError:
            answer = None
        except queue.Empty:
            _end(self._process)
            return None, f"takes longer than {limit_s:g} s for one simulation and was stopped"
        if answer is None:
            code = self._process.wait()
            self._errors.seek(0)
            said = self._errors.read().decode("utf-8", "replace").strip().splitlines()[-1:]
            how = [f"signal {-code}" if code < 0 else f"exit code {code}", *(line[:200] for line in said)]
            return None, f"crashed ({': '.join(how)})"
        return answer, f"reports an error: {answer}" if isinstance(answer, str) else ""


def _receive(stream: IO[bytes], answers: queue.Queue[Any]) -> None:
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
