"""Every file that a fuzzer began with, or found, is read, or refused by a DnetError alone."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import process_time

import pytest

from dnet.errors import DnetError
from tests.fuzz.targets import CORPUS, TARGETS, seeds_of

SECONDS = 10
MEMORY = 2**30
LARGEST_CORPUS = 300_000
"""Bytes; it lies in the repository."""


@contextmanager
def little_memory() -> Iterator[None]:
    """Let this process have a gibibyte more than it has, and no more."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.filterwarnings("ignore")  # a warning about a broken file is as good as a refusal
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_a_refusal_comes_out(tmp_path: Path, name: str) -> None:
    seeds = sorted(seeds_of(name).iterdir())
    assert seeds
    for seed in seeds:
        start = process_time()
        with little_memory(), suppress(DnetError):
            TARGETS[name](seed.read_bytes(), tmp_path)
        assert process_time() - start < SECONDS, seed


def test_the_corpus_is_small() -> None:
    assert sum(path.stat().st_size for path in CORPUS.rglob("*")) < LARGEST_CORPUS
