"""specan beside its peers on one signal, in one run: CPU seconds as multiples of a plain transform, peak memory.

``python benchmarks/compare.py [--channels 26] [--seconds 60] [--rate 51200] [--no-growth] [--no-commands] [--hour]``

Every measurement runs in a process of its own. A peer that is not installed is left out, and said so. The table and
the plot are written to `benchmarks/compare.md` and `benchmarks/compare.svg`.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
# `x` are the samples (channels, n), in memory; peak memory is counted over them.
PREPARE = """
import json, resource, sys, time
import numpy as np
rate, place = float(sys.argv[1]), sys.argv[2]
x = np.load(place + "/samples.npy")
def blocks():
    for first in range(0, x.shape[1], 1 << 16):
        yield x[:, first : first + (1 << 16)]
def fed(analysis):
    for block in blocks():
        analysis.add(block)
    return analysis.result()
mid = 1000.0 * 10.0 ** (0.1 * np.arange(-17, 14))
mid = mid[mid * 10**0.05 < rate / 2]
scale = 1 if sys.platform == "darwin" else 1024
"""
MEASURE = """
before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
"""
REPORT = """
cpu, after = time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"cpu": cpu, "peak": (after - before) * scale / 1e6}))
"""
YARDSTICK = ("import scipy.fft", "for row in x:\n    scipy.fft.rfft(row)")
LEVELS = {
    "specan": (
        "from specan.dsp import bands\nfrom specan.dsp.band_energy import BandEnergyAccumulator\n"
        "from specan.dsp.weighting import power_weighting\nimport scipy.fft, scipy.special",
        "found = fed(BandEnergyAccumulator(len(x), rate, x.shape[1]))\n"
        "found.band_mean_square(bands.Bands.octaves(3, np.arange(-17, -17 + len(mid))))\n"
        "[found.nodes @ power_weighting(found.frequencies, w) for w in 'ABC']",
    ),
    "scipy sosfilt": (
        "from scipy import signal",
        "for f in mid:\n"
        "    sos = signal.butter(4, [f * 10**-0.05, f * 10**0.05], 'bandpass', fs=rate, output='sos')\n"
        "    for row in x:\n        np.mean(signal.sosfilt(sos, row) ** 2)",
    ),
    "PyOctaveBand": (
        "import pyoctaveband",
        "for row in x:\n"
        "    pyoctaveband.octavefilter(row, fs=int(rate), fraction=3, order=4, limits=[20, mid[-1]])",
    ),
    "pyfar": (
        "import pyfar",
        "for row in x:\n"
        "    found = pyfar.dsp.filter.fractional_octave_bands(pyfar.Signal(row, rate), 3, None, (20, mid[-1]))\n"
        "    np.mean(found.time**2, axis=-1)",
    ),
    # The successor of PyOctaveBand; from version 3 on it needs Python 3.13.
    "phonometry": (
        "import phonometry",
        "for row in x:\n    phonometry.octavefilter(row, fs=int(rate), fraction=3, order=4, limits=[20, mid[-1]])",
    ),
    "MoSQITo": (
        "from mosqito.sound_level_meter import noct_spectrum",
        "for row in x:\n    noct_spectrum(row, int(rate), 20, mid[-1], n=3)",
    ),
    "python-acoustics": (
        # The name that newer scipy lacks; the filters do not use it.
        "import scipy.special\nvars(scipy.special).setdefault('sph_harm', None)\n"
        "from acoustics.signal import bandpass",
        # Its own octaves() and bandpass_frequencies() end in an error with numpy 2.4.
        "for f in mid:\n"
        "    for row in x:\n"
        "        np.mean(bandpass(row, f * 10**-0.05, f * 10**0.05, rate, order=8) ** 2)",
    ),
}
OURS = (
    "from specan.dsp import bands\n"
    "from specan.dsp.band_history import Average, BandHistoryAccumulator, Record\n"
    "from specan.dsp.band_history import band_filter, weighting_filter\n"
    "index = bands.band_range(20.0, mid[-1], {fraction})\n"
    "filters = [band_filter(band) for band in bands.Bands.octaves({fraction}, index)]\n"
    "filters += [weighting_filter(w) for w in '{totals}']",
    "times = np.arange(1, 8 * x.shape[1] / rate) / 8\n"
    "fed(BandHistoryAccumulator(Record(len(x), rate, x.shape[1]), filters, Average(0.125, None, times)))",
)


def ours(fraction: int, totals: str) -> tuple[str, str]:
    """Histories of the bands, and of the whole signal with these weightings."""
    return OURS[0].format(fraction=fraction, totals=totals), OURS[1]


HISTORIES = {
    "specan, bands": ours(3, ""),
    "specan, bands and A, B, C, Z": ours(3, "ABCZ"),
    "specan, 1/24 octave bands and A, B, C, Z": ours(24, "ABCZ"),
    "scipy sosfilt and lfilter": (
        "from scipy import signal",
        "keep = np.exp(-1 / (rate * 0.125))\n"
        "for f in mid:\n"
        "    sos = signal.butter(4, [f * 10**-0.05, f * 10**0.05], 'bandpass', fs=rate, output='sos')\n"
        "    for row in x:\n"
        "        signal.lfilter([1 - keep], [1, -keep], signal.sosfilt(sos, row) ** 2)[:: int(rate / 8)]",
    ),
}
TRANSFER = {
    "specan": (
        "from specan.dsp.transfer_function import estimate\nfrom specan.dsp.welch import CrossSpectra",
        "found = fed(CrossSpectra(rate, 8192, n_channels=len(x), references=[0], lines=3200))\n"
        "estimate('H1', found.auto[0], found.auto[1:], found.cross[0, 1:], found.n_effective)",
    ),
    "scipy welch and csd": (
        "from scipy import signal",
        "_, xx = signal.welch(x[0], rate, nperseg=8192)\n"
        "for row in x[1:]:\n"
        "    _, yy = signal.welch(row, rate, nperseg=8192)\n"
        "    _, xy = signal.csd(x[0], row, rate, nperseg=8192)\n"
        "    xy / xx, np.abs(xy) ** 2 / xx / yy",
    ),
    "pyFRF": (
        "from pyFRF import FRF",
        "n = x.shape[1] // 8192 * 8192\n"
        "blocks = x[:, :n].reshape(len(x), -1, 8192)\n"
        "for row in blocks[1:]:\n"
        "    found = FRF(int(rate), blocks[0], row, window='hann')\n"
        "    found.get_H1(), found.get_coherence()",
    ),
}
READING = {
    "specan": (
        "from specan.io.open import open_recording",
        "recording = open_recording(place + '/samples.tdms')\n"
        "for block in recording.blocks(recording.channels, 1 << 16):\n    pass",
    ),
    "npTDMS, whole file": (
        "from nptdms import TdmsFile",
        "for channel in TdmsFile.read(place + '/samples.tdms')['Measurement'].channels():\n    channel[:]",
    ),
    "np.fromfile and a gain": ("", "np.fromfile(place + '/samples.i4', dtype='<i4') * 1e-9"),
}
WHOLE = {
    "specan fft --whole": (
        "from specan.analysis.spectrum import FourierSpectrum, single_blocks\n"
        "from specan.io.open import open_recording",
        "for part in single_blocks(open_recording(place + '/samples.tdms'), FourierSpectrum(whole=True)):\n"
        "    pass",
    ),
    "numpy rfft of a windowed channel": (
        "window = np.hanning(x.shape[1])",
        "for row in x:\n    np.abs(np.fft.rfft((row - row.mean()) * window))",
    ),
}
TASKS = {
    "spectrum of the whole recording": WHOLE,
    "1/3 octave levels": LEVELS,
    "1/3 octave Fast histories": HISTORIES,
    "PSD, H1, coherence": TRANSFER,
    "reading int32": READING,
}


def measure(prepare: str, work: str, rate: float, place: Path) -> dict[str, float] | None:
    """CPU seconds and peak memory; None where something is not installed."""
    code = PREPARE + prepare + MEASURE + work + REPORT
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, str(rate), str(place)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1]
        if "ModuleNotFoundError" in last:
            return None
        raise SystemExit(done.stderr)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def make_samples(place: Path, channels: int, seconds: float, rate: float) -> None:
    """The same noise as an array, as plain integers, and as a TDMS file."""
    from nptdms import ChannelObject, TdmsWriter

    n = round(seconds * rate)
    rng = np.random.default_rng(1)
    x = np.empty((channels, n))
    common = rng.standard_normal(n)
    for row in x:
        row[:] = common + 0.3 * rng.standard_normal(n)
    np.save(place / "samples.npy", x)
    counts = (x * 2**27).astype("<i4")
    counts.tofile(place / "samples.i4")
    properties = {"wf_increment": 1 / rate, "wf_start_offset": 0.0, "unit_string": "V"}
    with TdmsWriter(str(place / "samples.tdms")) as writer:
        for first in range(0, n, round(rate)):
            writer.write_segment(
                [
                    ChannelObject("Measurement", f"ai{i}", row[first : first + round(rate)], properties)
                    for i, row in enumerate(counts)
                ]
            )


def growth(rate: float) -> list[tuple[int, float, float]]:
    """Channels, seconds and CPU seconds of 1/3 octave levels."""
    code = (
        "import json, sys, time\nimport numpy as np\nimport scipy.fft, scipy.special\n"
        "from specan.dsp import bands\nfrom specan.dsp.band_energy import BandEnergyAccumulator\n"
        "rate, rows, left = float(sys.argv[1]), int(sys.argv[2]), int(float(sys.argv[3]) * float(sys.argv[1]))\n"
        "pool = np.random.default_rng(1).standard_normal((rows, 1 << 16))\n"
        "start, energy = time.process_time(), BandEnergyAccumulator(rows, rate, left)\n"
        "while left > 0:\n    energy.add(pool[:, :left])\n    left -= pool.shape[1]\n"
        "energy.result().band_mean_square(bands.Bands.octaves(3, np.arange(-17, 14)))\n"
        "print(time.process_time() - start)\n"
    )
    found = []
    for rows, seconds in [*((1, s) for s in (1, 10, 60, 300, 600)), *((r, 10) for r in (2, 4, 8, 16, 26))]:
        command = [sys.executable, "-c", code, str(rate), str(rows), str(seconds)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        found.append((rows, float(seconds), float(done.stdout)))
    return found


def table(found: dict[str, dict[str, dict[str, float] | None]], yardstick: float) -> list[str]:
    lines = ["| task | program | CPU s | x transform | MB over the samples |", "|---|---|---|---|---|"]
    for task, programs in found.items():
        for name, row in programs.items():
            cells = (
                "not installed | | |"
                if row is None
                else f"{row['cpu']:.2f} | {row['cpu'] / yardstick:.2f} | {row['peak']:.0f} |"
            )
            lines.append(f"| {task} | {name} | {cells}")
    return lines


def plot(
    found: dict[str, dict[str, dict[str, float] | None]],
    yardstick: float,
    grown: list[tuple[int, float, float]],
    path: Path,
) -> None:
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "specan"
    import matplotlib.pyplot as plt

    figure, (bars, lines) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
    entries = [(t, n, r["cpu"] / yardstick) for t, p in found.items() for n, r in p.items() if r is not None]
    colours = ["tab:orange" if name.startswith("specan") else "tab:gray" for _, name, _ in entries]
    bars.barh(
        [f"{task}: {name}" for task, name, _ in entries], [value for *_, value in entries], color=colours
    )
    bars.set(xscale="log", xlabel="CPU time over that of a plain transform")
    bars.tick_params(axis="y", labelsize=7)
    bars.invert_yaxis()
    if grown:
        for label, rows in (
            ("1 channel, 1 s to 10 min", [g for g in grown if g[0] == 1]),
            ("10 s, 1 to 26 channels", [g for g in grown if g[1] == 10]),
        ):
            lines.plot([r * s for r, s, _ in rows], [cpu for *_, cpu in rows], "o-", label=label)
        lines.set(xscale="log", yscale="log", xlabel="channels x seconds", ylabel="CPU s")
        lines.legend()
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--channels", type=int, default=26)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=51200.0)
    parser.add_argument("--no-growth", action="store_true", help="leave out how cost grows")
    parser.add_argument(
        "--no-commands", action="store_true", help="leave out short files, start-up, studies and many files"
    )
    parser.add_argument("--hour", action="store_true", help="with a recording of one hour, some minutes")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        # In a process of its own: peak memory of a process is handed on to those that it starts.
        making = multiprocessing.get_context("spawn").Process(
            target=make_samples, args=(place, given.channels, given.seconds, given.rate)
        )
        making.start()
        making.join()
        plain = measure(*YARDSTICK, given.rate, place)
        assert plain is not None
        found = {
            task: {name: measure(*code, given.rate, place) for name, code in programs.items()}
            for task, programs in TASKS.items()
        }
    grown = [] if given.no_growth else growth(given.rate)
    lines = [
        f"{given.channels} channels x {given.seconds:g} s at {given.rate:g} Hz, float64; "
        f"a plain transform of every channel takes {plain['cpu']:.2f} CPU s.",
        "",
        *table(found, plain["cpu"]),
    ]
    if grown:
        lines += ["", "| channels | seconds | CPU s | us for a channel and a second |", "|---|---|---|---|"]
        lines += [f"| {r} | {s:g} | {cpu:.3f} | {1e6 * cpu / (r * s):.0f} |" for r, s, cpu in grown]
    if not given.no_commands:
        import small_files
        import whole_commands

        for rows in (small_files.table, small_files.fixed, small_files.scaling, whole_commands.table):
            lines += ["", *rows()]
    if given.hour:
        for asked in ([], ["--page"]):
            command = [sys.executable, str(HERE / "one_hour.py"), *asked]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            lines += ["", *done.stdout.splitlines()]
    (HERE / "compare.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    plot(found, plain["cpu"], grown, HERE / "compare.svg")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
