"""Recordings by instruments that none of us knows: each gives samples or a true reason.

They lie outside the project, in ``../shared/recordings`` or where SPECAN_RECORDINGS says; without
them the tests are skipped.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from nptdms import TdmsFile

from specan.errors import InputError
from specan.io.open import find_recordings, open_recording
from specan.io.tdms_headers import quiet

PLACE = Path(os.environ.get("SPECAN_RECORDINGS", Path(__file__).parents[3] / "shared" / "recordings"))
pytestmark = [
    pytest.mark.recordings,
    pytest.mark.skipif(not PLACE.is_dir(), reason=f"no recordings in {PLACE.name}"),
]

# Recordings: channels, rate of the first, length. Reasons: what the message says.
RECORDINGS = {
    "DASDAE_test_data__iDAS005_tdms_example.626.tdms": (1152, 1000.0, 1000),
    "adamreeve_npTDMS__Digital_Input.tdms": (1, 2000.0, 20000),
    "adamreeve_npTDMS__big_endian.tdms": (2, 1000.0, 3500),
    "adamreeve_npTDMS__raw1.tdms": (7, 50000.0, 2000),
    "dhstuart_PhotometricElectricTestingAutomation__test.tdms": (2, 96000.0, 4096),
    "dnvgl_qats__data.tdms": (4, pytest.approx(100.0, rel=1e-4), 21560),
    "humphreysb_ConvertTDMS__Raw000.tdms": (2, pytest.approx(7.76, rel=1e-3), 20),
    "jaumegomezescuer_ExpRestistance__0504DAQ10.tdms": (1, 5000.0, 13650),
}
REASONS = {
    "DanBerge_TDMSReader.jl__DAQmx_example.tdms": "headers .* are damaged",
    "contiguous_truncated_unequal.tdms": "no sampling rate for 'c0'",
    "interleaved_short_chunk_midfile.tdms": "no sampling rate for 'c0'",
    "mattlumantas_AoA__10deg.tdms": "no sampling rate for 'IQ Graph_Plot0'",
    "mattlumantas_AoA__Power_Spectrum.tdms": "two-sided spectrum, not a time signal",
    "mikeobrien_TDMSReader__AdditionalProperties.tdms": r"table over 'Freq \(Hz\)'",
}


def test_each_of_them_is_known():
    found = {f.label for f in find_recordings([PLACE]) if f.path.suffix == ".tdms"}
    assert found == RECORDINGS.keys() | REASONS.keys()


@pytest.mark.parametrize("name", RECORDINGS)
def test_recordings(name):
    recording = open_recording(PLACE / name)
    first = recording.channels[0]
    assert (len(recording.channels), first.sampling_rate, first.n_samples) == RECORDINGS[name]


@pytest.mark.parametrize("name", REASONS)
def test_reasons(name):
    with pytest.raises(InputError, match=REASONS[name]):
        open_recording(PLACE / name)


@pytest.mark.parametrize("name", [*RECORDINGS, "mattlumantas_AoA__10deg.tdms"])
def test_samples_are_those_of_nptdms(name):
    recording = open_recording(PLACE / name, sampling_rate=1000.0)
    with quiet():
        peer = TdmsFile.read(PLACE / name)
    for channel in recording.channels:
        expected = peer[channel.group][channel.name][:].astype(np.float64)
        read = recording.read([channel])[0]
        np.testing.assert_array_equal(read, expected * channel.gain)
        np.testing.assert_array_equal(recording.read([channel], 3, channel.n_samples - 1)[0], read[3:-1])


def test_interleaved_where_nptdms_is_wrong():
    recording = open_recording(PLACE / "interleaved_short_chunk_midfile.tdms", sampling_rate=1000.0)
    expected = np.loadtxt(PLACE / "interleaved_short_chunk_midfile.expected.csv", delimiter=",")
    np.testing.assert_array_equal(recording.read(recording.channels), expected.T)


def test_cut_off_where_nptdms_gives_unequal_lengths():
    recording = open_recording(PLACE / "contiguous_truncated_unequal.tdms", sampling_rate=1000.0)
    assert recording.flags == ("truncated",)
    expected = np.arange(200) + 1_000_000 * np.arange(4)[:, None]
    np.testing.assert_array_equal(recording.read(recording.channels), expected)


def test_what_is_set_aside_has_a_reason():
    recording = open_recording(PLACE / "humphreysb_ConvertTDMS__Raw000.tdms")
    assert len(recording.set_aside) == 77
    assert "not uniform" in recording.set_aside["Synchronous/Air Manifold Pressure"]
    recording = open_recording(PLACE / "humphreysb_ConvertTDMS__Raw000.tdms", sampling_rate=1000.0)
    assert "Units 'kPa' are not applied" in recording.channel("Air Manifold Pressure").decisions["unit"]
