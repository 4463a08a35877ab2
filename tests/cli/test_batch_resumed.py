"""A batch that was killed, interrupted, or stopped by a full disk goes on, and ends with the same bytes."""

import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from truth.rig import box_rig, calibrator_take, noise_take, sine_take
from truth.rig_files import write_tdms

RATE, FILES = 8000.0, 8
FEW = ("Mic 1", "Mic 2", "Vibrometer", "Generator")
TABLES = ("bands.txt", "calibration.toml", "noise.txt", "other.txt", "sine.txt", "skipped.txt")
posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Noise, sines, a calibrator recording and one file that is none."""
    place, rig = tmp_path_factory.mktemp("campaign"), box_rig()
    for number in range(FILES - 2):
        take = sine_take(rig, 200.0 + 50 * number, 1.0, 4000, RATE, number)
        write_tdms(place / "sine" / f"{number}.tdms", rig, take.only(FEW))
    for number in range(2):
        take = noise_take(rig, 1.0, 30000, RATE, 20 + number)
        write_tdms(place / "noise" / f"{number}.tdms", rig, take.only(FEW))
    write_tdms(place / "calibrator.tdms", rig, calibrator_take(rig, (1, 2), 12000, RATE, 60))
    (place / "broken.tdms").write_bytes(b"nothing")
    return place


def command(campaign: Path, out: Path, *more: str) -> list[str]:
    return [
        sys.executable,
        "-m",
        "specan_cli",
        "batch",
        str(campaign),
        "-o",
        str(out),
        "--lines",
        "400",
        *more,
    ]


def run(campaign: Path, out: Path, *more: str, **how) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(campaign, out, *more), capture_output=True, text=True, check=False, **how)


def begin(campaign: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(campaign, out, *more), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def kept(out: Path) -> set[Path]:
    return set((out / ".specan").glob("*.result"))


def resumed(done: subprocess.CompletedProcess[str]) -> int:
    found = re.search(r"(\d+) results of an earlier run", done.stderr)
    return int(found[1]) if found else 0


def tables(out: Path) -> dict[str, bytes]:
    return {name: (out / name).read_bytes() for name in TABLES if (out / name).exists()}


@pytest.fixture(scope="module")
def whole(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The tables of a batch that nobody interrupted."""
    out = tmp_path_factory.mktemp("whole")
    assert run(campaign, out).returncode == 1  # because of the broken file
    found = tables(out)
    assert sorted(found) == list(TABLES)
    return found


def moments(rng: random.Random, n: int) -> Iterator[tuple[int, float]]:
    """Results that are waited for before a kill, and seconds after them."""
    for _ in range(n):
        yield rng.choice([0, 1, 1, 2, 3]), rng.choice([0.0, rng.uniform(0.0, 0.03), rng.uniform(0.0, 0.3)])


@pytest.mark.long
@posix
@pytest.mark.parametrize(("seed", "jobs"), [(1, 1), (5, 2)])
def test_killed_four_times_over(
    campaign: Path, whole: dict[str, bytes], tmp_path: Path, seed: int, jobs: int
) -> None:
    out, rng = tmp_path / "out", random.Random(seed)
    for more, delay in moments(rng, 4):
        before, process = kept(out), begin(campaign, out, "--jobs", str(jobs))
        while process.poll() is None and len(kept(out)) < len(before) + more:
            time.sleep(0.002)
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert kept(out) >= before  # what was done stays done
        assert set(tables(out).items()) <= set(whole.items())  # each is there as a whole or not at all
    before = kept(out)
    done = run(campaign, out, "--jobs", str(jobs))
    assert done.returncode == 1
    assert resumed(done) == len(before)  # and is not done again
    assert tables(out) == whole
    assert len(kept(out)) == FILES
    assert not list(out.rglob("*.part"))


# The batch itself says when it has kept two results, and then waits for the interruption, however slow the machine is.
# A shell that starts the tests in the background lets them ignore Ctrl-C, and children inherit that.
WAITS_AFTER_TWO = """
import os
import signal
import time
from specan.analysis.batch.store import Store
from specan_cli.main import run

signal.signal(signal.SIGINT, signal.default_int_handler)
put = Store.put

def waiting(self, *arguments):
    kept = put(self, *arguments)
    if len(list(self.place.glob("*.result"))) >= 2:  # two processes may put one each at the same time
        os.write(1, b"two\\n")  # at once, where two processes write
        time.sleep(600)
    return kept

Store.put = waiting
run()
"""


