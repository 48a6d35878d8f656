"""A library is missing where the system's loader does not find it, and one command brings all."""

from dnet.diagnosis.libraries import LIBRARIES, missing_libraries, remedy

HERE = ("libGL.so.1", "libvulkan.so.1")


def load(file: str) -> None:
    """A loader of a system that has two libraries alone."""
    if file not in HERE:
        raise OSError(f"{file}: cannot open shared object file: No such file or directory")


def test_what_the_loader_does_not_find_is_missing() -> None:
    missing = missing_libraries(load=load)
    assert {one.file for one in LIBRARIES} - {one.file for one in missing} == set(HERE)


def test_one_command_brings_all_that_is_missing() -> None:
    missing = [one for one in missing_libraries(load=load) if one.debian in ("libegl1", "libxi6")]
    command = "apt-get install -y --no-install-recommends libegl1 libxi6"
    assert remedy(missing, root=True) == command
    assert remedy(missing, root=False) == f"sudo {command}"
    assert remedy([], root=True) == ""
