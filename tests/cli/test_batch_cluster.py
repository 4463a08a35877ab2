"""A batch on a dask cluster: a real scheduler and real workers, on the loopback address."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from truth.rig import box_rig, sine_take
from truth.rig_files import write_tdms

pytest.importorskip("distributed")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="kills workers by a signal")

FEW, FILES, RATE = ("Mic 1", "Mic 2", "Vibrometer", "Generator"), 10, 8000.0
# A worker that sees nothing below the directory that is named, as one without the shared mount.
BLIND = """
import os, sys
stat, hidden = os.stat, sys.argv.pop(1)

def seen(path, *args, **kwargs):
    if isinstance(path, (str, os.PathLike)) and os.fspath(path).startswith(hidden):
        raise FileNotFoundError(2, "No such file or directory", os.fspath(path))
    return stat(path, *args, **kwargs)

os.stat = seen
from distributed.cli.dask_worker import main
main()
"""
ANOTHER_VERSION = """
import specan
specan.__version__ = "0.0.1"
from distributed.cli.dask_worker import main
main()
"""


class Cluster:
    def __init__(self, place: Path) -> None:
        self.place, self.processes = place, list[subprocess.Popen[bytes]]()
        self.port = _free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._start("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port))

    def worker(self, *python: str) -> subprocess.Popen[bytes]:
        python = python or ("-m", "distributed.cli.dask_worker")
        options = ("--no-nanny", "--nthreads", "1", "--host", "127.0.0.1")
        return self._start(*python, self.address, *options)

    def wait_for_workers(self, count: int) -> None:
        from distributed import Client

        with Client(self.address, timeout=60) as client:
            client.wait_for_workers(count, timeout=60)

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, *arguments, "--no-dashboard"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"DASK_TEMPORARY_DIRECTORY": str(self.place)},
        )
        self.processes.append(process)
        return process

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    found = Cluster(tmp_path / "dask")
    yield found
    found.end()


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place, rig = tmp_path_factory.mktemp("campaign"), box_rig()
    for number in range(FILES):
        take = sine_take(rig, 200.0 + 50 * number, 1.0, 20_000, RATE, number)
        write_tdms(place / f"{number}.tdms", rig, take.only(FEW))
    (place / "broken.tdms").write_bytes(b"nothing")
    return place


@pytest.fixture(scope="module")
def begin() -> Callable[..., subprocess.Popen[str]]:
    def start(*arguments: object) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "specan_cli", "batch", *map(str, arguments)]
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    return start


@pytest.fixture(scope="module")
def whole(campaign: Path, begin, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("whole")
    begin(campaign, "-o", out).communicate()
    return tables(out)


def tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.glob("*.txt")}


@pytest.mark.long
def test_one_of_two_workers_is_killed(
    cluster: Cluster, campaign: Path, whole: dict[str, bytes], begin, tmp_path: Path
) -> None:
    first, out = cluster.worker(), tmp_path / "out"
    cluster.worker()
    batch = begin(campaign, "-o", out, "--cluster", cluster.address)
    while batch.poll() is None and len(list((out / ".specan").glob("*.result"))) < 3:
        time.sleep(0.002)
    first.send_signal(signal.SIGKILL)
    _, messages = batch.communicate(timeout=100)
    assert batch.returncode == 1, messages  # because of the broken file
    assert "Failed: broken.tdms: broken.tdms is " in messages
    assert tables(out) == whole
    assert len(whole) == 5


@pytest.mark.long
def test_a_worker_without_the_path_is_named_and_others_do_its_files(
    cluster: Cluster, campaign: Path, whole: dict[str, bytes], begin, tmp_path: Path
) -> None:
    cluster.worker("-c", BLIND, str(campaign))
    batch = begin(campaign, "-o", tmp_path / "alone", "--cluster", cluster.address)
    _, messages = batch.communicate(timeout=100)
    assert batch.returncode == 2
    path = re.escape(str(campaign)) + r"/\w+\.tdms"
    assert re.search(rf"the worker tcp://127\.0\.0\.1:\d+ cannot read {path}", messages)
    assert tables(tmp_path / "alone") == {}
    cluster.worker()
    cluster.wait_for_workers(2)
    batch = begin(campaign, "-o", tmp_path / "both", "--cluster", cluster.address)
    _, messages = batch.communicate(timeout=100)
    assert batch.returncode == 1, messages
    assert tables(tmp_path / "both") == whole


@pytest.mark.long
def test_a_worker_of_another_version_is_not_asked(
    cluster: Cluster, campaign: Path, begin, tmp_path: Path
) -> None:
    cluster.worker("-c", ANOTHER_VERSION)
    batch = begin(campaign, "-o", tmp_path / "out", "--cluster", cluster.address)
    _, messages = batch.communicate(timeout=100)
    assert batch.returncode == 2
    assert re.search(r"the worker tcp://127\.0\.0\.1:\d+ runs specan 0\.0\.1 ", messages)


@pytest.mark.long
def test_a_scheduler_that_is_lost(
    cluster: Cluster, campaign: Path, whole: dict[str, bytes], begin, tmp_path: Path
) -> None:
    cluster.worker()
    out = tmp_path / "out"
    batch = begin(campaign, "-o", out, "--cluster", cluster.address)
    while batch.poll() is None and len(list((out / ".specan").glob("*.result"))) < 3:
        time.sleep(0.002)
    cluster.processes[0].kill()
    _, messages = batch.communicate(timeout=100)
    assert batch.returncode == 2
    assert f"the connection to the scheduler {cluster.address} was lost" in messages
    # What was done is kept, and can be finished here.
    assert re.search(r"\d results of an earlier run", begin(campaign, "-o", out).communicate()[1])
    assert tables(out) == whole


@pytest.mark.long
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://127.0.0.1:{port}", "does not answer"),
        ("cluster.example", "is not an address of a cluster"),
    ],
)
def test_an_address_that_does_not_answer(
    campaign: Path, begin, tmp_path: Path, address: str, message: str
) -> None:
    address = address.format(port=_free_port())
    batch = begin(campaign, "-o", tmp_path / "out", "--cluster", address)
    _, messages = batch.communicate(timeout=60)
    assert batch.returncode == 2
    assert message in messages
    assert "tcp://host:8786" in messages
    assert tables(tmp_path / "out") == {}


def test_processes_and_a_cluster_at_once(campaign: Path, begin, tmp_path: Path) -> None:
    batch = begin(campaign, "-o", tmp_path / "out", "--jobs", "2", "--cluster", "tcp://127.0.0.1:1")
    assert "--jobs or --cluster, not both" in batch.communicate(timeout=60)[1]
    assert batch.returncode == 2
