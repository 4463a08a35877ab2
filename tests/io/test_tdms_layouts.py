"""Layouts of samples in a TDMS file, whole, short and cut off."""

import numpy as np
import pytest
import tdms_bytes as tb
from nptdms import TdmsFile

from specan.errors import InputError
from specan.io.open import open_recording
from specan.io.tdms_headers import read_headers


class TestLayouts:
    def test_interleaved_with_a_short_last_chunk_before_another_segment(self, path):
        rows = np.arange(24, dtype="<i4").reshape(12, 2)
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 10), tb.wave(1000.0)) for k in range(2)]
        one = tb.segment(objects, rows.tobytes(), flags=tb.META | tb.NEW_LIST | tb.INTERLEAVED)
        path.write_bytes(one + one)
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels), np.vstack([rows, rows]).T)

    def test_contiguous_with_a_short_last_chunk_of_a_complete_segment(self, path):
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 10), tb.wave(1000.0)) for k in range(2)]
        raw = np.arange(28, dtype="<i4")  # a chunk of 10 + 10, then one of 4 + 4
        path.write_bytes(tb.segment(objects, raw.tobytes()) * 2)
        recording = open_recording(path)
        expected = [[*range(10), *range(20, 24)] * 2, [*range(10, 20), *range(24, 28)] * 2]
        np.testing.assert_array_equal(recording.read(recording.channels), expected)
        np.testing.assert_array_equal(TdmsFile.read(path)["g"]["c1"][:], expected[1])

    def truncated(self, path, cut, *, flags=0, unfinished=False):
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 10), tb.wave(1000.0)) for k in range(3)]
        whole = np.arange(60, dtype="<i4")  # two chunks
        content = tb.segment(
            objects, whole.tobytes(), flags=tb.META | tb.NEW_LIST | flags, unfinished=unfinished
        )
        path.write_bytes(content[: len(content) - cut])
        return open_recording(path)

    @pytest.mark.parametrize("unfinished", [False, True])
    @pytest.mark.parametrize(
        ("cut", "common"), [(0, 20), (4, 19), (40, 10), (41, 10), (4 * 29, 10), (4 * 30, 10)]
    )
    def test_contiguous_cut_off_has_a_common_length(self, path, cut, common, unfinished):
        recording = self.truncated(path, cut, unfinished=unfinished)
        assert {c.n_samples for c in recording.channels} == {common}
        assert recording.flags == (("truncated",) if cut or unfinished else ())
        expected = np.hstack([np.arange(30).reshape(3, 10), np.arange(30, 60).reshape(3, 10)])[:, :common]
        np.testing.assert_array_equal(recording.read(recording.channels), expected)

    @pytest.mark.parametrize(("cut", "common"), [(0, 20), (1, 19), (12, 19), (13, 18), (239 - 12, 1)])
    def test_interleaved_cut_off(self, path, cut, common):
        if common < 2:
            with pytest.raises(InputError, match="single number"):
                self.truncated(path, cut, flags=tb.INTERLEAVED)
            return
        recording = self.truncated(path, cut, flags=tb.INTERLEAVED)
        np.testing.assert_array_equal(
            recording.read(recording.channels), np.arange(60).reshape(20, 3).T[:, :common]
        )

    def test_cut_off_in_the_only_chunk_keeps_what_is_complete(self, path):
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 10), tb.wave(1000.0)) for k in range(3)]
        content = tb.segment(objects, np.arange(30, dtype="<i4").tobytes())
        path.write_bytes(content[:-60])  # half of the second channel and the third are missing
        recording = open_recording(path)
        assert [c.name for c in recording.channels] == ["c0"]
        assert recording.set_aside == {"g/c1": "it was cut off", "g/c2": "it was cut off"}
        assert recording.flags == ("truncated",)

    @pytest.mark.parametrize("keep", [10, 27, 28, 60])
    def test_cut_off_inside_the_headers_of_a_segment(self, path, keep):
        objects = [(tb.path("g", "c"), tb.plain("i4", 10), tb.wave(1000.0))]
        one = tb.segment(objects, np.arange(10, dtype="<i4").tobytes())
        path.write_bytes(one + one[:keep])
        recording = open_recording(path)
        assert recording.flags == ("truncated",)
        assert recording.channels[0].n_samples == 10

    def test_thousands_of_segments(self, path):
        first = [(tb.path("g", f"c{k}"), tb.plain("i2", 3), tb.wave(1000.0)) for k in range(2)]
        more = [(name, tb.SAME_AS_BEFORE, {}) for name, _, _ in first]
        data = np.arange(4310 * 6, dtype="<i2").reshape(4310, 2, 3)
        parts = [tb.segment(first if k == 0 else more, d.tobytes()) for k, d in enumerate(data)]
        path.write_bytes(b"".join(parts))
        recording = open_recording(path)
        np.testing.assert_array_equal(
            recording.read(recording.channels), data.transpose(1, 0, 2).reshape(2, -1)
        )

    def test_segments_without_metadata_repeat_the_one_before(self, path):
        data = np.arange(8, dtype="<i4")
        objects = [(tb.path("g", "c"), tb.plain("i4", 8), tb.wave(1000.0))]
        path.write_bytes(tb.segment(objects, data.tobytes()) + tb.segment([], data.tobytes(), flags=0))
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels)[0], [*data, *data])

    def test_text_between_numbers_is_stepped_over(self, path):
        index, raw = tb.strings(["one", "zwei", "trzy"])
        objects = [
            (tb.path("g", "a"), tb.plain("i4", 4), tb.wave(1000.0)),
            (tb.path("g", "notes"), index, {}),
            (tb.path("g", "b"), tb.plain("f8", 4), tb.wave(1000.0)),
        ]
        a, b = np.arange(4, dtype="<i4"), np.arange(4, dtype="<f8") / 7
        path.write_bytes(tb.segment(objects, a.tobytes() + raw + b.tobytes()) * 3)
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels), [np.tile(a, 3), np.tile(b, 3)])

    def test_channels_of_one_length_in_different_segments(self, path):
        """Between two channels that lie alike stands one that lies elsewhere."""
        data = np.arange(30, dtype="<i4").reshape(3, 10)
        a, x, b = ((tb.path("g", n), tb.plain("i4", 10), tb.wave(1000.0)) for n in "axb")
        content = tb.segment([a, b], data[[0, 2]].tobytes()) + tb.segment([x], data[1].tobytes())
        path.write_bytes(content)
        recording = open_recording(path)
        axb = [recording.channel(n) for n in "axb"]
        np.testing.assert_array_equal(recording.read(axb), data)

    def test_small_chunks_in_one_segment(self, path):
        """The writer that adds blocks of a few samples: thousands of chunks behind one header."""
        data = np.random.default_rng(1).integers(-1000, 1000, (5000, 4, 7)).astype("<i4")
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 7), tb.wave(1000.0)) for k in range(4)]
        path.write_bytes(tb.segment(objects, data.tobytes()))
        recording = open_recording(path)
        expected = data.transpose(1, 0, 2).reshape(4, -1)
        np.testing.assert_array_equal(recording.read(recording.channels), expected)
        np.testing.assert_array_equal(recording.read(recording.channels, 5, 20_003), expected[:, 5:20_003])

    def test_large_rows_and_large_chunks(self, path):
        """More than one window of bytes, for rows as well as for channels one after the other."""
        data = np.random.default_rng(1).integers(-1000, 1000, (3, 300_000)).astype("<i4")
        objects = [(tb.path("g", f"c{k}"), tb.plain("i4", 300_000), tb.wave(1000.0)) for k in range(3)]
        path.write_bytes(tb.segment(objects, data.tobytes()))
        rows = path.with_name("rows.tdms")
        rows.write_bytes(tb.segment(objects, data.T.tobytes(), flags=tb.META | tb.NEW_LIST | tb.INTERLEAVED))
        for file in (path, rows):
            recording = open_recording(file)
            np.testing.assert_array_equal(recording.read(recording.channels), data)
            two = [recording.channels[0], recording.channels[2]]
            np.testing.assert_array_equal(recording.read(two, 7, 270_001), data[[0, 2], 7:270_001])