@posix
@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.long
def test_interrupted_by_the_user(campaign: Path, whole: dict[str, bytes], tmp_path: Path, jobs: int) -> None:
    out = tmp_path / "out"
    arguments = command(campaign, out, "--jobs", str(jobs))[3:]
    process = subprocess.Popen(
        [sys.executable, "-c", WAITS_AFTER_TWO, *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "two\n"
    process.send_signal(signal.SIGINT)
    _, messages = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "repeat the command to resume" in messages
    assert "Traceback" not in messages
    assert tables(out) == {}
    there = len(kept(out))  # the other process keeps what it finds meanwhile
    assert there == 2 or (jobs == 2 and there > 2)
    done = run(campaign, out)
    assert resumed(done) == there
    assert tables(out) == whole


@pytest.mark.long
@posix
def test_a_full_disk_loses_nothing(campaign: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    # A limit on the size of files stops the writing as a full disk does, in the middle of a result.
    import resource

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))

    out = tmp_path / "out"
    full = run(campaign, out, preexec_fn=limited)
    assert full.returncode == 2
    assert "the result of noise/0.tdms cannot be kept" in full.stderr
    assert "free some space and repeat the command" in full.stderr
    assert tables(out) == {}
    assert not list(out.rglob("*.part"))
    again = run(campaign, out)
    assert again.returncode == 1
    assert tables(out) == whole
    # Tables of an earlier run stay whole as well, together, when there is no room for new ones.
    other = run(campaign, out, "--reference", "Mic 1", preexec_fn=limited)
    assert other.returncode == 2
    assert tables(out) == whole


@pytest.mark.long
@posix
def test_workers_end_with_the_batch(campaign: Path, tmp_path: Path) -> None:
    import psutil

    process = begin(campaign, tmp_path / "out", "--jobs", "2")
    while process.poll() is None and not kept(tmp_path / "out"):
        time.sleep(0.002)
    workers = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(workers, timeout=20)
    assert workers
    assert not alive


@pytest.mark.long
def test_changes_are_noticed(campaign: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    place, out = tmp_path / "in", tmp_path / "out"
    shutil.copytree(campaign, place)
    assert resumed(run(place, out)) == 0
    assert resumed(run(place, out)) == FILES
    assert tables(out) == whole
    # One file, in its samples only.
    changed = place / "sine" / "0.tdms"
    content = bytearray(changed.read_bytes())
    content[-100:] = bytes(100)
    changed.write_bytes(content)
    done = run(place, out)
    assert resumed(done) == FILES - 1
    fresh = tmp_path / "fresh"
    run(place, fresh)
    assert tables(out) == tables(fresh) != whole
    # A file that is gone, and its result with it.
    changed.unlink()
    assert resumed(run(place, out)) == FILES - 1
    assert len(kept(out)) == FILES - 1
    # Settings, a channel table, a calibration.
    assert resumed(run(place, out, "--reference", "Mic 2")) == 0
    (place / "noise" / "channels.toml").write_text('[[channel]]\nchannel = "Mic 2"\nrole = "other"\n')
    assert resumed(run(place, out, "--reference", "Mic 2")) == FILES - 3
    (place / "noise" / "calibration.toml").write_text(
        'schema = 1\n[[channel]]\nchannel = "Mic 1"\nsensitivity = 50.0\nunit = "mV/Pa"\n'
    )
    assert resumed(run(place, out, "--reference", "Mic 2")) == FILES - 3


@pytest.mark.long
def test_results_of_another_version_are_not_used(
    campaign: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run(campaign, out)
    one, two, three, *_ = sorted(kept(out))
    # One was made by a program with other bytes, one says less than it should, one was cut off.
    one.rename(one.with_name("0" * 32 + one.suffix))
    head, lines = two.read_bytes().split(b"\n", 1)
    two.write_bytes(json.dumps({"label": json.loads(head)["label"]}).encode() + b"\n" + lines)
    three.write_bytes(three.read_bytes()[:-1])
    done = run(campaign, out)
    assert resumed(done) == FILES - 3
    assert tables(out) == whole
    assert len(kept(out)) == FILES


@pytest.mark.long
def test_two_batches_do_not_share_an_output(campaign: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    out = tmp_path / "out"
    both = [begin(campaign, out) for _ in range(2)]
    messages = [process.communicate()[1] for process in both]
    codes = [process.returncode for process in both]
    assert sorted(codes) in ([1, 1], [1, 2])  # one after the other by chance, or one refused
    if 2 in codes:
        assert "another batch is writing to" in messages[codes.index(2)]
    assert tables(out) == whole
