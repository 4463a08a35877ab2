"""The process in which an FMU runs: a crash or a hang in it ends nothing else.

    python -m specan.fmu.worker DIRECTORY

DIRECTORY holds the unpacked FMU. Requests come as pickles on standard input, answers go out on standard output;
what the FMU itself prints goes to standard error.
"""

from __future__ import annotations

import os
import pickle
import sys
import time
from collections.abc import Mapping, Sequence
from io import RawIOBase
from typing import Any, BinaryIO

AT_ROW = "specan_at_row"  # file that says which row is simulated, for who finds the process dead
EVERY_S = 0.05  # answers are sent that often, so that a long table is told from a hang


class Simulator:
    """An FMU that is simulated again and again.

    Parameters
    ----------
    directory : str
        The unpacked FMU.
    names : sequence of str
        Variables that are set, in the order of the numbers in a row.
    outputs : sequence of str
        Variables that are read.
    kind : str
        ``CoSimulation`` or ``ModelExchange``.
    duration, step, average, tolerance : float
        See `specan.fmu.settings.Simulation`.
    """

    def __init__(
        self, directory: str, names: Sequence[str], outputs: Sequence[str], kind: str, duration: float,
        step: float | None, average: float, tolerance: float,
    ) -> None:  # fmt: skip
        from fmpy.model_description import read_model_description

        self.directory, self.names, self.outputs, self.kind = directory, names, outputs, kind
        self.duration, self.step, self.average, self.tolerance = duration, step, average, tolerance
        self.description = read_model_description(directory)
        types = {v.name: v.type for v in self.description.modelVariables}
        self.types = [types[name] for name in names]
        self.instance: Any = None

    def run(self, row: Sequence[float]) -> list[float]:
        """Outputs at the end of one simulation."""
        import numpy as np
        from fmpy import simulate_fmu

        self._fresh_instance()
        start = dict(zip(self.names, map(_typed, row, self.types), strict=True))
        found = simulate_fmu(
            self.directory, validate=False, start_time=0.0, stop_time=self.duration, fmi_type=self.kind,
            output_interval=self.step, step_size=self.step, relative_tolerance=self.tolerance, start_values=start,
            output=list(self.outputs), record_events=False, model_description=self.description,
            fmu_instance=self.instance,
        )  # fmt: skip
        time_axis = found["time"]
        if time_axis[-1] < self.duration * (1 - 1e-6) - (self.step or 0.0):
            raise RuntimeError(f"the simulation ended at {time_axis[-1]:.6g} s of {self.duration:g} s")
        last = time_axis >= time_axis[-1] - self.average * (1 + 1e-9)
        return [float(np.mean(found[name][last])) for name in self.outputs]

    def _fresh_instance(self) -> None:
        from fmpy.simulation import instantiate_fmu

        if self.instance is not None:
            try:
                self.instance.reset()
                return
            except Exception:  # an FMU need not know how to be reset
                self.instance.freeInstance()
        self.instance = instantiate_fmu(self.directory, self.description, self.kind)


def _typed(value: float, kind: str) -> float | int | bool:
    if kind == "Boolean":
        return bool(round(value))
    return value if kind in ("Real", "Float64", "Float32") else round(value)


def main() -> None:
    """Answer requests until standard input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    requests = sys.stdin.buffer
    try:
        simulator = Simulator(sys.argv[1], **pickle.load(requests))
    except Exception as fault:
        _send(answers, fault=f"{type(fault).__name__}: {fault}")
        return
    _send(answers, done=[])
    with open(os.path.join(sys.argv[1], AT_ROW), "wb", buffering=0) as at_row:
        while True:
            try:
                rows = pickle.load(requests)
            except EOFError:
                return
            _answer(simulator, rows, answers, at_row)


def _answer(
    simulator: Simulator, rows: Sequence[Sequence[float]], answers: BinaryIO, at_row: RawIOBase
) -> None:
    done: list[list[float]] = []
    sent = time.perf_counter()
    for number, row in enumerate(rows):
        at_row.seek(0)
        at_row.write(number.to_bytes(8, "little"))
        try:
            done.append(simulator.run(row))
        except Exception as fault:
            _send(answers, done=done, fault=f"{type(fault).__name__}: {fault}")
            simulator.instance = None
            return
        if time.perf_counter() - sent > EVERY_S:
            _send(answers, done=done)
            done, sent = [], time.perf_counter()
    if done:
        _send(answers, done=done)


def _send(answers: BinaryIO, **content: Any) -> None:
    message: Mapping[str, Any] = content
    pickle.dump(message, answers)
    answers.flush()


if __name__ == "__main__":
    main()
