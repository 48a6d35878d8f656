"""`dnet inspect diff`: how two episodes, or two datasets, differ."""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Diff:
    """Say how two episodes differ, or two directories of episodes.

    Of episodes: what is known of them, each frame with the largest distance between its points,
    grasps, nodes and joints, and the topics of which any message differs. Of directories: which
    files only one has, and how the others differ. Exits with 0 if there is no difference, or only
    in how files are packed, and with 1 if there is one.

    Example: dnet inspect diff data/box data/again
    """

    one: tyro.conf.Positional[Path]
    """An `.mcap`, or a directory."""
    other: tyro.conf.Positional[Path]
    """Another of the same kind."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of tables."""

    def run(self) -> None:
        """Print the differences.

        Raises:
            DnetError: If one of them does not exist or cannot be read, or if one is a directory
                and the other is none.
        """
        self._check()
        same = self._datasets() if self.one.is_dir() else self._episodes()
        if not same:
            sys.exit(1)

    def _check(self) -> None:
        from dnet.errors import MissingPath, UnlikePaths

        for path in (self.one, self.other):
            if not path.exists():
                hint = "`dnet inspect ls DIRECTORY` lists what is there"
                raise MissingPath(path, "episode or directory", hint)
        folder, file = sorted((self.one, self.other), key=lambda path: not path.is_dir())
        if folder.is_dir() != file.is_dir():
            raise UnlikePaths(folder, file)

    def _datasets(self) -> bool:
        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.tools.difference import PACKED, compare_datasets
        from dnet.tools.tables import print_frame

        console = Console(stderr=True)
        indexes = [read_index(folder, console) for folder in (self.one, self.other)]
        found = compare_datasets(*indexes)
        if self.json or found.height:
            print_frame(found, "json" if self.json else "table")
        else:
            print(f"{indexes[0].files.height} files, the same in both")
        return bool((found["difference"] == PACKED).all())

    def _episodes(self) -> bool:
        from json import dumps

        from dnet.tools.difference import compare_episodes
        from dnet.tools.tables import print_table

        found = compare_episodes(self.one, self.other)
        if self.json:
            told = {
                "same_bytes": found.same_bytes,
                "facts": found.facts,
                "messages": found.messages,
            }
            print(dumps(told | {"frames": found.frames.to_dicts()}, indent=2))
            return found.same
        for name, (one, other) in found.facts.items():
            print(f"{name}: {one} and {other}")
        if found.frames.height:
            print_table(found.frames)
        if found.messages:
            topics = (f"{name} from {number} on" for name, number in found.messages.items())
            print(f"messages that differ: {', '.join(topics)}")
        if found.same:
            packed = "the same bytes" if found.same_bytes else "the same content, other bytes"
            print(f"no difference: {packed}")
        return found.same
