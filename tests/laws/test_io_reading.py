"""Laws of reading: every layout gives npTDMS's samples, any range equals a slice of the whole."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nptdms import TdmsFile

sys.path.insert(0, str(Path(__file__).parent.parent / "io"))
import tdms_bytes as tb

from specan.errors import InputError
from specan.io.open import open_recording

KINDS = ("i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8", "?")


def samples(kind: str, n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    if kind == "?":
        return rng.integers(0, 2, n).astype(bool)
    if kind[0] == "f":
        return rng.standard_normal(n).astype(kind)
    limits = np.iinfo(kind)
    return rng.integers(max(limits.min, -(2**40)), min(limits.max, 2**40), n).astype(kind)


@st.composite
def files(draw):
    """Bytes of a file of several segments of one kind of layout."""
    layout = draw(st.sampled_from(["contiguous", "interleaved", "daqmx"]))
    big = layout != "daqmx" and draw(st.booleans())
    e = ">" if big else "<"
    n_channels = draw(st.integers(1, 4))
    kinds = draw(st.lists(st.sampled_from(KINDS), min_size=n_channels, max_size=n_channels))
    if layout == "daqmx":
        kinds = [draw(st.sampled_from(["i2", "i4"]))] * n_channels
    flags = tb.META | tb.NEW_LIST | (tb.BIG_ENDIAN if big else 0)
    flags |= {"contiguous": 0, "interleaved": tb.INTERLEAVED, "daqmx": tb.DAQMX}[layout]
    content = b""
    for number in range(draw(st.integers(1, 4))):
        n = draw(st.integers(2, 9))
        chunks = draw(st.integers(1, 3))
        # Channels come and go, the first one stays.
        there = [k for k in range(n_channels) if k == 0 or layout == "daqmx" or draw(st.booleans())]
        raw = b""
        for chunk in range(chunks):
            arrays = [
                samples(kinds[k], n, 100 * number + 10 * chunk + k).astype(np.dtype(kinds[k]).newbyteorder(e))
                for k in there
            ]
            if layout == "contiguous":
                raw += b"".join(a.tobytes() for a in arrays)
            else:
                rows = np.rec.fromarrays(arrays)
                raw += rows.astype(rows.dtype).tobytes()
        width = sum(np.dtype(kinds[k]).itemsize for k in there)
        offsets = np.cumsum([0, *(np.dtype(kinds[k]).itemsize for k in there)])
        objects = []
        for place, k in enumerate(there):
            if layout == "daqmx":
                index = tb.daqmx(n, [(kinds[k], 0, int(offsets[place]), 0)], [width])
                scale = tb.linear(0.5 + k, 1.0, number=1, source=0)
            else:
                index = tb.plain(kinds[k], n, e)
                scale = tb.linear(0.25, -1.0) if k == 1 else {}
            objects.append((tb.path("g", f"c{k}"), index, {**tb.wave(1000.0), **scale}))
        content += tb.segment(objects, raw, flags=flags)
    return content


@given(content=files(), start=st.integers(0, 40), length=st.integers(0, 40))
@settings(max_examples=150, deadline=None)
def test_every_layout_gives_the_samples_of_nptdms(tmp_path_factory, content, start, length):
    path = tmp_path_factory.mktemp("law") / "a.tdms"
    path.write_bytes(content)
    recording = open_recording(path)
    peer = TdmsFile.read(path)
    assert {c.name for c in recording.channels} | {p.split("/")[1] for p in recording.set_aside} == {
        c.name for c in peer["g"].channels()
    }
    for channel in recording.channels:
        expected = peer["g"][channel.name][:].astype(np.float64)
        np.testing.assert_array_equal(recording.read([channel])[0], expected)
        first = min(start, channel.n_samples)
        last = min(first + length, channel.n_samples)
        np.testing.assert_array_equal(recording.read([channel], first, last)[0], expected[first:last])


@given(size=st.integers(1, 700))
@settings(max_examples=25, deadline=None)
def test_blocks_join_to_the_whole(tmp_path_factory, size):
    path = tmp_path_factory.getbasetemp() / "blocks.tdms"
    if not path.exists():
        data = [np.arange(400, dtype="<i4") + 1000 * k for k in range(3)]
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 400), tb.wave(1000.0)) for k in range(3)]
        path.write_bytes(tb.segment(objects, b"".join(d.tobytes() for d in data)) * 3)
    recording = open_recording(path)
    blocks = list(recording.blocks(recording.channels, size))
    np.testing.assert_array_equal(np.hstack(blocks), recording.read(recording.channels))
    assert all(b.shape[1] == size for b in blocks[:-1])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0), (1,), (2, 1, 0), (0, 2, 2)])
def test_channels_come_in_the_order_asked_for(tmp_path, order):
    path = tmp_path / "a.tdms"
    data = np.arange(30, dtype="<i4").reshape(10, 3)
    objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 10), tb.wave(1000.0)) for k in range(3)]
    path.write_bytes(tb.segment(objects, data.tobytes(), flags=tb.META | tb.NEW_LIST | tb.INTERLEAVED))
    recording = open_recording(path)
    read = recording.read([recording.channels[k] for k in order], 2, 9)
    np.testing.assert_array_equal(read, data.T[list(order), 2:9])


@given(content=files(), cut=st.floats(0.01, 0.99))
@settings(max_examples=100, deadline=None)
def test_a_file_that_was_cut_off_gives_the_beginning_of_each_channel(tmp_path_factory, content, cut):
    directory = tmp_path_factory.mktemp("cut")
    whole, short = directory / "whole.tdms", directory / "short.tdms"
    whole.write_bytes(content)
    short.write_bytes(content[: int(len(content) * cut)])
    try:
        recording = open_recording(short)
    except InputError:
        return  # nothing is left, or the headers are cut
    full = open_recording(whole)
    for channel in recording.channels:
        expected = full.read([full.channel(channel.name)])[0]
        np.testing.assert_array_equal(recording.read([channel])[0], expected[: channel.n_samples])
    assert recording.flags == ("truncated",) or short.stat().st_size in _ends(content)


def _ends(content: bytes) -> set[int]:
    """Where segments end: a file that is cut there is whole."""
    ends, position = set(), 0
    while position < len(content):
        big = content[position + 4] & tb.BIG_ENDIAN
        position += 28 + int.from_bytes(content[position + 12 : position + 20], "big" if big else "little")
        ends.add(position)
    return ends
