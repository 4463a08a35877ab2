"""Parts of a computation in several processes: the same results, in their order, whatever becomes of a process."""

import os
import signal
import sys
import time

import pytest

from specan.errors import ComputationError
from specan.models.kept import forget, forgotten_by
from specan.study.processes import each, working

ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux copies processes")


def _slowly(number: int) -> tuple[int, int]:
    time.sleep(0.02)
    return number**2, os.getpid()


@pytest.mark.parametrize("jobs", [1, 2, 3, 9])
def test_results_come_in_the_order_of_the_items(jobs):
    with working(jobs):
        found = each(_slowly, [3, 1, 4, 1, 5])
    assert [square for square, _ in found] == [9, 1, 16, 1, 25]


@ON_LINUX
def test_several_processes_work_and_none_of_them_copies_itself_again():
    with working(2):
        found = each(
            lambda k: {process for _, process in each(_slowly, [k, k + 1])} | {os.getpid()}, range(4)
        )
    assert all(len(processes) == 1 for processes in found)
    assert len(set.union(*found)) == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_first_error_is_raised(jobs):
    def fails(number):
        time.sleep(0.01 * (3 - number))
        if number:
            raise ComputationError(f"part {number} failed", remedy="none")
        return number

    with working(jobs), pytest.raises(ComputationError, match="part 1 failed; none"):
        each(fails, [0, 1, 2])


@ON_LINUX
def test_what_a_killed_process_was_to_do_is_done_all_the_same():
    own = os.getpid()

    def work(number):
        time.sleep(0.02)
        if os.getpid() != own:
            os.kill(os.getpid(), signal.SIGKILL)
        return number

    with working(2):
        assert each(work, [1, 2, 3]) == [1, 2, 3]


@ON_LINUX
def test_an_interrupt_ends_the_copies():
    own, copies = os.getpid(), set(_children())

    def work(number):
        if os.getpid() == own:
            raise KeyboardInterrupt
        time.sleep(60)

    with working(2), pytest.raises(KeyboardInterrupt):
        each(work, [1, 2, 3, 4])
    assert set(_children()) == copies


def _children() -> list[str]:
    with open(f"/proc/{os.getpid()}/task/{os.getpid()}/children", encoding="ascii") as file:
        return file.read().split()


@pytest.mark.parametrize("jobs", [1, 2])
def test_no_part_sees_what_another_one_kept(jobs):
    """A sum that is kept would otherwise depend on how many parts a process has done before."""
    kept: list[int] = []
    forgotten_by(kept.clear)

    def work(number):
        kept.append(number)
        return list(kept)

    with working(jobs):
        assert each(work, [1, 2, 3, 4]) == [[1], [2], [3], [4]]
    assert not kept
    forget()
