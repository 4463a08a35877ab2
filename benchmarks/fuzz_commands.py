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

ODD = (
    "", " ", "nan", "inf", "-1", "0", "1e300", "1e-300", "x", "ä=β", "a,b,c", "1:2:3", "/", "9" * 400, "=", "1=nan",
    "..", "None", "0:0", "-inf", "1e5", "3",
)  # fmt: skip
LONGEST_S = 60  # of a command on the small files that are here

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


def made(place: Path) -> None:
    """Good files for all commands: recordings, a table, a model of one's own, and a study."""
    for name, data in fuzz.good_recordings().items():
        (place / name).write_bytes(data)
    (place / "spring.py").write_text(MODEL, encoding="utf-8")
    (place / "rig.toml").write_text(RIG, encoding="utf-8")
    travel = np.repeat(np.linspace(0.1, 1.0, 10), 2)
    force = 2 * travel + 0.4 * travel**3 + 0.01 * np.random.default_rng(1).standard_normal(20)
    np.savetxt(
        place / "t.csv",
        np.column_stack([travel, force, np.tile([1, 2], 10)]),
        "%.6g",
        ",",
        header="travel_m,force_N,repeat",
        comments="",
    )
    for name in RIGS:
        (place / f"{name}.toml").write_text(printed("model", "rig", name), encoding="utf-8")
    printed(*NEW, "good")


def printed(*words: str) -> str:
    """What a command prints that has to work."""
    from click.testing import CliRunner

    from specan_cli.main import main as command

    done = CliRunner().invoke(command, list(words), catch_exceptions=False, standalone_mode=False)
    assert done.exception is None, done.exception
    return done.stdout


RIGS = ("worm-gear", "room", "planetary-gear")
NEW = ("study", "new", "--model", "spring.py", "--rig", "rig.toml", "--measurement", "t.csv", "-q")
# What each command is given beside the option that is tried; commands on studies get a copy of the good one.
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
    "study new": (*NEW[2:], "s"),
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


def tried(values: int, rng: np.random.Generator) -> Iterator[tuple[str, ...]]:
    """Words of a command line each: every flag; every option that takes a value, with some odd ones; every argument."""
    from specan_cli.main import main

    for path, command in commands(main):
        words = (*path.split(), *ARGUMENTS[path])
        for parameter in command.params:
            if isinstance(parameter, click.Option) and (parameter.is_flag or parameter.count):
                yield (*words, parameter.opts[-1])
                continue
            for k in rng.permutation(len(ODD))[:values]:
                if isinstance(parameter, click.Argument):
                    if ODD[k] == "/":  # all that is on the machine takes its time
                        continue
                    yield (*path.split(), ODD[k], *ARGUMENTS[path][1:])
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

    signal.signal(signal.SIGALRM, too_long)
    signal.alarm(LONGEST_S)
    try:
        return fuzz.by_command(*words)
    finally:
        signal.alarm(0)


def on_copies(good: Path, words: tuple[str, ...], change: dict[str, bytes] | None = None) -> list[str]:
    """One command in a copy of the good files, some of them changed; what is wrong with it."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name) / "here"
        shutil.copytree(good, place)
        for file, data in (change or {}).items():
            (place / file).write_bytes(data)
        if words[:1] == ("study",) and words[1] != "new":
            shutil.copytree(place / "good", place / "s")
        before = hashes(place)
        with contextlib.chdir(place):
            faults = in_time(words)
        after = hashes(place)
        touched = [
            file for file, was in before.items() if after.get(file) != was and not file.startswith("s/")
        ]
        return faults + [f"{' '.join(words)}: {file} was changed" for file in touched]


def options(good: Path, values: int, seed: int) -> Iterator[str]:
    """What is wrong with any option of any command."""
    for words in tried(values, np.random.default_rng(seed)):
        yield from on_copies(good, words)


VERBS_OF_STUDIES = ("compare", "diagnose", "propose", "history", "next", "report")


def studies(good: Path, count: int, seed: int) -> Iterator[str]:
    """What is wrong with studies of damaged tables, rig files and models, and with damaged studies."""
    rng = np.random.default_rng([seed, 9])
    for number in range(count):
        file = ("t.csv", "rig.toml", "spring.py")[number % 3]
        damaged = fuzz.mutant(rng, (good / file).read_bytes(), 1 << 20, text=True)
        yield from on_copies(good, (*NEW, "s"), {file: damaged})
        file = ("good/study.toml", "good/history.jsonl", "t.csv")[number % 3]
        damaged = fuzz.mutant(rng, (good / file).read_bytes(), 1 << 20, text=True)
        verb = VERBS_OF_STUDIES[number % len(VERBS_OF_STUDIES)]
        more = ("-o", "r.html") if verb == "report" else ()
        yield from on_copies(good, ("study", verb, "s", *more), {file: damaged})


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
