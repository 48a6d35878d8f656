from time import process_time

import pytest

from dnet.recorders.robot_description import (
    DEEPEST,
    LARGEST_URDF,
    LONGEST_NAME,
    MOST_ELEMENTS,
    read_urdf,
)
from dnet.sim.urdf import psm_urdf

LINKS = "<link name='a'/><link name='b'/>"
JOINT = "<joint name='j' type='fixed'><parent link='{}'/><child link='{}'/></joint>"


def robot(inside: str, *, before: str = "", name: str = "r") -> bytes:
    return f"{before}<robot name='{name}'>{inside}</robot>".encode()


def test_the_arms_of_dnet_are_taken_as_they_are() -> None:
    assert read_urdf(psm_urdf().encode()) == psm_urdf()


def test_a_billion_laughs_are_refused_before_the_first() -> None:
    lines = ["<!DOCTYPE r [<!ENTITY a0 'ha'>"]
    lines += [f"<!ENTITY a{n} '{f'&a{n - 1};' * 10}'>" for n in range(1, 10)]
    start = process_time()
    with pytest.raises(ValueError, match="declares a document type"):
        read_urdf(robot("<link name='&a9;'/>", before="".join([*lines, "]>"])))
    assert process_time() - start < 1


@pytest.mark.parametrize(
    "declared",
    [
        "<!DOCTYPE r SYSTEM 'file:///etc/passwd'>",
        "<!DOCTYPE r [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>",
        "<!DOCTYPE r [<!ENTITY % p SYSTEM 'http://127.0.0.1/x.dtd'> %p;]>",
        "<!DOCTYPE r>",
    ],
)
def test_what_would_fetch_another_file_is_refused(declared: str) -> None:
    with pytest.raises(ValueError, match="declares a document type"):
        read_urdf(robot("<link name='a'>&x;</link>", before=declared))


@pytest.mark.parametrize(
    "name", ["../../x.stl", "/etc/passwd", "package://a/b.dae", "a\\b.obj", ""]
)
@pytest.mark.parametrize("tag", ["mesh", "texture"])
def test_no_file_of_this_machine_is_named(tag: str, name: str) -> None:
    with pytest.raises(ValueError, match=f"element {tag} names a file"):
        read_urdf(robot(f"<link name='a'><visual><{tag} filename='{name}'/></visual></link>"))


@pytest.mark.parametrize(
    ("inside", "why"),
    [
        ("", "0 links that hang from no other"),
        (LINKS, "2 links that hang from no other"),
        (LINKS + JOINT.format("a", "b") + JOINT.format("b", "a"), "0 links that hang"),
        (LINKS + JOINT.format("a", "b") * 2, "hangs from two joints"),
        (LINKS + JOINT.format("a", "c"), "which is not there"),
        ("<link name='a'/><link name='a'/>", "a second link"),
        (
            "<link name='c'/>" + LINKS + JOINT.format("a", "b") + JOINT.format("b", "a"),
            "hangs from itself",
        ),
    ],
)
def test_links_that_are_no_tree_are_refused(inside: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        read_urdf(robot(inside))


@pytest.mark.parametrize("name", ["", "a&#10;b", "x" * (LONGEST_NAME + 1), "a&#x202e;b"])
def test_a_name_that_would_spoil_a_line_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="empty, too long or unprintable"):
        read_urdf(robot(f"<link name='{name}'/>"))
    with pytest.raises(ValueError, match="empty, too long or unprintable"):
        read_urdf(robot("<link name='a'/>", name=name))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"<robot",
        b"<urdf/>",
        b"\xff\xfe<robot/>",
        b" " * (LARGEST_URDF + 1),
        robot("<link name='a'/>" + "<a/>" * MOST_ELEMENTS),
        robot("<a>" * DEEPEST + "</a>" * DEEPEST),
    ],
)
def test_what_is_no_robot_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        read_urdf(content)
