"""Rates of TDMS channels: the order of what counts, and what is not time signal at all."""

import numpy as np
import pytest
import tdms_bytes as tb
from nptdms import ChannelObject, TdmsWriter
from tdms_bytes import write

from specan.errors import InputError, NoSignalError, RequestError
from specan.io.open import open_recording


def rate_of(recording):
    return recording.channels[0].sampling_rate, recording.channels[0].decisions["sampling_rate"]


class TestSamplingRate:
    data = np.arange(100.0)

    def test_increment_of_the_channel(self, path):
        write(path, [("c", self.data, {"wf_increment": 1 / 51200})])
        assert rate_of(open_recording(path))[0] == 51200.0

    @pytest.mark.parametrize(
        ("increment", "rate"),
        [
            (1.9999999999999998e-05, 50e3), (1.04167e-05, 96e3), (1 / 44100, 44100.0), (1.95313e-05, 51200.0),
            (9.766e-06, 102400.0), (float(np.float32(1 / 25600)), 25600.0), (1 / 12345.6, 12345.6),
            (3.3e-4, 1 / 3.3e-4), (4.0, 0.25), (600.0, 1 / 600),
        ],
    )  # fmt: skip
    def test_rounded_increments_go_back_to_the_nominal_rate(self, path, increment, rate):
        write(path, [("c", self.data, {"wf_increment": increment})])
        assert rate_of(open_recording(path))[0] == pytest.approx(rate, rel=1e-14)

    def test_the_user_counts_first(self, path):
        write(path, [("c", self.data, {"wf_increment": 0.001})])
        assert rate_of(open_recording(path, sampling_rate=8000.0)) == (8000.0, "stated by the user")

    @pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
    def test_a_rate_that_is_none_is_refused(self, path, rate):
        write(path, [("c", self.data, {"wf_increment": 0.001})])
        with pytest.raises(RequestError, match="above zero"):
            open_recording(path, sampling_rate=rate)

    @pytest.mark.parametrize("increment", [0.0, -1e-3, float("nan"), 1.0, 2e6, 5e-324])
    def test_placeholders_and_implausible_increments_are_no_rate(self, path, increment):
        write(path, [("c", self.data, {"wf_increment": increment})])
        with pytest.raises(
            InputError, match=r"a\.tdms.*'c'.*wf_increment.*key.*time channel.*--sampling-rate"
        ):
            open_recording(path)

    def test_a_key_takes_the_place_of_a_placeholder(self, path):
        write(path, [("c", self.data, {"wf_increment": 1.0})], root={"Sampling Rate": 2000.0})
        assert rate_of(open_recording(path))[0] == 2000.0

    @pytest.mark.parametrize(
        ("key", "value", "rate"),
        [
            ("SamplingFrequency[Hz]", 1000.0, 1000.0), ("SamplingRate", 51200, 51200.0), ("fs", "51,2 kHz", 51200.0),
            ("Sample Rate (kHz)", 48, 48000.0), ("sampling_interval_ms", 0.5, 2000.0), ("log-dt", 0.0005, 2000.0),
        ],
    )  # fmt: skip
    def test_known_keys_of_the_file(self, path, key, value, rate):
        write(path, [("c", self.data, {})], root={key: value})
        found, how = rate_of(open_recording(path))
        assert found == pytest.approx(rate, rel=1e-12)
        assert key in how

    def test_keys_of_the_group(self, path):
        write(path, [("c", self.data, {})], group={"SamplingRate": 204800.0})
        assert rate_of(open_recording(path)) == (204800.0, "the group key 'SamplingRate' = 204800.0")

    def test_two_keys_that_contradict_each_other_are_both_named(self, path):
        root = {"SamplingFrequency[Hz]": 1000.0, "Precise Sampling Frequency (Hz)": 500.0}
        write(path, [("c", self.data, {})], root=root)
        with pytest.raises(InputError, match=r"SamplingFrequency\[Hz\].*Precise Sampling Frequency \(Hz\)"):
            open_recording(path)
        assert rate_of(open_recording(path, sampling_rate=1000.0))[0] == 1000.0

    def test_a_key_that_contradicts_the_increment_is_told(self, path):
        write(path, [("c", self.data, {"wf_increment": 0.001})], group={"SamplingRate": 51200.0})
        rate, how = rate_of(open_recording(path))
        assert rate == 1000.0
        assert "51200" in how

    def test_increment_on_some_channels_only(self, path):
        write(path, [("with", self.data, {"wf_increment": 0.001}), ("without", self.data, {})])
        recording = open_recording(path)
        assert [c.name for c in recording.channels] == ["with"]
        assert "no sampling rate for 'without'" in recording.set_aside["g/without"]

    def test_increment_without_offset(self, path):
        write(path, [("c", self.data, {"wf_increment": 0.001, "wf_samples": 10})])
        channel = open_recording(path).channels[0]
        assert channel.start_offset_s == 0.0
        assert channel.n_samples == 100  # wf_samples is the size of one write

    def test_groups_at_two_rates(self, path):
        with TdmsWriter(path) as writer:
            writer.write_segment([
                ChannelObject("slow", "Mic 1", np.zeros(100), {"wf_increment": 1 / 102400}),
                ChannelObject("fast", "Mic 1", np.zeros(200), {"wf_increment": 1 / 204800}),
            ])  # fmt: skip
        recording = open_recording(path)
        assert [c.sampling_rate for c in recording.channels] == [102400.0, 204800.0]
        with pytest.raises(RequestError, match="one sampling rate"):
            recording.read(recording.channels, 0, 10)

    def test_the_channel_table_gives_a_rate(self, path, tmp_path):
        write(path, [("c", self.data, {})])
        (tmp_path / "channels.csv").write_text("channel,sampling_rate_hz\nc,8000\n")
        assert rate_of(open_recording(path)) == (8000.0, "channels.csv")


