"""What validation finds in a file: faults as values, at most so many of a kind."""

from collections import Counter
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning"]

MOST_ALIKE = 5
"""Findings of one check in one file that are told one by one; the others are counted."""
LONGEST = 300
"""Characters of a finding; a file may hold names of any length."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One fault of one file."""

    file: str
    severity: Severity
    """`error`: the file is not what it should be; `warning`: it can be used, but look at it."""
    check: str
    """Short name of what was checked; it stays the same from version to version."""
    what: str
    """What was found, and what it should be."""


class Findings:
    """The findings of one file.

    Args:
        file: Its name.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self._found: list[Finding] = []
        self._counts: Counter[tuple[Severity, str]] = Counter()

    @property
    def errors(self) -> int:
        """How many errors there are, told or only counted."""
        return sum(count for (severity, _), count in self._counts.items() if severity == "error")

    def error(self, check: str, what: str) -> None:
        """Note what makes the file wrong."""
        self.add("error", check, what)

    def warn(self, check: str, what: str) -> None:
        """Note what is odd about the file."""
        self.add("warning", check, what)

    def add(self, severity: Severity, check: str, what: str) -> None:
        """Note a fault."""
        kind = severity, check
        self._counts[kind] += 1
        if self._counts[kind] <= MOST_ALIKE:
            self._found.append(Finding(printable(self.file), severity, check, printable(what)))

    def all(self) -> list[Finding]:
        """Return the findings in the order they were made, and how many of a kind are not told."""
        rest = [
            Finding(
                printable(self.file), severity, check, f"and {count - MOST_ALIKE} more of these"
            )
            for (severity, check), count in self._counts.items()
            if count > MOST_ALIKE
        ]
        return self._found + rest


def printable(text: str) -> str:
    """Return `text` in one line of bounded length that cannot steer a terminal."""
    if len(text) > LONGEST:
        text = text[: LONGEST - 3] + "..."
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape", "surrogatepass").decode()
        for char in text
    )
