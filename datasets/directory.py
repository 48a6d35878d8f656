"""A directory of episodes: which of its files count."""

from pathlib import Path

from dnet.errors import MissingPath, NoEpisodes


def find_episodes(directory: Path) -> list[Path]:
    """Return the finished episodes in `directory`, sorted by name.

    A `.part` file is a recording that is running or was killed, and does not count.

    Raises:
        MissingPath: If there is no such directory.
        NoEpisodes: If it holds no `.mcap` file.
    """
    if not directory.is_dir():
        raise MissingPath(directory, "directory", f"record into it with `dnet record {directory}`")
    episodes = sorted(path for path in directory.glob("*.mcap") if path.is_file())
    if episodes:
        return episodes
    unfinished = find_unfinished(directory)
    if unfinished:
        raise NoEpisodes(
            directory,
            f"holds {len(unfinished)} unfinished recordings (such as {unfinished[0].name}) "
            "but no finished .mcap episode",
        )
    raise NoEpisodes(directory)


def find_unfinished(directory: Path) -> list[Path]:
    """Return the `.part` files in `directory`, sorted by name."""
    return sorted(path for path in directory.glob("*.mcap.part") if path.is_file())
