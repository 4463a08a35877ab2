"""A batch over recordings by instruments that none of us knows: each file has a result or a true reason.

They lie outside the project, in ``../shared/recordings`` or where SPECAN_RECORDINGS says; without
them the test is skipped.
"""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from specan_cli.main import main

PLACE = Path(os.environ.get("SPECAN_RECORDINGS", Path(__file__).parents[3] / "shared" / "recordings"))
pytestmark = [
    pytest.mark.recordings,
    pytest.mark.skipif(not PLACE.is_dir(), reason=f"no recordings in {PLACE.name}"),
]
ANALYSED = {
    "DASDAE_test_data__iDAS005_tdms_example.626.tdms",
    "adamreeve_npTDMS__Digital_Input.tdms",
    "adamreeve_npTDMS__big_endian.tdms",
    "adamreeve_npTDMS__raw1.tdms",
    "dhstuart_PhotometricElectricTestingAutomation__test.tdms",
    "dnvgl_qats__data.tdms",
    "humphreysb_ConvertTDMS__Raw000.tdms",
    "jaumegomezescuer_ExpRestistance__0504DAQ10.tdms",
}
REASONS = {
    "DanBerge_TDMSReader.jl__DAQmx_example.tdms": ("failed", "are damaged"),
    "contiguous_truncated_unequal.tdms": ("failed", "no sampling rate for 'c0'"),
    "interleaved_short_chunk_midfile.tdms": ("failed", "no sampling rate for 'c0'"),
    "mattlumantas_AoA__10deg.tdms": ("failed", "no sampling rate for 'IQ Graph_Plot0'"),
    "mattlumantas_AoA__Power_Spectrum.tdms": ("aside", "a two-sided spectrum"),
    "mikeobrien_TDMSReader__AdditionalProperties.tdms": ("aside", "it is a table over 'Freq (Hz)'"),
}


def rows(path: Path) -> list[list[str]]:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [line.split("\t") for line in lines[1:]]


@pytest.mark.long
def test_every_file_has_a_result_or_a_reason(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["batch", str(PLACE), "-o", str(tmp_path)], standalone_mode=False)
    assert result.exception is None
    assert result.return_value == 1
    assert {row[0] for row in rows(tmp_path / "other.txt")} == ANALYSED
    skipped = {row[0]: row for row in rows(tmp_path / "skipped.txt") if not row[1] and row[0] not in ANALYSED}
    tables = {row[0] for row in skipped.values() if row[0].endswith(".csv")}
    assert all(skipped[name][2] == "aside" for name in tables)
    assert set(skipped) - tables == set(REASONS)
    for name, (kind, reason) in REASONS.items():
        assert skipped[name][2] == kind
        assert reason in skipped[name][3]
    present = {path.name for path in PLACE.glob("*.tdms")}
    assert present == ANALYSED | set(REASONS)
    # Two channels of the slow record have an RMS and no band.
    slow = [row for row in rows(tmp_path / "other.txt") if row[0].startswith("humphreysb")]
    assert [row[4] for row in slow] == ["total-Z", "total-Z"]
