"""Drawn signals of fifteen kinds: no sweep, step, beat, modulation or pulse train is called sine or noise."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import recognition

from specan.analysis.excitation import recognise


@pytest.mark.parametrize("kind", recognition.KINDS)
def test_drawn_signals(kind):
    for number in range(2):
        answer = recognise(recognition.drawn(kind, 2026, number))
        assert not recognition.wrong(kind, answer.kind), (number, answer)
