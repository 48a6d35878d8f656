"""A robot's URDF out of somebody's file, looked through before a viewer takes it.

The parser is expat's, which fetches nothing; a document type, with which a few lines become
gigabytes or another file, is refused before it is read. So is what names a file of this machine,
and what is no tree: viewers follow the joints down to the last link, however long that takes.
"""

from collections.abc import Mapping
from xml.parsers import expat

LARGEST_URDF = 2**20
"""Bytes of a description that are still read; dnet writes 12 KiB."""
MOST_ELEMENTS = 10_000
"""Elements of one; dnet writes 300."""
DEEPEST = 32
"""Elements within elements; dnet writes 5."""
MOST_LINKS = 1024
"""Links of a robot; dnet's has 13."""
LONGEST_NAME = 256
"""Characters of a name of a link, a joint, a material or the robot."""

_FILES = ("mesh", "texture")
_NAMED = ("robot", "link", "joint", "material")


def read_urdf(content: bytes) -> str:
    """Return a URDF as text, if it is one that a viewer can be given.

    Raises:
        ValueError: If it is no XML, or no robot, or too large, or declares a document type, or
            names a file, or its links are no tree.
    """
    if len(content) > LARGEST_URDF:
        raise ValueError(f"it has {len(content)} bytes, at most {LARGEST_URDF} are read")
    text = content.decode("utf-8")
    # What follows is the reading of these bytes, whatever encoding they declare.
    parser = expat.ParserCreate("utf-8")
    robot = _Robot()
    parser.StartDoctypeDeclHandler = _refuse_doctype
    parser.StartElementHandler = robot.start
    parser.EndElementHandler = robot.end
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise ValueError(f"it is no XML: {error}") from error
    robot.check()
    return text


def _refuse_doctype(*_declaration: object) -> None:
    raise ValueError("it declares a document type, and with it perhaps entities")


class _Robot:
    """What was seen of the document so far."""

    def __init__(self) -> None:
        self._path: list[str] = []
        self._count = 0
        self._links = set[str]()
        self._parents: dict[str, str] = {}
        self._parent = ""

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        self._count += 1
        if self._count > MOST_ELEMENTS or len(self._path) >= DEEPEST:
            raise ValueError(f"it has more than {MOST_ELEMENTS} elements, or {DEEPEST} levels")
        if not self._path and tag != "robot":
            raise ValueError(f"its root is {tag[:40]!r}, must be 'robot'")
        if tag in _FILES:
            raise ValueError(f"its element {tag} names a file; boxes and cylinders alone are drawn")
        if tag in _NAMED and (len(self._path) < 2 or "name" in attributes):
            _require_name(tag, attributes.get("name", ""))
        self._path.append(tag)
        self._take(attributes)

    def end(self, _tag: str) -> None:
        self._path.pop()

    def _take(self, attributes: Mapping[str, str]) -> None:
        if self._path == ["robot", "link"]:
            name = attributes["name"]
            if name in self._links or len(self._links) == MOST_LINKS:
                raise ValueError(f"it has a second link {name!r}, or more than {MOST_LINKS}")
            self._links.add(name)
        elif self._path == ["robot", "joint", "parent"]:
            self._parent = attributes.get("link", "")
        elif self._path == ["robot", "joint", "child"]:
            child = attributes.get("link", "")
            if child in self._parents:
                raise ValueError(f"its link {child[:40]!r} hangs from two joints")
            self._parents[child] = self._parent

    def check(self) -> None:
        """Refuse joints between links that are not there, and links that hang from themselves."""
        unknown = sorted({*self._parents, *self._parents.values()} - self._links)
        if unknown:
            raise ValueError(f"a joint has a link {unknown[0][:40]!r}, which is not there")
        roots = self._links - self._parents.keys()
        if len(roots) != 1:
            raise ValueError(f"it has {len(roots)} links that hang from no other, must have one")
        # One parent each, one root, and no ring: then the links are a tree.
        for link in self._links:
            seen = {link}
            while link in self._parents:
                link = self._parents[link]  # noqa: PLW2901
                if link in seen:
                    raise ValueError(f"its link {link[:40]!r} hangs from itself")
                seen.add(link)


def _require_name(tag: str, name: str) -> None:
    if not name or len(name) > LONGEST_NAME or not name.isprintable():
        raise ValueError(f"the name of a {tag} is {name[:40]!r}: empty, too long or unprintable")