class TestTimeChannel:
    def test_nanoseconds(self, path):
        ticks = 1_583_446_009_000_000_000 + (np.arange(500) * 1e9 / 51200).round().astype(np.int64)
        write(path, [("Time", ticks, {"Unit_String": "ns"}), ("c", np.zeros(500), {})])
        recording = open_recording(path)
        rate, how = rate_of(recording)
        assert rate == pytest.approx(51200.0, rel=1e-6)
        assert "scatter" not in how  # differences are taken before nanoseconds since 1970 become float64
        assert recording.set_aside == {"g/Time": "it is the time axis of its group"}

    def test_time_stamps(self, path):
        stamps = np.datetime64("2020-01-01T00:00:00") + (np.arange(300) * 10_000).astype("timedelta64[us]")
        write(path, [("stamp", stamps, {}), ("c", np.zeros(300), {})])
        assert rate_of(open_recording(path))[0] == 100.0

    @pytest.mark.parametrize(
        ("name", "scale"), [("Time (ms)", 1e3), ("time_s", 1.0), ("Zeit [µs]", 1e6), ("t", 1.0)]
    )
    def test_unit_in_the_name(self, path, name, scale):
        write(path, [(name, np.arange(300) / 2000 * scale, {}), ("c", np.zeros(300), {})])
        assert rate_of(open_recording(path))[0] == pytest.approx(2000.0, rel=1e-12)

    def test_not_uniform_is_no_rate(self, path):
        time = np.arange(300) / 2000.0
        time[150:] += 0.01
        write(path, [("Time", time, {"unit_string": "s"}), ("c", np.zeros(300), {})])
        with pytest.raises(InputError, match="not uniform"):
            open_recording(path)

    def test_a_very_long_axis(self, path):
        time = np.arange(500_001) / 2000.0
        write(path, [("Time", time, {"unit_string": "s"}), ("c", np.zeros(500_001), {})])
        assert rate_of(open_recording(path))[0] == pytest.approx(2000.0, rel=1e-12)

    def test_a_gap_in_a_very_long_axis(self, path):
        time = np.arange(500_001) / 2000.0
        time[200_000:] += 1.0
        write(path, [("Time", time, {"unit_string": "s"}), ("c", np.zeros(500_001), {})])
        with pytest.raises(InputError, match="not uniform"):
            open_recording(path)

    def test_another_length_is_another_axis(self, path):
        write(path, [("Time", np.arange(10) / 2000.0, {"unit_string": "s"}), ("c", np.zeros(300), {})])
        with pytest.raises(InputError, match="no time channel of its length"):
            open_recording(path)

    def test_counts_without_a_unit_are_no_time(self, path):
        write(path, [("Time", np.arange(300), {}), ("c", np.zeros(300), {})])
        with pytest.raises(InputError, match="counts without a unit"):
            open_recording(path)

    def test_a_temperature_called_T_is_a_signal(self, path):
        write(path, [("T", np.zeros(300), {"wf_increment": 0.01})])
        assert [c.name for c in open_recording(path).channels] == ["T"]


