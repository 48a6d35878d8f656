"""Clouds are shared out among threads, each of them once."""

import os
import subprocess
import sys
import threading

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.nets.cloud_threads import for_all_clouds


def shared_out(count: int, threads: int) -> list[tuple[int, int, str]]:
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        return for_all_clouds(lambda a, b: (a, b, threading.current_thread().name), count)
    finally:
        torch.set_num_threads(before)


@given(count=st.integers(1, 40), threads=st.integers(1, 6))
@settings(max_examples=50, deadline=None)
def test_each_cloud_is_worked_on_once_and_parts_are_even(count: int, threads: int) -> None:
    parts = shared_out(count, threads)
    assert [cloud for a, b, _ in parts for cloud in range(a, b)] == list(range(count))
    sizes = [b - a for a, b, _ in parts]
    assert len(sizes) == min(count, threads)
    assert max(sizes) - min(sizes) <= 1


def test_one_thread_and_one_cloud_need_no_other_thread() -> None:
    here = threading.current_thread().name
    assert shared_out(9, 1) == [(0, 9, here)]
    assert shared_out(1, 4) == [(0, 1, here)]
    assert {name for *_, name in shared_out(9, 3)} > {here}


def test_an_error_in_a_part_is_raised() -> None:
    def fail(first: int, last: int) -> None:
        if first > 0:
            raise ValueError(first)

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with pytest.raises(ValueError, match="2"):
            for_all_clouds(fail, 4)
    finally:
        torch.set_num_threads(before)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_forked_process_starts_its_own_threads() -> None:
    code = """
import os, torch
from dnet.nets.cloud_threads import for_all_clouds
torch.set_num_threads(3)
work = lambda first, last: last - first
assert sum(for_all_clouds(work, 9)) == 9
child = os.fork()
if child == 0:
    os._exit(sum(for_all_clouds(work, 9)))
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
