"""FMUs that the tests make: in Python by pythonfmu, and in C where there is a compiler."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

HERE = Path(__file__).parent
C_MODEL = HERE / "first_order"

# Steady at once: mu + rise exp(-speed / 20), 0.1 more where `on`. It crashes and hangs on demand.
PYTHON_MODEL = """
import math, os, time
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class drive(Fmi2Slave):
    def __init__(self, **kw):
        super().__init__(**kw)
        self.speed, self.mu, self.rise, self.on, self.torque = 100.0, 1.0, 0.0, False, 0.0
        self.register_variable(Real("speed", causality=Fmi2Causality.input))
        for name in ("mu", "rise"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Boolean("on", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Real("torque", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        print("the FMU talks")
        if self.speed > 900:
            os._exit(7)
        while self.speed > 800:
            time.sleep(1)
        self.torque = self.mu + self.rise * math.exp(-self.speed / 20) + (0.1 if self.on else 0.0) * self.speed / 100
        return True
"""

SETTINGS = """
title = "A drive"

[simulation]
duration = 1.0
step = 0.5

[conditions.speed]
unit = "1/min"
low = 5
high = 300

[observables.torque]
unit = "N*m"
uncertainty = 0.005

[parameters.{friction}]
value = 0.8
min = 0.1
max = 3
unit = "N*m"

[effects.stribeck]
doc = "Below a certain speed the oil film breaks and friction rises."
[effects.stribeck.parameters.rise]
value = 0.3
min = 0.05
max = 2
lower = 0
neutral = 0
unit = "N*m"
"""

SWITCH = """
[effects.extra]
doc = "Something that grows with the speed."
switch = "on"
"""


def python_fmu(folder: Path) -> Path:
    """An FMU of FMI 2 for co-simulation, with its TOML file."""
    pytest.importorskip("pythonfmu")
    pytest.importorskip("fmpy")
    source = folder / "drive_source.py"
    source.write_text(PYTHON_MODEL, encoding="utf-8")
    subprocess.run(
        [sys.executable, "-m", "pythonfmu", "build", "-f", str(source), "-d", str(folder)],
        check=True, capture_output=True,
    )  # fmt: skip
    (folder / "drive.toml").write_text(SETTINGS.format(friction="mu") + SWITCH, encoding="utf-8")
    return folder / "drive.fmu"


def c_fmu(folder: Path) -> Path:
    """An FMU of FMI 3 for co-simulation and model exchange, with its TOML file."""
    fmpy = pytest.importorskip("fmpy")
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("no C compiler that makes a library for FMI 3 here")
    headers = Path(fmpy.__file__).parent / "c-code"
    source = (C_MODEL / "model.c").read_text(encoding="utf-8")
    from fmpy.fmi3 import _FMU3

    # FMPy asks for every function of the standard; those that no test calls answer "error"
    named = [n for n in dir(_FMU3) if re.fullmatch(r"fmi3[A-Z]\w+", n) and f"{n}(" not in source]
    (folder / "rest.c").write_text(
        "".join(f"int {n}(void) {{ return 3; }}\n" for n in named), encoding="utf-8"
    )
    library = folder / "first_order.so"
    subprocess.run(
        [compiler, "-shared", "-fPIC", "-O2", f"-I{headers}", "-o", str(library), str(C_MODEL / "model.c"),
         str(folder / "rest.c"), "-lm"],
        check=True, capture_output=True,
    )  # fmt: skip
    path = folder / "first_order.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(C_MODEL / "modelDescription.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{fmpy.platform_tuple}/first_order.so")
    (folder / "first_order.toml").write_text(SETTINGS.format(friction="friction"), encoding="utf-8")
    return path