class TestNoTimeSignal:
    @pytest.mark.parametrize(
        "properties",
        [
            {"wf_increment": 4.0, "wf_start_offset": -200.0},
            {"wf_increment": 0.25, "NI_ExpXDimension": "f"},
            {"wf_increment": 0.25, "wf_xunit_string": "Hz"},
            {"wf_increment": 0.25, "wf_xname": "Frequency"},
        ],
    )
    def test_a_spectrum(self, path, properties):
        write(path, [("c", np.zeros(100), properties)])
        with pytest.raises(NoSignalError, match="spectrum, not a time signal"):
            open_recording(path)

    def test_a_spectrum_beside_a_signal_is_set_aside(self, path):
        write(
            path,
            [("Mic", np.zeros(100), {"wf_increment": 1e-4}), ("PSD", np.zeros(50), {"wf_increment": 0.5})],
        )
        recording = open_recording(path)
        assert [c.name for c in recording.channels] == ["Mic"]
        assert "spectrum" in recording.set_aside["g/PSD"]

    def test_a_time_signal_in_a_group_called_fft(self, path):
        write(path, [("Mic", np.zeros(100), {"wf_increment": 1e-4})], name="FFT test")
        assert open_recording(path).channels[0].sampling_rate == 1e4

    def test_a_table_over_frequency(self, path):
        placeholder = {"wf_increment": 1.0}
        write(path, [("Freq (Hz)", np.arange(20.0), placeholder), ("U (V)", np.zeros(20), placeholder)])
        with pytest.raises(NoSignalError, match=r"table over 'Freq \(Hz\)'"):
            open_recording(path)

    def test_decimated_copies(self, path):
        with TdmsWriter(path) as writer:
            for level in (0, 1, 2):
                n = 400 // 10**level
                properties = {"wf_increment": 0.001 * 10**level, "DecimationLevel": level}
                writer.write_segment([ChannelObject(f"level {level}", "c", np.zeros(n), properties)])
        recording = open_recording(path)
        assert [c.group for c in recording.channels] == ["level 0"]
        assert "decimated copy (level 2)" in recording.set_aside["level 2/c"]

    def test_empty_scalar_text_complex(self, path):
        wave = {"wf_increment": 0.001}
        write(path, [
            ("signal", np.arange(5.0), wave), ("shorter", np.arange(3.0), wave), ("scalar", np.array([1.0]), wave),
            ("text", np.array(["a", "b"]), wave),
        ])  # fmt: skip
        pairs = np.arange(4, dtype="c16").tobytes()
        more = [
            (tb.path("g", "empty"), tb.NO_DATA, wave),
            (tb.path("g", "complex"), tb.plain("c16", 4), wave),
        ]
        path.write_bytes(path.read_bytes() + tb.segment(more, pairs))
        recording = open_recording(path)
        assert {c.name: c.n_samples for c in recording.channels} == {"signal": 5, "shorter": 3}
        assert recording.set_aside == {
            "g/scalar": "it is a single number",
            "g/text": "it holds text",
            "g/empty": "it has no samples",
            "g/complex": "its samples are complex",
        }
        np.testing.assert_array_equal(recording.read([recording.channel("signal")])[0], np.arange(5.0))

    def test_a_channel_that_was_set_aside_says_why(self, path):
        write(path, [("c", np.zeros(9), {"wf_increment": 0.1}), ("one", np.zeros(1), {})])
        with pytest.raises(InputError, match="single number"):
            open_recording(path).channel("one")
