"""The process in which an FMU runs: a crash or a hang in it ends nothing else.

    python -m specan.fmu.worker DIRECTORY

DIRECTORY holds the unpacked FMU. Requests come as pickles on standard input: the settings, then one row of values after
the other. Answers go out on standard output: outputs, or a text that says what failed; what the FMU itself prints goes
to standard error.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Mapping, Sequence
from typing import Any


class Simulator:
    """An FMU that is simulated again and again.

    Parameters
    ----------
    directory : str
        The unpacked FMU.
    settings : mapping
        ``names`` of the variables that a row holds values of, ``outputs``, ``kind`` (``CoSimulation`` or
        ``ModelExchange``), ``duration``, ``step``, ``average`` (all in s) and ``tolerance``.
    """

    def __init__(self, directory: str, settings: Mapping[str, Any]) -> None:
        from fmpy.model_description import read_model_description

        self.directory, self.settings = directory, settings
        self.description = read_model_description(directory)
        types = {v.name: v.type for v in self.description.modelVariables}
        self.types = [types[name] for name in settings["names"]]
        self.instance: Any = None

    def run(self, row: Sequence[float]) -> list[float]:
        """Outputs at the end of one simulation."""
        import numpy as np
        from fmpy import simulate_fmu

        given = self.settings
        self._fresh_instance()
        found = simulate_fmu(
            self.directory, validate=False, start_time=0.0, stop_time=given["duration"], fmi_type=given["kind"],
            output_interval=given["step"], step_size=given["step"], relative_tolerance=given["tolerance"],
            start_values=dict(zip(given["names"], map(_typed, row, self.types), strict=True)),
            output=list(given["outputs"]), record_events=False, model_description=self.description,
            fmu_instance=self.instance,
        )  # fmt: skip
        time = found["time"]
        if time[-1] < given["duration"] * (1 - 1e-6) - (given["step"] or 0.0):
            raise RuntimeError(f"the simulation ended at {time[-1]:.6g} s of {given['duration']:g} s")
        last = time >= time[-1] - given["average"] * (1 + 1e-9)
        return [float(np.mean(found[name][last])) for name in given["outputs"]]

    def _fresh_instance(self) -> None:
        from fmpy.simulation import instantiate_fmu

        if self.instance is not None:
            try:
                self.instance.reset()
                return
            except Exception:  # an FMU need not know how to be reset
                self.instance.freeInstance()
        self.instance = instantiate_fmu(self.directory, self.description, self.settings["kind"])


def _typed(value: float, kind: str) -> float | int | bool:
    if kind == "Boolean":
        return bool(round(value))
    return value if kind in ("Real", "Float64", "Float32") else round(value)


def main() -> None:
    """Answer requests until standard input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    simulator: Simulator | None = None
    while True:
        try:
            request = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        answer: list[float] | str = []
        try:
            if simulator is None:
                simulator = Simulator(sys.argv[1], request)
            else:
                answer = simulator.run(request)
        except Exception as fault:  # whatever the FMU or its library raises
            answer = f"{type(fault).__name__}: {fault}"
            if simulator is not None:
                simulator.instance = None
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
