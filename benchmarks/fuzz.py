"""Damaged recordings and tables through a batch: none may cost another file its result.

    python benchmarks/fuzz.py --tdms 3000 --text 2000 --wav 800 --seed 1

Mutants lie in batches of `--together` beside a good recording. A batch must end, every mutant must
have a result or stand in `skipped.txt`, and the lines of the good recording must be those of a batch without mutants.
Every verb is then given mutants, and must answer or say what is wrong; and good channels beside a bad one,
whose results must be those that they have alone.
"""

from __future__ import annotations

import argparse
import csv
import os
import shutil
import struct
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from specan.data.recording import Recording

# Values that a damaged length, count, offset or property takes.
_NUMBERS = (
    0, 1, 2, 255, 1 << 15, (1 << 16) - 1, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, 1 << 40,
    (1 << 62), (1 << 63) - 1, 1 << 63, (1 << 64) - 1,
)  # fmt: skip
_FLOATS = (0.0, -0.0, float("nan"), float("inf"), -float("inf"), 5e-324, 1e-300, 1e300, -1.0, 1.0)
_TEXTS = (
    b"nan", b"inf", b"-inf", b"0", b"-1", b"1e300", b"1e-300", b"1e999", b"", b'"', b"'", b"[", b"]", b"{", b"#", b"=",
    b"\n", b"\t", b"\x00", b"\xff", b",", b";", b"9" * 400, b"[" * 2000, b"true", b"1979-13-45",
    b"\xef\xbb\xbf",
)  # fmt: skip


