import platform
import sys

import torch

from dnet.training.allocation import keep_pages


def test_pages_are_kept_where_glibc_allocates_them() -> None:
    glibc = sys.platform == "linux" and platform.libc_ver()[0] == "glibc"
    assert keep_pages() is glibc
    # The same again, and memory is still handed out.
    assert keep_pages() is glibc
    assert float(torch.ones(4_000_000).sum()) == 4_000_000
