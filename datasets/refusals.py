"""Why an MCAP file is refused as an episode, and what can be done about it."""

from dnet.errors import BadEpisode
from dnet.types import Place


def cut_off(path: Place) -> BadEpisode:
    """Return the refusal of a file without an end."""
    return BadEpisode(
        path,
        "is cut off in the middle: it lacks the end of an MCAP file",
        "its recording was killed or is still running; record it again, or save its whole "
        f"frames with {_recover(path)}",
    )


def damaged(path: Place, why: str) -> BadEpisode:
    """Return the refusal of a file whose parts contradict each other."""
    return BadEpisode(path, f"is damaged: {why}", f"record it again, or try {_recover(path)}")


def unindexed(path: Place) -> BadEpisode:
    """Return the refusal of a file that can only be read from front to back."""
    return BadEpisode(path, "has no message index", f"rewrite it with {_recover(path)}")


def _recover(path: Place) -> str:
    return f"`dnet inspect repair {path}`"