class TestDaqmx:
    def channels(self, n, scalers, widths, **more):
        scale = tb.linear(0.5, 1.0, number=1, source=0)
        return [
            (tb.path("g", f"c{k}"), tb.daqmx(n, [s], widths, **more), {**tb.wave(1000.0), **scale})
            for k, s in enumerate(scalers)
        ]

    def test_two_cards_with_a_buffer_each(self, path):
        first = np.arange(20, dtype="<i2").reshape(10, 2)
        second = 1000 + np.arange(30, dtype="<i4").reshape(10, 3)
        scalers = [("i2", 0, 0, 0), ("i2", 0, 2, 0), ("i4", 1, 0, 0), ("i4", 1, 4, 0), ("i4", 1, 8, 0)]
        raw = (first.tobytes() + second.tobytes()) * 2
        path.write_bytes(tb.segment(self.channels(10, scalers, [4, 12]), raw, flags=14 | tb.DAQMX))
        recording = open_recording(path)
        expected = 0.5 * np.vstack([np.tile(first.T, 2), np.tile(second.T, 2)]) + 1.0
        np.testing.assert_array_equal(recording.read(recording.channels), expected)
        peer = TdmsFile.read(path)["g"]
        np.testing.assert_array_equal(expected, [c[:] for c in peer.channels()])

    def test_scalers_that_change_their_places(self, path):
        rows = np.arange(40, dtype="<i2").reshape(20, 2)
        first, second = ([("i2", 0, 0, 0), ("i2", 0, 2, 0)], [("i2", 0, 2, 0), ("i2", 0, 0, 0)])
        parts = [
            tb.segment(self.channels(10, s, [4]), r.tobytes(), flags=14 | tb.DAQMX)
            for s, r in ((first, rows[:10]), (second, rows[10:]))
        ]
        path.write_bytes(b"".join(parts))
        recording = open_recording(path)
        expected = 0.5 * np.hstack([rows[:10].T, rows[10:].T[::-1]]) + 1.0
        np.testing.assert_array_equal(recording.read(recording.channels), expected)

    def test_cut_off_in_the_second_card(self, path):
        scalers = [("i4", 0, 0, 0), ("i4", 1, 0, 0)]
        raw = np.arange(20, dtype="<i4").tobytes()
        content = tb.segment(self.channels(10, scalers, [4, 4]), raw * 2, flags=14 | tb.DAQMX)
        path.write_bytes(content[:-16])
        recording = open_recording(path)
        assert [c.n_samples for c in recording.channels] == [16, 16]
        expected = 0.5 * np.array([[*range(10), *range(6)], [*range(10, 20), *range(10, 16)]]) + 1.0
        np.testing.assert_array_equal(recording.read(recording.channels), expected)

    def test_a_short_last_chunk_before_another_segment(self, path):
        rows = np.arange(28, dtype="<i2").reshape(14, 2)
        objects = self.channels(10, [("i2", 0, 0, 0), ("i2", 0, 2, 0)], [4])
        path.write_bytes(tb.segment(objects, rows.tobytes(), flags=14 | tb.DAQMX) * 2)
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels), 0.5 * np.tile(rows.T, 2) + 1.0)

    def test_digital_lines_are_read_by_nptdms(self, path):
        rows = np.random.default_rng(1).integers(0, 256, 50).astype("u1")
        scalers = [("u1", 0, bit, 0) for bit in (0, 3, 7)]
        path.write_bytes(
            tb.segment(self.channels(50, scalers, [1], digital=True), rows.tobytes(), flags=14 | tb.DAQMX)
        )
        assert set(read_headers(path).layout.foreign) == {tb.path("g", f"c{k}") for k in range(3)}
        recording = open_recording(path)
        expected = [0.5 * (rows >> bit & 1) + 1.0 for bit in (0, 3, 7)]
        np.testing.assert_array_equal(recording.read(recording.channels, 3, 41), np.array(expected)[:, 3:41])

    def test_a_digital_line_that_nptdms_would_misread_is_set_aside(self, path):
        objects = self.channels(10, [("u1", 0, 1, 0)], [1], digital=True)
        path.write_bytes(tb.segment(objects, bytes(14), flags=14 | tb.DAQMX) * 2)
        with pytest.raises(InputError, match=r"digital line.*short chunk"):
            open_recording(path)

    def test_two_scalers_of_a_channel_are_read_by_nptdms(self, path):
        rows = np.arange(40, dtype="<i2").reshape(20, 2)
        index = tb.daqmx(20, [("i2", 0, 0, 0), ("i2", 0, 2, 1)], [4])
        scale = {"NI_Number_Of_Scales": 3, "NI_Scale[2]_Scale_Type": "Subtract",
                 "NI_Scale[2]_Subtract_Left_Operand_Input_Source": 0,
                 "NI_Scale[2]_Subtract_Right_Operand_Input_Source": 1}  # fmt: skip
        objects = [(tb.path("g", "c"), index, {**tb.wave(1000.0), **scale})]
        path.write_bytes(tb.segment(objects, rows.tobytes(), flags=14 | tb.DAQMX))
        recording = open_recording(path)
        np.testing.assert_array_equal(recording.read(recording.channels)[0], rows[:, 1] - rows[:, 0])

    def test_counts_without_a_scaling_are_an_error(self, path):
        objects = [(tb.path("g", "c"), tb.daqmx(5, [("i2", 0, 0, 0)], [2]), tb.wave(1000.0))]
        path.write_bytes(tb.segment(objects, bytes(10), flags=14 | tb.DAQMX))
        with pytest.raises(InputError, match="counts come without a scaling"):
            open_recording(path)
