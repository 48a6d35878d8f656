"""Kernels compile wherever they come from."""

from dnet.sim.compiled import compiled


def test_a_kernel_without_a_place_for_its_cache_is_compiled_all_the_same() -> None:
    # A function without a file has none beside it either.
    namespace: dict[str, object] = {}
    exec("def twice(x):\n    return 2 * x", namespace)  # noqa: S102
    twice = namespace["twice"]
    assert callable(twice)
    kernel = compiled(twice)
    assert kernel(21) == 42
    assert kernel(float("inf")) == float("inf")
