"""Parts of the batch on their own: one pass for many analyses, joined tables, settings, rows."""

from pathlib import Path

import numpy as np
import pytest

from specan.analysis import accumulator
from specan.analysis.batch.inputs import Input, find_inputs
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.run import run_batch
from specan.analysis.batch.settings import BatchSettings, read_settings
from specan.analysis.batch.tables import noise_lines, write_tables
from specan.analysis.section import rms_about_mean
from specan.analysis.tone import Tone
from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError
from truth.rig import box_rig, noise_take, sine_take
from truth.rig_files import write_tdms

RATE = 8000.0
FEW = ("Mic 1", "Mic 2", "Vibrometer", "Generator")


class Collector:
    def __init__(self, channels: tuple[Channel, ...], start: int, stop: int) -> None:
        self.channels, self.start, self.stop = channels, start, stop
        self.pieces: list[np.ndarray] = []

    def add(self, samples: np.ndarray) -> None:
        self.pieces.append(samples.copy())


def recording(n: int = 1000) -> Recording:
    rng = np.random.default_rng(1)
    channels = tuple(Channel(f"c{i}", unit="V", sampling_rate=100.0, n_samples=n) for i in range(3))
    return Recording("a.tdms", channels, ArraySource(list(rng.standard_normal((3, n)))))


def test_every_accumulator_gets_its_channels_and_its_section(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accumulator, "READ_BLOCK", 64)
    a = recording()
    c = a.channels
    wanted = [((c[0], c[1], c[2]), 0, 1000), ((c[2], c[0]), 0, 1000), ((c[1],), 130, 777)]
    collectors = [Collector(*args) for args in wanted]
    accumulator.feed(a, collectors)
    for collector, (channels, start, stop) in zip(collectors, wanted, strict=True):
        np.testing.assert_array_equal(np.hstack(collector.pieces), a.read(channels, start, stop))


def test_analyses_of_one_section_share_one_pass() -> None:
    a = recording()
    reads = []
    source = a.source.read
    object.__setattr__(a.source, "read", lambda *args: reads.append(args) or source(*args))
    accumulator.feed(a, [Collector(a.channels, 0, 1000), Collector(a.channels[:1], 0, 1000)])
    assert len(reads) == 1


@pytest.mark.parametrize("block", [1009, 4096])
def test_bytes_do_not_depend_on_how_much_is_read_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    rig = box_rig()
    write_tdms(tmp_path / "in" / "noise.tdms", rig, noise_take(rig, 1.0, 20000, RATE, 2).only(FEW))
    write_tdms(tmp_path / "in" / "sine.tdms", rig, sine_take(rig, 250.3, 1.0, 20000, RATE, 3).only(FEW))
    first = run_batch([tmp_path / "in"], tmp_path / "first").tables
    monkeypatch.setattr(accumulator, "READ_BLOCK", block)
    second = run_batch([tmp_path / "in"], tmp_path / "second").tables
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name


def test_progress_reaches_the_end(tmp_path: Path) -> None:
    rig = box_rig()
    for name in "ab":
        write_tdms(tmp_path / "in" / f"{name}.tdms", rig, sine_take(rig, 250.0, 1.0, 2000, RATE, 3).only(FEW))
    seen: list[tuple[int, int, float]] = []
    run_batch([tmp_path / "in"], tmp_path / "out", progress=lambda *args: seen.append(args))
    assert [entry[:2] for entry in seen] == [(1, 2), (2, 2)]
    assert seen[0][2] > 0.0
    assert seen[-1][2] == 0.0  # seconds that remain


def test_an_interruption_leaves_no_half_table(tmp_path: Path) -> None:
    rig = box_rig()
    write_tdms(tmp_path / "in" / "a.tdms", rig, sine_take(rig, 250.0, 1.0, 2000, RATE, 3).only(FEW))

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_batch([tmp_path / "in"], tmp_path / "out", progress=interrupt)
    assert [path.name for path in (tmp_path / "out").iterdir()] == [".specan"]
    assert not list((tmp_path / "out" / ".specan").glob("*.part"))


