"""Every option of every command with values that nobody means, and studies over damaged tables and files.

    python benchmarks/fuzz_commands.py --values 14 --mutants 40 --seed 1

A command must answer or say what is wrong, in a sentence and in time; none may end in an error of its own, or touch a
file that it was only to read.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import click
import fuzz
import numpy as np
import scipy.signal

ODD = (
    "", " ", "nan", "inf", "-1", "0", "1e300", "1e-300", "x", "ä=β", "a,b,c", "1:2:3", "/", "9" * 400, "=", "1=nan",
    "..", "None", "0:0", "-inf", "1e5", "3",
)  # fmt: skip
LONGEST_S = 60  # of the processor, of a command on the small files that are here

MODEL = '''"""A spring."""
from specan.models import Condition, Model, Observable, Parameter, effect, quantity

@quantity(unit="N")
def force(travel, *, rate=Parameter(2.0, "N/m", min=0.1, max=10.0, doc="of the spring")):
    """Of the spring."""
    return rate * travel

@effect("stiffening", adds_to="force", neutral={"cubic": 0.0})
def stiffening(travel, *, cubic=Parameter(0.5, "N/m^3", min=0.0, max=5.0, doc="of the wire")):
    """Coils touch."""
    return cubic * travel**3

MODEL = Model(
    name="spring", title="A spring", quantities={"force": force}, effects={"stiffening": stiffening},
    conditions={"travel": Condition("travel", "m", "Travel.", "travel_m", "m")},
    observables={"force": Observable("force", "force", "N", "Force.", column="force_N", column_unit="N")},
)
'''
RIG = "[uncertainty]\nforce_N = 0.01\n"
RATES = '''"""A mass on a spring."""
from specan.models import Model, Parameter, Signal, State, effect

@effect("cubic-spring", adds_to="spring", neutral={"size": 0.0})
def cubic(x, *, size=Parameter(1e7, "N/m^3", min=1e5, max=1e9, lower=-1e10, upper=1e10)):
    """A spring that hardens."""
    return size * x**3

def spring(x, stiffness): return stiffness * x
def dx(v): return v
def dv(force, spring, v, damping): return force - spring - damping * v

model = Model.from_rates(
    dx, dv, spring, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
    observables={"x": Signal("mm", 1.0)},
    parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m")}, units={"spring": "N"},
    effects=[cubic],
)
'''
SIX = '''"""A load of six travels."""
from specan.models import Condition, Model, Parameter, effect

@effect("square", adds_to="load", neutral={"size": 0.0})
def square(u, *, size=Parameter(0.1, "N/mm^2", min=0, max=1)):
    """A square."""
    return size * u**2

def load(u, v, w, x, y, z, rate): return rate * (u + v + w + x + y + z)

model = Model.from_function(
    load, conditions={n: Condition(n, "mm", n, n, "mm") for n in "uvwxyz"}, observables={"load": ("N", 0.1)},
    parameters={"rate": (2.0, 0.5, 5, "N/mm")}, effects=[square],
)
'''
SIX_RIG = "[limits]\n" + "".join(f"{name} = [0, 10]\n" for name in "uvwxyz")
# A study of each kind, by its directory: what it is made of, and an effect of its model.
STUDIES = {
    "s": ("--model spring.py --rig rig.toml --measurement t.csv", "stiffening"),
    "r": ("--model rates.py --measurement force.csv", "cubic-spring"),
    "c": ("--model six.py --rig six.toml --measurement six.csv", "square"),
}


def made(place: Path) -> None:
    """Good files for all commands: recordings, a table, a model of one's own, and a study."""
    for name, data in fuzz.good_recordings().items():
        (place / name).write_bytes(data)
    (place / "spring.py").write_text(MODEL, encoding="utf-8")
    (place / "rig.toml").write_text(RIG, encoding="utf-8")
    (place / "rates.py").write_text(RATES, encoding="utf-8")
    (place / "six.py").write_text(SIX, encoding="utf-8")
    (place / "six.toml").write_text(SIX_RIG, encoding="utf-8")
    rng = np.random.default_rng(1)
    travel = np.repeat(np.linspace(0.1, 1.0, 10), 2)
    force = 2 * travel + 0.4 * travel**3 + 0.01 * rng.standard_normal(20)
    table(place / "t.csv", "travel_m,force_N,repeat", travel, force, np.tile([1, 2], 10))
    time, drive = np.arange(400) / 500, 30 * rng.standard_normal(400)
    answer = 1e3 * scipy.signal.lsim(([1.0], [1.0, 20.0, 1e4]), drive, time)[1]
    table(place / "force.csv", "time [s],force [N],x [mm]", time, drive, answer + rng.standard_normal(400))
    six = rng.uniform(1, 10, (6, 40))
    load = 2 * six.sum(axis=0) + 0.1 * six[0] ** 2 + 0.1 * rng.standard_normal(40)
    table(place / "six.csv", "u,v,w,x,y,z,load", *six, load)
    for name in RIGS:
        (place / f"{name}.toml").write_text(printed("model", "rig", name), encoding="utf-8")
    for name in STUDIES:
        printed(*new(name), name)


