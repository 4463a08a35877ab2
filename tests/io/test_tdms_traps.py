"""TDMS files as they are found: names, index files, damage, files that change."""

import numpy as np
import pytest
import tdms_bytes as tb
from nptdms import ChannelObject, TdmsWriter
from tdms_bytes import write

from specan.errors import InputError, RequestError
from specan.io.open import open_recording


def test_names_with_slashes_quotes_and_other_alphabets(path):
    names = ["Mic 1/2", "it's", "Hałas: ściana", "温度", "a\\b"]
    write(path, [(n, np.full(4, k), {"wf_increment": 0.001}) for k, n in enumerate(names)], name="g/ü")
    recording = open_recording(path)
    assert [c.name for c in recording.channels] == names
    assert recording.channel("g/ü/Mic 1/2").group == "g/ü"
    np.testing.assert_array_equal(recording.read(recording.channels)[:, 0], range(5))


class TestIndexFile:
    def test_a_stray_index_is_not_used(self, path, tmp_path):
        write(path, [("c", np.arange(50), {"wf_increment": 0.001})])
        other = tmp_path / "b.tdms"
        with TdmsWriter(str(other), index_file=True) as writer:
            writer.write_segment([ChannelObject("h", "d", np.arange(7), {"wf_increment": 0.1})])
        (tmp_path / "b.tdms_index").rename(tmp_path / "a.tdms_index")
        recording = open_recording(path)
        assert [(c.name, c.n_samples) for c in recording.channels] == [("c", 50)]


class TestFilesThatChange:
    def test_a_file_that_shrinks(self, path):
        write(path, [("c", np.arange(5000), {"wf_increment": 0.001})])
        recording = open_recording(path)
        path.write_bytes(path.read_bytes()[:-100])
        with pytest.raises(InputError, match="do not change a recording"):
            recording.read(recording.channels)

    def test_a_file_that_vanishes(self, path):
        write(path, [("c", np.arange(50), {"wf_increment": 0.001})])
        recording = open_recording(path)
        path.unlink()
        with pytest.raises(InputError, match="cannot be read any more"):
            recording.read(recording.channels)


def test_damaged_headers_are_one_sentence(path):
    write(path, [("c", np.arange(50), {"wf_increment": 0.001})])
    content = bytearray(path.read_bytes())
    content[28:32] = b"\xff\xff\xff\x7f"  # two thousand million objects
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"headers of a\.tdms are damaged"):
        open_recording(path)


def test_nptdms_keeps_silent(path, caplog):
    objects = [(tb.path("g", "c"), tb.plain("i4", 10), tb.wave(1000.0))]
    path.write_bytes(tb.segment(objects, np.arange(10, dtype="<i4").tobytes())[:-4])
    open_recording(path)
    assert caplog.records == []


def test_a_range_outside_the_recording_is_refused(path):
    write(path, [("c", np.arange(50), {"wf_increment": 0.001})])
    recording = open_recording(path)
    with pytest.raises(RequestError, match="inside 0 to 50"):
        recording.read(recording.channels, 0, 51)
    assert recording.read(recording.channels, 7, 7).shape == (1, 0)
