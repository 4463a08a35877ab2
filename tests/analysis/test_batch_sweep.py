"""A sweep in a batch: its transfer function among those of noise, its band levels among the others."""

import numpy as np
import pytest

from specan.analysis.batch.one_file import _analyse
from specan.analysis.batch.settings import BatchSettings
from specan.data.recording import ArraySource, Channel, Recording

RATE, N = 8000.0, 64000


def test_rows_of_a_sweep():
    frequency = np.geomspace(20, 3000, N)
    velocity = np.sin(2 * np.pi * np.cumsum(frequency) / RATE)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(N)
    channels = tuple(
        Channel(name, group="g", role=role, unit=unit, sampling_rate=RATE, n_samples=N)
        for name, role, unit in (("Vib", "vibrometer", "m/s"), ("Mic 1", "microphone", "Pa"))
    )
    recording = Recording("sweep", channels, ArraySource([velocity, 2.5 * velocity + noise]))
    settings = BatchSettings()
    settings = settings.model_copy(
        update={"transfer_function": settings.transfer_function.model_copy(update={"lines": 400})}
    )
    found = _analyse(recording, settings)
    assert sorted(found.blocks) == ["noise.txt", "other.txt"]
    assert "excitation sweep" in found.about[0]
    lines = [line.split("\t") for line in found.blocks["noise.txt"].splitlines()]
    assert all("sweep" in cells[-1].split() for cells in lines)
    inside = [float(cells[3]) for cells in lines if 100 < float(cells[2]) < 2500]
    assert inside == pytest.approx([2.5] * len(inside), rel=0.01)
