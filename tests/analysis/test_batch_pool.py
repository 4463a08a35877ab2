"""The pool of processes: order of results does not matter, a dead process costs one item."""

import sys
import threading
from types import ModuleType

import pytest

from specan.analysis.batch.pool import spread

# A module of its own: new processes import what they work on by name.
WORK = """
import os, signal

def square(item):
    return item * item

def square_or_die(item):
    if item == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(item)

def lost(item):
    return -item
"""


@pytest.fixture
def work(tmp_path, monkeypatch) -> ModuleType:
    (tmp_path / "pool_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pool_work", raising=False)
    import pool_work

    return pool_work


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_comes_back_once(work: ModuleType, jobs: int) -> None:
    found = dict(spread([5, 1, 4], work.square, jobs, work.lost))
    assert found == {0: 25, 1: 1, 2: 16}


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL there")
def test_a_killed_process_costs_one_item(work: ModuleType) -> None:
    found = dict(spread([1, 2, 3, 4, 5], work.square_or_die, 2, work.lost))
    assert found == {0: 1, 1: 4, 2: -3, 3: 16, 4: 25}


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_the_work_is_raised(work: ModuleType, jobs: int) -> None:
    with pytest.raises(TypeError):
        list(spread(["a", "b"], work.square, jobs, work.lost))


def test_beside_other_threads_new_processes_are_begun(work: ModuleType) -> None:
    """A copy of a process with threads might wait for ever for a lock that one of them held."""
    end = threading.Event()
    other = threading.Thread(target=end.wait)
    other.start()
    try:
        found = dict(spread([5, 1, 4], work.square, 2, work.lost))
    finally:
        end.set()
        other.join()
    assert found == {0: 25, 1: 1, 2: 16}