def good_recordings() -> dict[str, bytes]:
    """Seeds of the mutants: TDMS of several kinds, WAV, CSV and MAT, all small."""
    import scipy.io
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    from truth.rig import box_rig, calibrator_take, noise_take, sine_take
    from truth.rig_files import write_tdms

    rig, few = box_rig(), ("Mic 1", "Vibrometer", "Generator")
    found = {}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        write_tdms(place / "sine.tdms", rig, sine_take(rig, 250.0, 1.0, 3000, 4000.0, 1).only(few))
        write_tdms(place / "noise.tdms", rig, noise_take(rig, 1.0, 9000, 4000.0, 2).only(few))
        write_tdms(
            place / "floats.tdms",
            rig,
            sine_take(rig, 250.0, 1.0, 3000, 4000.0, 3).only(few),
            samples="float32",
        )
        write_tdms(place / "calibrator.tdms", rig, calibrator_take(rig, (1, 2), 9000, 4000.0, 4))
        rng = np.random.default_rng(5)
        with TdmsWriter(str(place / "timed.tdms")) as writer:
            time_s = np.arange(600) / 1000.0
            for _ in range(2):
                writer.write_segment(
                    [
                        RootObject({"fs": 1000.0}),
                        GroupObject("g"),
                        ChannelObject("g", "Time", time_s),
                        ChannelObject("g", "Mic 1", rng.standard_normal(600), {"unit_string": "Pa"}),
                        ChannelObject("g", "text", ["a", "b"]),
                    ]
                )
        table = np.column_stack([np.arange(600) / 1000.0, rng.standard_normal((600, 2))])
        np.savetxt(place / "a.csv", table, "%.6g", ",", header="Time (s),Mic 1 (Pa),Mic 2 (Pa)", comments="")
        scipy.io.savemat(place / "a.mat", {"fs": 1000.0, "Mic1": table[:, 1], "Mic2": table[:, 2]})
        for path in sorted(place.iterdir()):
            found[path.name] = path.read_bytes()
    for bits in (16, 24, 32):
        samples = rng.integers(-(2 ** (bits - 1)), 2 ** (bits - 1), (2000, 2))
        data = b"".join(int(x).to_bytes(bits // 8, "little", signed=True) for x in samples.ravel())
        form = struct.pack("<HHIIHH", 1, 2, 4000, 4000 * bits // 4, bits // 4, bits)
        body = b"WAVEfmt " + struct.pack("<I", 16) + form + b"data" + struct.pack("<I", len(data)) + data
        found[f"pcm{bits}.wav"] = b"RIFF" + struct.pack("<I", len(body)) + body
    return found


KINDS = ("tdms", "text", "wav", "csv", "mat")
HEADERS = {"tdms": 3000, "csv": 400, "mat": 600}  # bytes in which most of the damage is done
TABLES = {
    "channels.toml": b"""schema = 1
[[channel]]
channel = "Mic *"
unit = "Pa"
sensitivity = 50.0
sensitivity_unit = "mV/Pa"
delay_s = 1e-4
sampling_rate_hz = 4000.0
[[channel]]
channel = "Generator"
gain = 2.0
unit = "V"
role = "generator"
full_scale = 10.0
""",
    "channels.csv": b"channel,unit,gain,role,delay_s,u_delay_s,sampling_rate_hz,u_sensitivity_percent\n"
    b"Mic 1,Pa,20,microphone,0.0001,0.00001,4000,1\nGenerator,V,2,generator,0,0,4000,0\n",
    "calibration.toml": b"""schema = 1
made_from = ["a.tdms"]
calibrator_frequency_hz = 1000.0
[[channel]]
channel = "Mic 1"
sensitivity = 49.0
unit = "mV/Pa"
u_sensitivity_percent = 0.5
tone_hz = [250.0, 1000.0]
phase_deg = [0.5, 1.0]
u_phase_deg = [0.1, 0.1]
phase_model = "delay"
phase_group = "Mic 1"
verdict = "good"
""",
}


def mutant(rng: np.random.Generator, seed: bytes, header: int, *, text: bool) -> bytes:
    """One to four changes, most of them in the first `header` bytes."""
    found = bytearray(seed)
    for _ in range(int(rng.integers(1, 5))):
        reach = min(len(found), header) if rng.random() < 0.8 else len(found)
        place = int(rng.integers(0, max(reach, 1)))
        kind = int(rng.integers(0, 8))
        if kind == 0:
            del found[place:]
        elif kind == 1:
            del found[place : place + int(rng.integers(1, 40))]
        elif kind == 2:
            found[place:place] = found[place : place + int(rng.integers(1, 400))]
        elif kind == 3:
            found[place : place + 1] = bytes([int(rng.integers(0, 256))])
        elif text:
            old = int(rng.integers(0, 8))
            found[place : place + old] = _TEXTS[int(rng.integers(0, len(_TEXTS)))]
        else:
            big, number = bool(rng.integers(0, 2)), _NUMBERS[int(rng.integers(0, len(_NUMBERS)))]
            size = 4 if kind == 4 else 8
            new = (number % (1 << 8 * size)).to_bytes(size, "big" if big and kind == 6 else "little")
            if kind == 7:
                new = struct.pack("<d", _FLOATS[int(rng.integers(0, len(_FLOATS)))])
            found[place : place + size] = new
    if not text and rng.random() < 0.15:  # a next segment that was begun and never finished
        found += b"TDSm" + struct.pack(
            "<IIQQ", 0xE, 4713, *(_NUMBERS[int(k)] for k in rng.integers(0, 15, 2))
        )
    return bytes(found)


def mutants(kind: str, count: int, seed: int) -> Iterator[dict[str, bytes]]:
    """Files of each mutant, by their names in a directory of its own."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    recordings = good_recordings()
    if kind == "text":
        names = sorted(TABLES)
        for number in range(count):
            name = names[number % len(names)]
            yield {name: mutant(rng, TABLES[name], 1 << 20, text=True), "a.tdms": recordings["sine.tdms"]}
        return
    names = sorted(name for name in recordings if name.endswith(kind))
    for number in range(count):
        data = recordings[names[number % len(names)]]
        yield {f"a.{kind}": mutant(rng, data, HEADERS.get(kind, 60), text=kind == "csv")}


def run_together(
    files: list[dict[str, bytes]], good: bytes, place: Path, fault: Callable[[str], None]
) -> Counter:
    """One batch over mutants and a good recording; what is wrong goes to `fault`."""
    from specan.analysis.batch.run import run_batch

    shutil.rmtree(place, ignore_errors=True)
    (place / "in" / "good").mkdir(parents=True)
    (place / "in" / "good" / "good.tdms").write_bytes(good)
    # Its own calibration: recordings of a calibrator among the mutants that are whole enough hold for the others.
    (place / "in" / "good" / "calibration.toml").write_bytes(TABLES["calibration.toml"])
    for number, names in enumerate(files):
        (place / "in" / f"m{number:04d}").mkdir()
        for name, data in names.items():
            (place / "in" / f"m{number:04d}" / name).write_bytes(data)
    try:
        report = run_batch([place / "in"], place / "out", jobs=1)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        fault(f"the batch ended: {type(error).__name__}: {error}")
        return Counter(ended=1)
    kinds = {result.label: result.kind for result in report.results}
    wanted = {f"m{n:04d}/{name}" for n, names in enumerate(files) for name in names if name[:2] == "a."}
    for label in sorted((wanted | {"good/good.tdms"}) - set(kinds)):
        fault(f"{label} stands nowhere")
    if kinds.get("good/good.tdms") != "done":
        fault("the good recording has no result")
    listed = {row[0] for row in _rows(place / "out" / "skipped.txt")}
    for label in sorted(label for label, kind in kinds.items() if kind != "done" and label not in listed):
        fault(f"{label} is {kinds[label]} and not in skipped.txt")
    reasons = [r.reason for r in report.results if "does not know" in r.reason]
    for reason in reasons:
        print(f"  unforeseen, kept to its file: {reason[:150]}")
    return Counter(kinds.values()) + Counter(unforeseen=len(reasons))


def lines_of_good(out: Path) -> list[str]:
    """The lines of the good recording in all tables."""
    found = []
    for table in sorted(out.glob("*.txt")):
        found += [line for line in table.read_text(encoding="utf-8").split("\n") if line.startswith("good/")]
    return found


def fuzz(kind: str, count: int, seed: int, together: int, place: Path) -> tuple[Counter, list[str]]:
    """Counts of results, and what was wrong."""
    good = good_recordings()["noise.tdms"]
    faults: list[str] = []
    run_together([], good, place, faults.append)
    alone, total, batch = lines_of_good(place / "out"), Counter[str](), 0
    assert alone
    waiting: list[dict[str, bytes]] = []
    every = mutants(kind, count, seed)
    while waiting or batch == 0:
        waiting = [files for _, files in zip(range(together), every, strict=False)]
        if not waiting:
            break
        here: list[str] = []
        total += run_together(waiting, good, place, here.append)
        if lines_of_good(place / "out") != alone:
            here.append("the lines of the good recording differ")
        here = [f"{kind} batch {batch}: {text}" for text in here]
        faults += here
        for text in here:
            print(text, file=sys.stderr)
        batch += 1
    return total, faults


RATE, SECONDS = 8000, 2
# Analyses, the signal that they are for, and what of their result belongs to a channel.
VERBS: dict[str, tuple[str, str, dict]] = {
    "octave": ("knock", "level_dB", {}),
    "fft": ("noise", "density", {"lines": 400}),
    "spectrogram": ("noise", "level_dB", {}),
    "frf": ("noise", "response", {}),
    "rms": ("knock", "rms", {}),
    "tones": ("tone", "magnitude", {}),
    "orders": ("turning", "amplitude", {"orders": (1, 2)}),
    "calibrate": ("calibrator", "sensitivity", {}),
    "impulse": ("noise", "samples", {}),
    "decay": ("knock", "t20_s", {}),
    "srs": ("shock", "maximax", {}),
    "info": ("knock", "", {}),
    "export": ("knock", "", {}),
}
# What is tried of those that are commands only; {out} is a place to write to.
COMMANDS = {
    "info": (("--levels", "--json"), ("--all",)),
    "export": tuple(("-o", f"{{out}}.{form}") for form in ("csv", "wav", "uff")),
}
RATES = ("nan", "inf", "-inf", "0", "-51200", "1", "44099", "1e300", "5e-324", "x", "")


def good_channels(signal: str) -> dict[str, tuple[np.ndarray, str, str]]:
    """Samples, role and unit of channels that a verb can do something with."""
    rng, t = np.random.default_rng(1), np.arange(RATE * SECONDS) / RATE
    white = rng.standard_normal(t.size)
    mic = {
        "knock": np.where(t > 0.1, white * 10 ** (-3 * (t - 0.1) / 0.5), 0.0),
        "shock": np.where((t > 0.1) & (t < 0.11), 50.0, 0.0) + 0.01 * white,
        "noise": 2 * np.roll(white, 3) + 0.01 * rng.standard_normal(t.size),
        "tone": 2 * np.sin(2 * np.pi * 250 * t),
        "turning": np.sin(2 * np.pi * 50 * t),
        "calibrator": 0.07 * np.sin(2 * np.pi * 1000 * t) + 1e-5 * white,
    }[signal]
    beside = {
        "noise": ("Vibrometer", (white, "vibrometer", "m/s")),
        "tone": ("Vibrometer", (np.sin(2 * np.pi * 250 * t), "vibrometer", "m/s")),
        "turning": ("Tacho", (5.0 * ((t * 50) % 1 < 0.5), "tacho", "V")),
    }
    other = dict([beside[signal]]) if signal in beside else {}
    return {"Mic": (mic, "microphone", {"calibrator": "V", "shock": "m/s^2"}.get(signal, "Pa")), **other}


def bad_channels() -> dict[str, np.ndarray]:
    """Samples that nothing can be made of: constant, not finite, out of range, too few."""
    white = np.random.default_rng(2).standard_normal(RATE * SECONDS)
    one = np.arange(white.size) == 7
    return {
        "constant": np.full(white.size, 0.3),
        "zeros": np.zeros(white.size),
        "NaN": np.full(white.size, np.nan),
        "one NaN": np.where(one, np.nan, white),
        "one infinity": np.where(one, np.inf, white),
        "huge": 1e300 * white,
        "tiny": 1e-300 * white,
        **{f"{n} samples": white[:n] for n in (0, 1, 2, 17, 500)},
    }


def of_mic(verb: str, channels: dict[str, tuple[np.ndarray, str, str]]) -> np.ndarray:
    """What a verb finds for the channel "Mic"."""
    import specan
    from specan.data.channel import Channel
    from specan.data.recording import ArraySource

    _, name, settings = VERBS[verb]
    described = tuple(
        Channel(
            label, unit=unit, role=role, sampling_rate=RATE, n_samples=samples.size,
            raw_unit="V" if unit == "V" else "", properties={"PulsesPerRevolution": 1} if role == "tacho" else {},
        )
        for label, (samples, role, unit) in channels.items()
    )  # fmt: skip
    source = ArraySource([samples for samples, _, _ in channels.values()])
    if verb in COMMANDS:
        return of_mic_by_command(verb, specan.Recording("fuzz", described, source))
    found = getattr(specan, verb)(specan.Recording("fuzz", described, source), **settings)
    if verb == "calibrate":
        return np.array([c.sensitivity for c in found.channels if c.channel == "Mic"])
    row = [getattr(c, "name", c) for c in found.channels].index("Mic")
    return np.asarray(getattr(found, name))[row]


def of_mic_by_command(verb: str, recording: Recording) -> np.ndarray:
    """The levels that `info` finds for the channel "Mic", or its samples as they are exported."""
    from specan.analysis.quality import rms_and_quality
    from specan.analysis.section import of_one_rate
    from specan.io.export_file import Excerpt, write_excerpt

    place = [channel.name for channel in recording.channels].index("Mic")
    if verb == "info":
        rms, quality = rms_and_quality(recording)[place]
        return np.array([rms, quality.minimum, quality.maximum, len(quality.flags)])
    chosen = of_one_rate(recording, ())[0]
    excerpt = Excerpt(recording, chosen, 0, min(channel.n_samples for channel in chosen))
    with tempfile.TemporaryDirectory() as name:
        write_excerpt(excerpt, Path(name) / "a.csv")
        with (Path(name) / "a.csv").open(encoding="utf-8", newline="") as file:
            head, *rows = (row for row in csv.reader(file) if row and not row[0].startswith("#"))
    column = next(k for k, title in enumerate(head) if title.startswith("Mic"))
    return np.array([float(row[column]) for row in rows])


def by_command(*words: str) -> list[str]:
    """What is wrong with how a command ends: with anything but a result or a message."""
    import click
    from click.testing import CliRunner

    from specan.errors import SpecanError
    from specan_cli.main import main as command

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            CliRunner().invoke(command, list(words), catch_exceptions=False, standalone_mode=False)
    except SpecanError as error:
        return [f"{' '.join(words)}: {error}"] if error.exit_code == 4 else []
    except click.ClickException:
        return []
    except Exception as error:
        return [f"{' '.join(words)}: {type(error).__name__}: {error}"]
    return []


def beside_bad_channels(verb: str, bad: dict[str, np.ndarray]) -> list[str]:
    """Where a channel has another result, or none, because another one is bad."""
    good, faults = good_channels(VERBS[verb][0]), []
    alone = of_mic(verb, good)
    for what, samples in bad.items():
        victim = {"Bad": (samples, "microphone", good["Mic"][2])}
        for channels in ({**victim, **good}, {**good, **victim}):
            try:
                with np.errstate(all="ignore"):
                    found = of_mic(verb, channels)
                same = found.shape == alone.shape and np.allclose(found, alone, 1e-6, 1e-9, equal_nan=True)
                if not same:
                    faults.append(f"{verb} beside {what}: the good channel has another result")
            except Exception as error:
                faults.append(f"{verb} beside {what}: {type(error).__name__}: {error}")
    return faults


def through_verbs(files: dict[str, bytes], place: Path) -> list[str]:
    """Verbs that end with anything but a result or a message on one mutant."""
    import specan
    from specan.errors import SpecanError

    faults = []
    place.mkdir(exist_ok=True)
    for name, data in files.items():
        (place / name).write_bytes(data)
    for name in (name for name in files if name[:2] == "a."):
        for verb, ways in COMMANDS.items():
            for way in ways:
                more = (word.format(out=place / f"{name}-out") for word in way)
                faults += by_command(verb, str(place / name), *more)
    for verb in ("read", *(verb for verb in VERBS if verb not in COMMANDS)):
        for name in (name for name in files if name[:2] == "a."):
            try:
                with np.errstate(all="ignore"):
                    getattr(specan, verb)(place / name)
            except SpecanError as error:
                if "does not know" in str(error) or error.exit_code == 4:
                    faults.append(f"{verb}: {error}")
            except Exception as error:
                faults.append(f"{verb}: {type(error).__name__}: {error}")
    return faults


def _rows(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="\n") as file:
        return list(csv.reader((line for line in file if not line.startswith("#")), delimiter="\t"))


def main() -> int:
    """Run all kinds."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for kind, count in zip(KINDS, (3000, 2000, 800, 400, 40)):
        parser.add_argument(f"--{kind}", type=int, default=count)
    parser.add_argument(
        "--verbs", type=int, default=200, help="mutants of each kind that every verb is given"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--together", type=int, default=100)
    chosen = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    wrong = 0
    for kind in KINDS:
        begin = time.process_time()
        with tempfile.TemporaryDirectory() as place:
            total, faults = fuzz(kind, getattr(chosen, kind), chosen.seed, chosen.together, Path(place))
        wrong += len(faults)
        print(f"{kind}: {dict(total)}, {len(faults)} faults, {time.process_time() - begin:.0f} CPU s")
        with tempfile.TemporaryDirectory() as place:
            for number, files in zip(range(chosen.verbs), mutants(kind, chosen.verbs, chosen.seed + 1)):
                for text in through_verbs(files, Path(place) / str(number)):
                    wrong += 1
                    print(f"{kind} mutant {number}: {text}", file=sys.stderr)
    for rate in RATES:
        for text in by_command("conformance", "--sampling-rate", rate):
            wrong += 1
            print(text, file=sys.stderr)
    for verb in VERBS:
        for text in beside_bad_channels(verb, bad_channels()):
            wrong += 1
            print(text, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
