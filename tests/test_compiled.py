"""Kernels compile wherever they come from, and again when what they call has changed."""

import subprocess
import sys
from pathlib import Path

import pytest

from dnet.compiled import compiled

CALLED = """
from dnet.compiled import compiled, compiled_part

@{decorator}
def step(x):
    return x + {step}
"""
INTRINSIC = """
from numba.extending import intrinsic
from dnet.compiled import holds_parts

holds_parts(__file__)

@intrinsic
def step(typing, x):
    def generate(context, builder, signature, args):
        return builder.add(args[0], args[0].type({step}))
    return x(x), generate
"""
CALLING = """
from called import step
from dnet.compiled import compiled

@compiled
def climb(x):
    return step(step(x))
"""


def test_a_kernel_without_a_place_for_its_cache_is_compiled_all_the_same() -> None:
    # A function without a file has none beside it either.
    namespace: dict[str, object] = {}
    exec("def twice(x):\n    return 2 * x", namespace)  # noqa: S102
    twice = namespace["twice"]
    assert callable(twice)
    kernel = compiled(twice)
    assert kernel(21) == 42
    assert kernel(float("inf")) == float("inf")


@pytest.mark.parametrize(
    "called",
    [
        CALLED.replace("{decorator}", "compiled"),
        CALLED.replace("{decorator}", "compiled_part"),
        INTRINSIC,
    ],
)
def test_a_change_in_another_module_is_noticed(called: str, tmp_path: Path) -> None:
    def climbed() -> str:
        code = "from calling import climb; print(climb(0))"
        command = [sys.executable, "-c", code]
        return subprocess.run(
            command, cwd=tmp_path, check=True, capture_output=True, text=True
        ).stdout.strip()

    (tmp_path / "calling.py").write_text(CALLING)
    (tmp_path / "called.py").write_text(called.format(step=1))
    assert climbed() == "2"
    kept = set(tmp_path.glob("__pycache__/calling.climb*.nbi"))
    assert len(kept) == 1, "the machine code is kept"
    assert climbed() == "2"
    (tmp_path / "called.py").write_text(called.format(step=10))
    assert climbed() == "20"
