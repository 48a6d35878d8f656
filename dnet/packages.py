"""The packages that dnet is made of: which are here, and the command that brings another."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import requires
from importlib.util import find_spec

from dnet.errors import MissingPackage

MODULES = {
    "foxglove-schemas-protobuf": "foxglove_schemas_protobuf",
    "import-linter": "importlinter",
    "mcap-protobuf-support": "mcap_protobuf",
    "mkdocs-material": "material",
    "pillow": "PIL",
    "protobuf": "google.protobuf",
    "pytest-xdist": "xdist",
    "rerun-sdk": "rerun",
    "scipy-stubs": "scipy-stubs",
}
"""What those are imported as whose name does not tell."""
_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+)(?:\[[^]]*\])?(?P<range>[^;]*)(?:;(?P<marker>.*))?")
_EXTRA = re.compile(r"""extra\s*==\s*["']([^"']+)["']""")


@dataclass(frozen=True, slots=True)
class Package:
    """Something to install that dnet needs, or that one of its extras brings."""

    name: str
    """As pip knows it."""
    versions: str
    """Which of them will do, as in `>=2,<3`."""
    extras: tuple[str, ...]
    """Those that bring it; none for what every installation has."""

    @property
    def module(self) -> str:
        """What it is imported as."""
        return MODULES.get(self.name, self.name.replace("-", "_"))

    @property
    def remedy(self) -> str:
        """The command that brings it."""
        wanted = f"deformernet[{self.extras[0]}]" if self.extras else self.name + self.versions
        return f'pip install "{wanted}"'


@cache
def packages() -> tuple[Package, ...]:
    """Return everything that the installed dnet names in its metadata, each once."""
    found: dict[str, Package] = {}
    for line in requires("deformernet") or ():
        match = _REQUIREMENT.match(line)
        if match is None or match["name"] == "deformernet":
            continue
        name, versions = match["name"], match["range"].strip()
        extra = _EXTRA.search(match["marker"] or "")
        known = found.get(name, Package(name, versions, ()))
        extras = known.extras + (() if extra is None else (extra[1],))
        found[name] = Package(name, known.versions, extras)
    return tuple(found.values())


def is_installed(module: str) -> bool:
    """Return whether `module` can be found; nothing is run."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def require(module: str, what: str) -> None:
    """Do nothing if `module` is there.

    Args:
        module: Of one of dnet's packages.
        what: What needs it.

    Raises:
        MissingPackage: If it is not there.
    """
    package = _package_of(module)
    if package is not None and not is_installed(module):
        raise MissingPackage(package.name, what, package.remedy)


@contextmanager
def needed_for(what: str) -> Iterator[None]:
    """Say how to install a package of dnet's that an import in the block does not find.

    Raises:
        MissingPackage: If there is none; it names the package, `what` and the command.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = _package_of(error.name or "")
        if package is None:
            raise
        raise MissingPackage(package.name, what, package.remedy) from error


def _package_of(module: str) -> Package | None:
    """Return the package that a module is of; None if that is none of dnet's."""
    for package in packages():
        if f"{module}.".startswith(f"{package.module}."):
            return package
    return None
