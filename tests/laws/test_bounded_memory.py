"""Memory that an analysis takes over start-up: bounded, and the same for a recording four times as long."""

import json
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.data.recording import Recording

pytest.importorskip("resource", reason="peak memory is read as POSIX gives it")

# MB. Lower rates get their first blocks, and a spectrogram its last columns, after the first seconds; twelve seconds
# of all channels are 138 MB.
LIMIT, GROWTH = 300.0, 50.0
# Half of the inputs of the rig at its highest common rate; samples are made when they are asked for.
CODE = """
import json, resource, sys
import numpy as np
import scipy.fft, scipy.signal, scipy.special
from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.spectrum import SpectrogramSettings
from specan.analysis.spectrum import FourierSpectrum
from specan.analysis.tone import Tone
from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import Channel, Recording

RATE, POOL = 102400.0, np.random.default_rng(1).standard_normal(1 << 17)

class Source:
    def read(self, indices, start, stop):
        place = np.arange(start, stop)
        tone = np.sin(place * (2 * np.pi * 1000.3 / RATE))
        return np.stack([tone + 0.1 * POOL[(place + 977 * i) % POOL.size] for i in indices])

def analyse(seconds):
    names = [f"Mic {m}" for m in range(1, 13)] + ["Vibrometer", "Generator"]
    roles = ["microphone"] * 12 + ["vibrometer", "generator"]
    channels = tuple(
        Channel(n, unit="V", role=r, sampling_rate=RATE, n_samples=int(seconds * RATE))
        for n, r in zip(names, roles)
    )
    eval(sys.argv[1])(Recording("a.tdms", channels, Source()))

def peak():
    try:  # getrusage tells no less than what the process that started this one held
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) * 1024 / 1e6
    except OSError:
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6

found = [peak()]
for seconds in (3, 12):
    analyse(seconds)
    found.append(peak())
print(json.dumps(found))
"""


@pytest.mark.long
@pytest.mark.parametrize(
    "analysis",
    [
        "Octave(fraction=24)",
        "Octave(fraction=1, averaging='fast', fmin=500.0, fmax=1000.0)",
        "Octave(fraction=24, averaging='fast', fmin=100.0, fmax=1200.0)",
        "TransferFunction(align=False, lines=3200)",  # without `lines` as many as the responses ask for
        "FourierSpectrum()",
        "SpectrogramSettings()",
        "Tone(frequency_hz=1000.3)",
        "Levels()",
    ],
)
def test_memory_is_bounded_and_does_not_grow(analysis: str) -> None:
    done = subprocess.run([sys.executable, "-c", CODE, analysis], capture_output=True, text=True, check=True)
    start, short, long = json.loads(done.stdout)
    assert long - start < LIMIT
    assert long - short < GROWTH


@pytest.mark.parametrize("analysis", [Levels(), Octave(averaging="fast", fmin=20e3)], ids=["rms", "octave"])
def test_memory_is_bounded_in_the_rate(analysis) -> None:
    """Eight thousand samples at 10 MHz: a response of 0.2 s would be as many megabytes again and again."""
    mics = {"Mic 1": np.random.default_rng(1).standard_normal(8000)}
    few = Recording.from_arrays(mics, 1e7, units={"Mic 1": "Pa"})
    tracemalloc.start()
    analysis(few)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6
