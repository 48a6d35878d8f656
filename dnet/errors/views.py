"""Windows, pictures, films and reports."""

from pathlib import Path

from dnet.errors.root import DnetError


class UnknownRecording(DnetError, ValueError):
    """A file that no viewer of ours opens."""

    def __init__(self, path: Path) -> None:
        super().__init__(
            f"{path} ends in {path.suffix or 'nothing'}, not in .mcap or .rrd; "
            "give an episode of `dnet record` or a run of `dnet servo`"
        )


class NoScreen(DnetError, RuntimeError):
    """A viewer that was to open a window where there is no screen."""

    def __init__(self) -> None:
        super().__init__(
            "no screen: neither DISPLAY nor WAYLAND_DISPLAY is set; draw a picture with "
            "--screenshot OUT.png, or write --save OUT.rrd and open it on another machine"
        )


class NoLiveView(DnetError, RuntimeError):
    """A window that was to show a run live, and that there is not."""

    def __init__(self, why: str) -> None:
        super().__init__(
            f"no live view: {why}; the run goes on, `dnet play` and the directory of the run "
            "show it afterwards"
        )


class NoPicture(DnetError, RuntimeError):
    """A viewer that did not draw."""

    def __init__(self, path: Path, tries: int, why: str) -> None:
        super().__init__(
            f"the viewer drew no {path} in {tries} tries ({why}); without a screen it "
            "needs a software renderer: on Debian, apt-get install mesa-vulkan-drivers libegl1 "
            "libxkbcommon0 libxkbcommon-x11-0 libwayland-client0 libxcursor1 libxi6 libxrandr2"
        )


class ViewerFailed(DnetError, RuntimeError):
    """A viewer that ended by an error."""

    def __init__(self, status: int) -> None:
        super().__init__(
            f"the Rerun viewer ended with status {status}; its own message is above; "
            "--screenshot OUT.png draws without a screen"
        )


class UnknownPicture(DnetError, ValueError):
    """A file name that says no kind of picture that we draw."""

    def __init__(self, path: Path, endings: tuple[str, ...]) -> None:
        super().__init__(
            f"picture {path} ends in {path.suffix or 'nothing'}, must end in one of "
            f"{', '.join(endings)}"
        )


class NoFilm(DnetError, ValueError):
    """A film of a kind that is not written."""

    def __init__(self, path: Path, kinds: tuple[str, ...]) -> None:
        super().__init__(f"{path} is no film; let its name end in {' or '.join(kinds)}")


class BadReport(DnetError, ValueError):
    """Something that a report is made from, and that cannot be read."""

    def __init__(self, path: Path, why: str, way_out: str) -> None:
        super().__init__(f"{path} {why}; {way_out}")
