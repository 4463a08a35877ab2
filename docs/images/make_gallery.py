"""Draws the gallery: every figure that a command makes, with the command.

Run ``python docs/images/make_gallery.py`` where specan is installed, in any directory. It writes the pictures to
``docs/images/gallery``, the page ``docs/gallery.md``, and what the figures say to ``gallery.json``; a test runs the
commands again and compares.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import shlex
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
NOISE = "sample_data/recordings/noise/noise_24_microphones.tdms"
KNOCK = "sample_data/recordings/knock.tdms"
BENCH = "sample_data/worm_gear/study/bench"


@dataclass(frozen=True)
class Entry:
    """A figure: its file, what it shows, and the command; commands before it that it needs."""

    name: str
    title: str
    text: str
    command: str
    before: tuple[str, ...] = ()
    cheap: bool = True  # drawn again by the test


RECORDINGS = [
    Entry("waveforms", "Waveforms", "Each channel on its own strip.", f"info {KNOCK}"),
    Entry("waveforms_24", "Waveforms of many channels", "Channels of a unit share one scale.", f"info {NOISE}"),
    Entry("octave", "Band levels", "One axis for each level reference.", f"octave {KNOCK}"),
    Entry(
        "octave_24", "Band levels of many channels",
        "The range, the median, and the three channels that are furthest from it.", f"octave {NOISE}",
    ),
    Entry("history", "Levels against time", "Overall levels above the bands.",
          f"octave {KNOCK} --averaging fast --history"),
    Entry("fft", "Spectrum", "Levels, and the phase over a reference channel.", f"fft {KNOCK} --reference 'Mic 1'"),
    Entry("spectrogram", "Spectrogram", "", f"fft {KNOCK} --spectrogram --channel 'Mic 1' --lines 100 --overlap 0.9"),
    Entry("frf", "Transfer functions", "Magnitude and phase with their 95 % bands, and the coherence.",
          f"frf {NOISE} --channel 'Mic 1' --channel 'Mic 9'"),
    Entry("frf_24", "Transfer functions of many channels", "", f"frf {NOISE}"),
    Entry("rms", "Levels", "Level, range of the time-weighted level, and percentiles.", f"rms {NOISE}"),
    Entry("orders", "Orders", "",
          'orders run.tdms --tacho "Tacho carrier" --channel "Acc 1" --mesh 66 --sidebands 3 --max-order 210',
          ("simulate planetary-gear sample_data/planetary_gear/rig.toml -o run.tdms --duration 3",), cheap=False),
    Entry("impulse", "Impulse responses", "", f"impulse {NOISE} --channel 'Mic 1' --channel 'Mic 9' -o impulse.csv"),
    Entry("decay", "Reverberation times", "", f"decay {KNOCK} --channel 'Mic 1' --fmax 1000"),
    Entry("srs", "Shock response", "A half-sine of 500 m/s² and 11 ms.", "srs drop.csv"),
    Entry("calibration", "Calibration", "Sensitivities and phases with 95 % intervals.",
          "calibrate sample_data/recordings/calibration/*.tdms -o calibration.toml"),
]  # fmt: skip
STUDIES = [
    Entry("compare", "Measured and model", "A gear bench and the model of its losses; the residual has a pattern.",
          "study compare gear",
          (f"study new gear --model worm-gear --rig {BENCH}/rig.toml --measurement {BENCH}/measurement.csv "
           "--hold-out torque=50",)),
    Entry("diagnose", "Diagnosis", "The error that each candidate leaves.", "study diagnose gear"),
    Entry("next", "The next measurement", "At slow speeds two effects fit alike: what each expects of three readings.",
          "study next slow",
          (f"study new slow --model worm-gear --rig {BENCH}/rig.toml --measurement {BENCH}/measurement.csv "
           "--hold-out speed=1800,2300,2798",), cheap=False),
    Entry("add", "A step", "Errors and residuals before and after.", "study add gear windage"),
    Entry("steps", "All steps", "", "study history gear"),
]  # fmt: skip
MODELS = [
    Entry("efficiency_map", "Efficiency map", "", "simulate worm-gear sample_data/worm_gear/rig.toml"),
    Entry("field", "Sound field of a room",
          "Level and phase on a plane; `box.toml` is the first rig file of [the room](room.md).",
          "simulate room box.toml --field z=0.33 --frequency 250", cheap=False),
]  # fmt: skip
SECTIONS = {"Recordings": RECORDINGS, "Studies": STUDIES, "Models": MODELS}


def drawn(entry: Entry, target: Path | None = None) -> list[str]:
    """Run the commands of an entry in the current directory; returns what the figure says.

    Parameters
    ----------
    target : Path, optional
        Where the picture is written.
    """
    from specan.report import figure_style

    caught: list[Any] = []
    with _patched(figure_style, "save_figure", lambda figure, path: caught.append(figure)):
        for command in (*entry.before, f"{entry.command} {_option(entry)} figure.png"):
            _run(command)
    (figure,) = caught
    if target is not None:
        figure.savefig(target, dpi=110)
    return texts_of(figure)


def texts_of(figure: Any) -> list[str]:
    """Heading, titles, labels of axes and legends; no ticks."""
    from matplotlib.text import Annotation

    below = [a.get_text() for a in figure.artists if isinstance(a, Annotation)]
    found = [" ".join([figure.get_suptitle(), *below]).replace("\n", " ")]
    for axes in figure.axes:
        found += [axes.get_title(loc="left"), axes.get_xlabel(), axes.get_ylabel()]
    for legend in [*figure.legends, *(a.get_legend() for a in figure.axes if a.get_legend())]:
        found += [text.get_text() for text in legend.get_texts()]
    return [text for text in found if text.strip()]


def _option(entry: Entry) -> str:
    return "-o" if "--field" in entry.command else "--plot"


def _run(command: str) -> None:
    from specan_cli.main import main

    arguments = [a for part in shlex.split(command) for a in _expanded(part)]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(arguments, standalone_mode=False)


def _expanded(part: str) -> list[str]:
    return sorted(map(str, Path().glob(part))) if "*" in part else [part]


@contextlib.contextmanager
def _patched(module: Any, name: str, value: Any) -> Iterator[None]:
    kept = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, kept)


@contextlib.contextmanager
def workplace() -> Iterator[None]:
    """A fresh current directory with the sample data, the rig file of the guide to rooms, and a shock."""
    old = Path.cwd()
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        try:
            Path("sample_data").symlink_to(ROOT / "sample_data")
            guide = (ROOT / "docs" / "room.md").read_text(encoding="utf-8")
            rig = guide.split("<!-- file: cabin.toml -->\n```toml\n")[1].split("```")[0]
            Path("box.toml").write_text(rig, encoding="utf-8")
            times = [k / 20000 for k in range(4000)]
            drop = [f"{t:g},{500 * math.sin(math.pi * min(t, 0.011) / 0.011):.6g}" for t in times]
            Path("drop.csv").write_text("\n".join(["time_s,Acc [m/s^2]", *drop]), encoding="utf-8")
            yield
        finally:
            os.chdir(old)


def page(entries: dict[str, list[Entry]]) -> str:
    """``docs/gallery.md``."""
    parts = [
        "# Gallery\n\nFigures that commands draw, with the commands. `--plot` also writes `.svg` and `.pdf`. "
        "[What the figures have in common](figures.md).\n"
    ]
    for section, rows in entries.items():
        parts.append(f"## {section}\n")
        for entry in rows:
            commands = "\n".join(
                f"specan {c}" for c in (*entry.before, f"{entry.command} {_option(entry)} {entry.name}.png")
            )
            text = f"{entry.text}\n\n" if entry.text else ""
            parts.append(f"### {entry.title}\n\n{text}```sh\n{commands}\n```\n\n"
                         f"![{entry.title}](images/gallery/{entry.name}.png)\n")  # fmt: skip
    return "\n".join(parts)


def main() -> None:
    """Draw everything anew."""
    said = {}
    with workplace():
        for rows in SECTIONS.values():
            for entry in rows:
                said[entry.name] = drawn(entry, HERE / "gallery" / f"{entry.name}.png")
    (HERE / "gallery.json").write_text(
        json.dumps(said, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    (HERE.parent / "gallery.md").write_text(page(SECTIONS), encoding="utf-8")


if __name__ == "__main__":
    main()