def table(path: Path, head: str, *columns: np.ndarray) -> None:
    """Columns as CSV."""
    np.savetxt(path, np.column_stack(columns), "%.6g", ",", header=head, comments="")


def new(study: str) -> tuple[str, ...]:
    """The command that makes a study, but for its directory."""
    return ("study", "new", *STUDIES[study][0].split(), "-q")


def printed(*words: str) -> str:
    """What a command prints that has to work."""
    from click.testing import CliRunner

    from specan_cli.main import main as command

    done = CliRunner().invoke(command, list(words), catch_exceptions=False, standalone_mode=False)
    assert done.exception is None, done.exception
    return done.stdout


RIGS = ("worm-gear", "room", "planetary-gear")
# What each command is given beside the option that is tried; `model` and `study` also of the other kinds.
ARGUMENTS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(
        ("info", "octave", "fft", "frf", "tones", "impulse", "rms", "srs", "decay"), ("noise.tdms",)
    ),
    "orders": ("timed.tdms", "--speed", "10"),
    "calibrate": ("calibrator.tdms",),
    "export": ("noise.tdms", "-o", "out.csv"),
    "batch": ("noise.tdms", "-o", "out"),
    "model list": (),
    "model show": ("spring.py",),
    "model rig": ("worm-gear",),
    "model new": ("new.py",),
    "model check": ("spring.py",),
    "simulate worm-gear": ("worm-gear.toml", "-o", "simulated.csv"),
    "simulate room": ("room.toml", "-o", "room.tdms", "--duration", "0.2"),
    "simulate planetary-gear": ("planetary-gear.toml", "-o", "gear.tdms", "--duration", "0.1"),
    "study new": (*new("s")[2:], "n"),
    "study add": ("s", "stiffening"),
    "study drop": ("s", "stiffening"),
    **{
        f"study {verb}": ("s",) for verb in ("compare", "diagnose", "propose", "history", "next", "impedance")
    },
    "study report": ("s", "-o", "r.html"),
    "conformance": (),
    "demo": ("samples",),
}
SERVES = {"inspect"}  # a page until somebody stops it


