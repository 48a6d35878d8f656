import platform
import subprocess
import sys

import pytest

from dnet.training.allocation import kept_pages

GLIBC = sys.platform == "linux" and platform.libc_ver()[0] == "glibc"
WITH_AND_WITHOUT = """
import psutil, torch
from dnet.training.allocation import kept_pages

def held():
    return psutil.Process().memory_info().rss >> 20

def work():
    blocks = [torch.ones(12 << 20) for _ in range(6)]  # of 48 MB
    last = torch.ones(100)  # above them on the heap
    return last

before = held()
with kept_pages():
    last = work()
    kept = held() - before
given_back = held() - before
work()
print(kept, given_back, held() - before)
"""
"""In a process of its own, whose memory nothing else has a part in."""


def test_pages_are_kept_where_glibc_allocates_them() -> None:
    for _ in range(2):
        with kept_pages() as agreed:
            assert agreed is GLIBC


@pytest.mark.skipif(not GLIBC, reason="another C library than glibc, which is left alone")
def test_pages_are_kept_meanwhile_and_given_back_at_the_end() -> None:
    told = subprocess.run(
        [sys.executable, "-c", WITH_AND_WITHOUT], check=True, capture_output=True, text=True
    )
    kept, given_back, afterwards = map(int, told.stdout.split())
    assert kept > 250
    assert given_back < 60
    assert afterwards < 60
