"""Limits: bands, totals and lines compared with them; the exit code; faulty files."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import specan
from specan.data.limits import LimitCurve
from specan.errors import InputError, RequestError
from specan.io.limit_file import read_limits
from specan.io.results_text import write_table
from specan_cli.main import main

sys.path.insert(0, str(Path(__file__).parent.parent / "io"))
import tdms_bytes as tb

RATE = 16000.0


@pytest.fixture
def tone(tmp_path: Path) -> Path:
    """1 Pa (93.98 dB) at 1 kHz."""
    samples = np.sqrt(2) * np.sin(2 * np.pi * 1000 * np.arange(16000) / RATE)
    objects = [
        ("/", tb.NO_DATA, {}),
        (tb.path("Rig"), tb.NO_DATA, {}),
        (tb.path("Rig", "Mic 1"), tb.plain("f8", 16000), {**tb.wave(RATE), "unit_string": "Pa"}),
    ]
    path = tmp_path / "tone.tdms"
    path.write_bytes(tb.segment(objects, samples.tobytes()))
    return path


def run(*arguments: object):
    return CliRunner().invoke(main, [str(a) for a in arguments], standalone_mode=False)


@pytest.mark.parametrize(("upper", "code", "excess"), [(95.0, 0, -1.02), (92.0, 5, 1.98)])
def test_bands_against_an_upper_limit(
    tone: Path, tmp_path: Path, upper: float, code: int, excess: float
) -> None:
    limits = tmp_path / "limits.csv"
    limits.write_text(f"band_hz,upper_dB\n1000,{upper}\n2000,90\n")
    done = run("octave", tone, "--fmin", 500, "--fmax", 4000, "--limit", limits, "--json")
    assert done.exception is None
    assert done.return_value == code
    found = json.loads(done.stdout)["limits"][0]
    assert found["passed"] is (code == 0)
    assert found["excess_dB"] == pytest.approx(excess, abs=0.02)
    assert (found["place"], found["compared"]) == ("1000 Hz", 2)
    words = run("octave", tone, "--fmin", 500, "--fmax", 4000, "--limit", limits).stdout
    assert ("FAILED" in words) is (code == 5)


def test_lower_limits_totals_and_decimal_commas(tone: Path, tmp_path: Path) -> None:
    limits = tmp_path / "limits.csv"
    limits.write_text("# of the machine\nband_hz;lower_dB;upper_dB\n1000;95,5;\ntotal-A;;93,0\n")
    done = run("octave", tone, "--fmax", 4000, "--limit", limits, "--json")
    found = json.loads(done.stdout)["limits"][0]
    assert found["excess_dB"] == pytest.approx(95.5 - 93.98, abs=0.02)
    assert done.return_value == 5


def test_lines_between_points_are_straight_over_the_logarithm() -> None:
    curve = LimitCurve("a", np.array([100.0, 10000.0]), np.full(2, np.nan), np.array([80.0, 40.0]))
    f = np.array([10.0, 100.0, 1000.0, 10000.0, 20000.0])
    kept = curve.of_lines("Mic 1", f, np.array([200.0, 70.0, 61.0, 10.0, 200.0]))
    assert kept.excess_dB == pytest.approx(1.0)  # 60 dB is the middle of 80 and 40 at the geometric mean
    assert (kept.place, kept.compared) == ("1000 Hz", 3)


def test_a_spectrum_through_the_verb(tone: Path, tmp_path: Path) -> None:
    limits = tmp_path / "limits.csv"
    limits.write_text("frequency_hz\tupper_dB\n500\t80\n2000\t80\n")
    done = run("fft", tone, "--lines", 625, "--window", "flat-top", "--limit", limits)
    assert done.return_value == 5
    assert "Mic 1: FAILED, 13.98 dB beyond the limit at 1000 Hz" in done.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("band_hz,uper_dB\n1,2\n", "unknown column 'uper_dB'"),
        ("band_hz\n1\n", "has the columns band_hz"),
        ("band_hz,upper_dB\n1000,loud\n", "line 2: 'loud' is not a number"),
        ("band_hz,upper_dB\n-5,10\n", "line 2: the frequency is '-5'"),
        ("band_hz,upper_dB\n", "a header and no limits"),
    ],
)
def test_faulty_files_are_told(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "limits.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_limits(path)


def test_limits_that_hold_for_nothing_are_told(tone: Path, tmp_path: Path) -> None:
    limits = tmp_path / "limits.csv"
    limits.write_text("band_hz,upper_dB\n12345,80\n")
    fault = run("octave", tone, "--fmax", 4000, "--limit", limits).exception
    assert isinstance(fault, RequestError)
    assert "no band or line" in str(fault)


def test_limits_are_drawn_where_they_hold(tone: Path) -> None:
    nothing = np.full(2, np.nan)
    curve = LimitCurve(
        "a", np.array([1000.0, 2000.0]), nothing, np.array([95.0, 120.0]), {"A": (np.nan, 93.0)}
    )
    bands, totals = specan.plot(specan.octave(tone, fmin=500, fmax=4000, fraction=1), limits=curve).axes
    (steps,) = [p.get_data() for p in bands.patches if p.get_label() == "a"]
    assert steps.values == pytest.approx([np.nan, 95.0, 120.0, np.nan], nan_ok=True)
    assert bands.get_ylim()[1] > 120
    assert [c.get_segments()[-1][:, 1].tolist() for c in totals.collections if len(c.get_segments())] == [
        [93.0, 93.0]
    ]
    lines = specan.plot(specan.fft(tone), limits=curve).axes[0].lines
    (line,) = [one for one in lines if one.get_label() == "a"]
    assert np.interp(2000.0, line.get_xdata(), line.get_ydata()) == pytest.approx(120.0)


def test_flags_have_the_decimal_sign_of_the_table(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_table(
        path, [], ["channel", "flags"], ["Mic 1.5\tedges counted-Leq_A=53.413 counted-max=66.99\n"], ","
    )
    assert path.read_text().splitlines()[-1] == "Mic 1.5\tedges counted-Leq_A=53,413 counted-max=66,99"