def commands(group: click.Group, path: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Every command below a group, by its words."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))
        elif command is not None and not SERVES & {*path, name}:
            yield " ".join((*path, name)), command


def beginnings(main: click.Group) -> Iterator[tuple[str, click.Command, tuple[str, ...]]]:
    """Every command with its arguments: those of models and studies with a table, rates and six conditions."""
    for path, command in commands(main):
        given = ARGUMENTS[path]
        yield path, command, given
        for study, (_, effect) in list(STUDIES.items())[1:]:
            other = {"s": study, "stiffening": effect, "spring.py": {"r": "rates.py", "c": "six.py"}[study]}
            if path == "study new":
                yield path, command, (*new(study)[2:], "n")
            elif other.keys() & set(given):
                yield path, command, tuple(other.get(word, word) for word in given)


def tried(values: int, rng: np.random.Generator) -> Iterator[tuple[str, ...]]:
    """Words of a command line each: every flag; every option that takes a value, with some odd ones; every argument."""
    from specan_cli.main import main

    for path, command, given in beginnings(main):
        words = (*path.split(), *given)
        for parameter in command.params:
            if isinstance(parameter, click.Option) and (parameter.is_flag or parameter.count):
                yield (*words, parameter.opts[-1])
                continue
            for k in rng.permutation(len(ODD))[:values]:
                if isinstance(parameter, click.Argument):
                    if ODD[k] == "/":  # all that is on the machine takes its time
                        continue
                    yield (*path.split(), ODD[k], *given[1:])
                else:
                    yield (*words, parameter.opts[-1], ODD[k])


def hashes(place: Path) -> dict[str, str]:
    """Of the good files."""
    return {
        str(path.relative_to(place)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(place.rglob("*"))
        if path.is_file()
    }


def in_time(words: tuple[str, ...]) -> list[str]:
    """What is wrong with how a command ends, or that it does not."""

    def too_long(*_: object) -> None:
        raise TimeoutError(f"no end within {LONGEST_S} s")

    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, too_long)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    signal.alarm(10 * LONGEST_S)  # a busy machine takes longer, and what waits takes no time of the processor
    try:
        return fuzz.by_command(*words)
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)


def on_copies(good: Path, words: tuple[str, ...], change: dict[str, bytes] | None = None) -> list[str]:
    """One command in a copy of the good files, some of them changed; what is wrong with it."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name) / "here"
        shutil.copytree(good, place)
        for file, data in (change or {}).items():
            (place / file).write_bytes(data)
        before = hashes(place)
        with contextlib.chdir(place):
            faults = in_time(words)
        after = hashes(place)
        own = tuple(f"{name}/" for name in STUDIES if words[:1] == ("study",) and name in words)
        touched = [
            file for file, was in before.items() if after.get(file) != was and not file.startswith(own)
        ]
        return faults + [f"{' '.join(words)}: {file} was changed" for file in touched]


def options(good: Path, values: int, seed: int) -> Iterator[str]:
    """What is wrong with any option of any command."""
    lines = list(tried(values, np.random.default_rng(seed)))
    for k in np.random.default_rng([seed, 8]).permutation(
        len(lines)
    ):  # a run that is ended has tried all verbs
        yield from on_copies(good, lines[k])


VERBS_OF_STUDIES = ("compare", "diagnose", "propose", "history", "next", "report")


def studies(good: Path, count: int, seed: int) -> Iterator[str]:
    """What is wrong with studies of damaged tables, rig files and models, and with damaged studies."""
    rng = np.random.default_rng([seed, 9])
    for number in range(count):
        study = list(STUDIES)[number // 3 % 3]
        of = [word for word in STUDIES[study][0].split() if "." in word]
        file = of[number % len(of)]
        damaged = fuzz.mutant(rng, (good / file).read_bytes(), 1 << 20, text=True)
        yield from on_copies(good, (*new(study), "n"), {file: damaged})
        file = (f"{study}/study.toml", f"{study}/history.jsonl", of[-1])[number % 3]
        damaged = fuzz.mutant(rng, (good / file).read_bytes(), 1 << 20, text=True)
        verb = VERBS_OF_STUDIES[number % len(VERBS_OF_STUDIES)]
        more = ("-o", "r.html") if verb == "report" else ()
        yield from on_copies(good, ("study", verb, study, *more), {file: damaged})


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--values", type=int, default=len(ODD), help="odd values for each option")
    parser.add_argument("--mutants", type=int, default=200, help="damaged tables, rigs, models, studies")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        good = Path(name)
        with contextlib.chdir(good):
            made(good)
        for found in (options(good, chosen.values, chosen.seed), studies(good, chosen.mutants, chosen.seed)):
            for text in found:
                wrong += 1
                print(text[:300], flush=True)
    print(f"{wrong} faults")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