def test_labels_are_sorted_and_use_forward_slashes(tmp_path: Path) -> None:
    for name in ("b/x.tdms", "a.tdms", "b.TDMS", "ab/y.wav"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"TDSm")
    assert [entry.label for entry in find_inputs([tmp_path])] == ["a.tdms", "ab/y.wav", "b.TDMS", "b/x.tdms"]


def test_a_message_names_no_place_on_this_machine() -> None:
    entry = Input("/home/me/data/a.tdms", "a.tdms", "/home/me/data", 1)
    assert entry.neutral("a.tdms: /home/me/data/a.tdms is cut") == "a.tdms is cut"


def test_sines_over_different_references_are_not_joined(tmp_path: Path) -> None:
    tables = []
    for number, vibrometer in enumerate(("Vibrometer", "Laser")):
        t = np.arange(4000) / RATE
        samples = [np.cos(2 * np.pi * (200 + number) * t), np.sin(2 * np.pi * (200 + number) * t)]
        channels = (
            Channel("Mic 1", unit="Pa", role="microphone", sampling_rate=RATE, n_samples=4000),
            Channel(vibrometer, unit="m/s", role="vibrometer", sampling_rate=RATE, n_samples=4000),
        )
        tables.append(Tone()(Recording(f"sub/{number}.tdms", channels, ArraySource(samples))))
    results = [FileResult(t.label, "done", tones=(t,)) for t in tables]
    write_tables(tmp_path, ["settings"], results)
    skipped = (tmp_path / "skipped.txt").read_text().splitlines()[-1].split("\t")
    assert skipped[:3] == ["sub/*", "", "aside"]
    assert "are over different references: Laser, Vibrometer" in skipped[3]
    assert "stepped-sine" not in (tmp_path / "sine.txt").read_text()


def test_words_of_a_line_are_put_together() -> None:
    v = np.random.default_rng(0).standard_normal((2, 4096))
    v[1] += 3 * v[0]
    channels = (
        Channel("Vib", unit="m/s", role="vibrometer", sampling_rate=RATE, n_samples=4096),
        Channel("Mic 1", unit="Pa", role="microphone", sampling_rate=RATE, n_samples=4096),
    )
    response = TransferFunction(lines=50)(Recording("a.tdms", channels, ArraySource(list(v))))
    low = response.line_flags["low-snr"]
    low[0, ::2] = True
    object.__setattr__(response, "u_magnitude_percent", np.where(low, 50.0, 1.0))
    lines = noise_lines(response, [("clipped",)]).splitlines()
    words = [line.split("\t")[-1] for line in lines]
    assert words[0].split()[:2] == ["clipped", "low-snr"]
    assert "low-snr" not in words[1] or low[0, 1]
    assert len(lines) == 50


def test_rms_of_a_large_constant_part() -> None:
    channel = Channel("p", unit="Pa", sampling_rate=1.0, n_samples=100_000)
    x = 101_325.0 + np.sin(np.arange(100_000.0))[None]
    found = rms_about_mean(Recording("r", (channel,), ArraySource(list(x))), (channel,), 100_000)
    assert found[0] == pytest.approx(np.std(x), rel=1e-9)


def test_a_setting_given_on_the_command_line_overrules_the_file(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text('reference = "Mic 2"\n[transfer_function]\nlines = 100\nestimator = "H2"\n')
    found = read_settings(path, {"reference": "Mic 1", "transfer_function": {"lines": 50}})
    assert (found.reference, found.transfer_function.lines, found.transfer_function.estimator) == (
        "Mic 1",
        50,
        "H2",
    )
    assert found.tone.reference == found.transfer_function.reference == "Mic 1"


def test_the_hash_changes_with_any_setting() -> None:
    assert BatchSettings().fingerprint == BatchSettings().fingerprint
    assert BatchSettings().fingerprint != BatchSettings(tone=Tone(harmonics=3)).fingerprint


def test_jobs_have_to_be_some(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="number of processes is 0"):
        run_batch([tmp_path], tmp_path / "out", jobs=0)
