"""A file with a group for each run, and channels that begin at different instants: what every verb makes of them."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from nptdms import ChannelObject, TdmsWriter

import specan
from specan.errors import SpecanError
from specan_cli.main import main

RATE = 8000
GAINS = {"Run 1": 2.0, "Run 2": 5.0}
BOTH = ["Run 1/Mic 1", "Run 2/Mic 1"]


def write(path: Path, channels: dict[tuple[str, str], tuple[np.ndarray, dict]]) -> Path:
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                ChannelObject(
                    group,
                    name,
                    samples,
                    {
                        "wf_increment": 1 / RATE,
                        "wf_start_offset": 0.0,
                        "wf_samples": 1,
                        "unit_string": "Pa" if name.startswith("Mic") else "m/s",
                        **more,
                    },
                )
                for (group, name), (samples, more) in channels.items()
            ]
        )
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> Path:
    """Two runs: in each the pressure is its own multiple of its own velocity."""
    rng = np.random.default_rng(3)
    found = {}
    for run, gain in GAINS.items():
        velocity = 0.01 * rng.standard_normal(4 * RATE)
        found[run, "Mic 1"] = gain * velocity, {}
        found[run, "Vibrometer"] = velocity, {}
    return write(tmp_path_factory.mktemp("runs") / "runs.tdms", found)


def run(*words: object) -> str:
    result = CliRunner().invoke(main, [str(w) for w in words], standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def column(path: Path, name: str) -> list[str]:
    lines = [line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")]
    return [row[name] for row in csv.DictReader(lines, delimiter="\t")]


@pytest.mark.parametrize("verb", ["octave", "fft", "rms"])
def test_channels_of_one_name_are_told_apart(verb, runs, tmp_path):
    expected = [f"{group}/{name}" for group in GAINS for name in ("Mic 1", "Vibrometer")]
    out = tmp_path / "out.txt"
    shown = run(verb, runs, "-o", out)
    assert list(dict.fromkeys(column(out, "channel"))) == expected
    if verb != "rms":
        assert all(name in shown for name in BOTH)
    content = json.loads(run(verb, runs, "--json"))
    assert [c["channel"] for c in content["channels"]] == expected
    frame = getattr(specan, verb)(runs).to_dataframe()
    assert list(dict.fromkeys(frame["channel"])) == expected


def test_a_run_is_referred_to_its_own_vibrometer(runs):
    for group, gain in GAINS.items():
        for chosen in ({"channels": (f"{group}/*",)}, {"reference": f"{group}/Vibrometer"}):
            found = specan.frf(runs, lines=200, **chosen)
            assert found.channels == (f"{group}/Mic 1",)
            assert found.reference == f"{group}/Vibrometer"
            np.testing.assert_allclose(found.response, gain, rtol=1e-9)
    assert "Run 2 left out" in " ".join(specan.frf(runs, lines=200).notes)
    across = specan.frf(runs, lines=200, channels=("Run 2/Mic 1",), reference="Run 1/Vibrometer")
    assert np.median(across.coherence) < 0.2  # asked for, and independent


def test_a_batch_refers_each_run_to_its_own_vibrometer(runs, tmp_path):
    done = specan.batch(runs.parent, tmp_path / "out", transfer_function={"lines": 200})
    noise = done.table("noise")
    for name, gain in zip(BOTH, GAINS.values()):
        np.testing.assert_allclose(noise["magnitude"][noise["channel"] == name], gain, rtol=1e-5)
    assert set(done.table("bands")["channel"]) == {f"{g}/{n}" for g in GAINS for n in ("Mic 1", "Vibrometer")}


LATE = 0.001
CLOCK = np.datetime64("2024-05-01T12:00:00")


@pytest.mark.parametrize(
    "late",
    [
        {"wf_start_offset": LATE},
        {"wf_start_offset": LATE + 0.3 / RATE},
        {"wf_start_time": CLOCK + np.timedelta64(1000, "us")},
    ],
)
def test_a_channel_that_begins_later_is_aligned(late, tmp_path):
    """1 ms is 90 degrees at 250 Hz; a part of a sample is a phase as well."""
    t = np.arange(2 * RATE) / RATE
    begin = late.get("wf_start_offset", LATE)
    first = {"wf_start_time": CLOCK}
    path = write(
        tmp_path / "late.tdms",
        {
            ("G", "Mic 1"): (2 * np.cos(2 * np.pi * 250 * (t + begin)), {**first, **late}),
            ("G", "Mic 2"): (2 * np.cos(2 * np.pi * 250 * t), first),
            ("G", "Vibrometer"): (np.cos(2 * np.pi * 250 * t), first),
        },
    )
    tone = specan.tones(path)
    np.testing.assert_allclose(tone.phase_deg, 0.0, atol=1e-6)
    assert any("begin up to 0.001" in note for note in tone.notes)
    frf = specan.frf(path, lines=200)
    line = int(np.argmin(np.abs(frf.frequency_hz - 250)))
    np.testing.assert_allclose(frf.phase_deg[:, line], 0.0, atol=0.05)
    fft = specan.fft(path, lines=200, reference="Vibrometer")
    np.testing.assert_allclose(fft.phase_deg[:, line + 1], 0.0, atol=0.05)


def test_a_channel_that_was_not_recorded_with_the_others_costs_only_itself(tmp_path):
    rng = np.random.default_rng(3)
    velocity = rng.standard_normal(2 * RATE)
    path = write(
        tmp_path / "apart.tdms",
        {
            ("G", "Mic 1"): (2 * velocity, {}),
            ("G", "Mic 2"): (3 * velocity, {"wf_start_offset": 1e4}),
            ("G", "Vibrometer"): (velocity, {}),
        },
    )
    found = specan.frf(path, lines=200)
    assert found.channels == ("Mic 1",)
    np.testing.assert_allclose(found.response, 2.0, rtol=1e-9)
    assert any("Mic 2 is left out" in note for note in found.notes)
    for analyse in (specan.frf, specan.fft, specan.impulse):
        with pytest.raises(SpecanError, match="Mic 2 is left out: it was not recorded at the same time"):
            analyse(path, reference="Vibrometer", channels="Mic 2")


def test_levels_of_tones_need_no_common_time(tmp_path):
    """Without a reference nothing is compared: runs one after the other keep their levels."""
    t = np.arange(RATE) / RATE
    path = write(
        tmp_path / "levels.tdms",
        {
            (group, "Mic 1"): (a * np.sin(2 * np.pi * 250 * t), {"wf_start_offset": late})
            for group, a, late in (("Run 1", 1.0, 0.0), ("Run 2", 3.0, 600.0))
        },
    )
    found = specan.tones(path)
    assert found.channels == tuple(BOTH)
    np.testing.assert_allclose(found.tone_rms, np.array([1.0, 3.0]) / np.sqrt(2), rtol=1e-6)
