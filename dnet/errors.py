"""Everything that dnet refuses, under one root: what it was, its value, the limit, the way out."""

from pathlib import Path
from typing import Any


class DnetError(Exception):
    """The root: the command prints these in one line and exits with 1."""

    def __reduce__(self) -> tuple[Any, ...]:
        # From process to process an error goes by its message: `__init__` takes something else.
        return _again, (type(self), self.args)


def _again(kind: type[DnetError], args: tuple[Any, ...]) -> DnetError:
    error = kind.__new__(kind)
    error.args = args
    return error


class ShortCloud(DnetError, ValueError):
    """A cloud with fewer points than were asked of it."""

    def __init__(self, got: int, want: int) -> None:
        super().__init__(f"cloud has {got} points, need at least {want}; is the object in view?")


class LongCloud(DnetError, ValueError):
    """A cloud with more points than a network takes."""

    def __init__(self, what: str, got: int, want: int) -> None:
        super().__init__(
            f"{what} has {got} points, the network takes {want}; "
            f"sample it with `farthest_points(cloud, {want})`"
        )


class HugeCloud(DnetError, ValueError):
    """A file with more points, or more bytes, than are read at a time."""

    def __init__(self, path: Path, what: str, got: int, most: int) -> None:
        super().__init__(
            f"{path} says that it holds {got} {what}, at most {most} are read; if it is a cloud, "
            "leave out points first: a network takes some thousands"
        )


class BadCloud(DnetError, ValueError):
    """A cloud with coordinates that are not numbers."""

    def __init__(self, what: str, bad: int, total: int) -> None:
        super().__init__(
            f"{what} has {bad} of {total} points with NaN or infinite coordinates; remove them"
        )


class TooFew(DnetError, ValueError):
    """A count below what makes sense."""

    def __init__(self, what: str, got: int | float, least: int | float) -> None:
        super().__init__(f"{what} is {got}, must be at least {least}")


class MissingPath(DnetError, FileNotFoundError):
    """A file or directory that is not there."""

    def __init__(self, path: Path | str, what: str, hint: str) -> None:
        super().__init__(f"{what} {path} does not exist; {hint}")


class NoEpisodes(DnetError, FileNotFoundError):
    """A directory without a single finished episode."""

    def __init__(self, path: Path | str, why: str = "holds no .mcap episode") -> None:
        super().__init__(f"{path} {why}; record some with `dnet record {path}`")


class OccupiedOutput(DnetError, FileExistsError):
    """An output directory that already holds a run."""

    def __init__(self, path: Path | str, holds: str) -> None:
        super().__init__(
            f"output {path} already holds {holds}; choose another directory or remove it first"
        )


class BadEpisode(DnetError, ValueError):
    """A file that is not an episode, or not a whole one."""

    def __init__(self, path: Path | str, why: str, hint: str) -> None:
        super().__init__(f"{path} {why}; {hint}")


class BadIndex(DnetError, ValueError):
    """An index that says of a log what no log says."""

    def __init__(self, index: Path | str, name: str, what: str, value: object) -> None:
        super().__init__(
            f"{index} says of {name} that its {what} is {str(value)[:60]!r}, which no recording "
            "writes; delete the index: it is made anew from the logs"
        )


class NoSuchFrame(DnetError, IndexError):
    """A frame number beyond the end of an episode."""

    def __init__(self, path: Path | str, frame: int, count: int) -> None:
        super().__init__(
            f"{path} has no frame {frame}: it has {count} frames, 0 to {count - 1}; "
            f"`dnet inspect info {path}` lists them"
        )


class BadCheckpoint(DnetError, ValueError):
    """A checkpoint that does not hold the network that was asked for."""

    def __init__(self, path: Path, why: str, hint: str) -> None:
        super().__init__(f"checkpoint {path} {why}; {hint}")


class Unreachable(DnetError, ValueError):
    """A pose that the arm cannot take within its limits."""

    def __init__(self, what: str, point: tuple[float, float, float], why: str) -> None:
        x, y, z = point
        super().__init__(
            f"{what} at ({x:.4f}, {y:.4f}, {z:.4f}) m is out of reach: {why}; "
            "choose a point nearer the middle of the workspace"
        )


class BackInTime(DnetError, ValueError):
    """A frame that is older than the one before it."""

    def __init__(self, path: Path, time: float, last: float) -> None:
        super().__init__(
            f"{path}: a frame at {time:.6f} s came after one at {last:.6f} s; "
            "add frames in the order in which they were seen"
        )


class BadNumber(DnetError, ValueError):
    """A value with NaN or infinity where a log must hold numbers."""

    def __init__(self, path: Path, what: str, time: float) -> None:
        super().__init__(
            f"{path}: {what} at {time:.6f} s holds NaN or infinity; "
            "the simulation has diverged, record this pair with another seed"
        )


class NotAFraction(DnetError, ValueError):
    """A share outside 0 to 1."""

    def __init__(self, what: str, got: float) -> None:
        super().__init__(f"{what} is {got}, must be from 0 to 1")


class EmptyGrasp(DnetError, ValueError):
    """Jaws that would close on nothing."""

    def __init__(self, point: tuple[float, float, float], distance: float, radius: float) -> None:
        x, y, z = point
        super().__init__(
            f"nothing to grasp at ({x:.4f}, {y:.4f}, {z:.4f}) m: the nearest node is "
            f"{distance * 1e3:.1f} mm away, jaws reach {radius * 1e3:.1f} mm; "
            "choose a point on the object's surface"
        )


class NoValidShape(DnetError, RuntimeError):
    """Random draws of which none will do."""

    def __init__(self, what: str, tries: int, rejected: dict[str, int]) -> None:
        reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(rejected.items()))
        super().__init__(
            f"no valid {what} in {tries} random draws ({reasons}); "
            "make the workspace smaller or the object softer to move"
        )


class BadMotion(DnetError, ValueError):
    """A controller that asks for a motion that is no motion."""

    def __init__(self, motion: object, step: int) -> None:
        super().__init__(
            f"step {step}: the predicted motion is {motion}, must be finite; "
            "the checkpoint is spoilt, train again"
        )


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


class TooShort(DnetError, ValueError):
    """A time that allows for nothing."""

    def __init__(self, what: str, got: float) -> None:
        super().__init__(f"{what} is {got}, must be above 0; leave it out for no limit")


class NoDevice(DnetError, RuntimeError):
    """A device to compute on that this machine lacks."""

    def __init__(self, name: str) -> None:
        super().__init__(f"device {name} is not there: torch finds no GPU; use --device cpu")


class NoReachableSurface(DnetError, ValueError):
    """An object of which no part can be grasped."""

    def __init__(self, size: tuple[float, float, float], clearance: float) -> None:
        length, width, height = (1e3 * edge for edge in size)
        super().__init__(
            f"no surface of an object of {length:.0f} x {width:.0f} x {height:.0f} mm is "
            f"reachable: it must face the moving arm and lie {clearance * 1e3:.0f} mm from the "
            "held end; make the object longer or the clearance smaller"
        )


class OtherRequest(DnetError, ValueError):
    """A directory in which another recording began."""

    def __init__(self, folder: Path | str, differences: list[str]) -> None:
        shown = ", ".join(differences[:4]) + (", ..." if len(differences) > 4 else "")
        super().__init__(
            f"{folder} holds a recording with other settings ({shown}); repeat the call that "
            "began it to go on with it, or choose another directory"
        )


class BadManifest(DnetError, ValueError):
    """A manifest that does not say what was recorded."""

    def __init__(self, path: Path | str, why: str) -> None:
        super().__init__(
            f"{path} is no manifest of a recording: {why}; the episodes beside it are readable "
            "by themselves, record into another directory"
        )


class DamagedEpisode(DnetError, ValueError):
    """An episode that is not as long as it was when it was finished."""

    def __init__(self, path: Path | str, got: int, want: int) -> None:
        super().__init__(
            f"{path} has {got} bytes, had {want} when it was finished; remove it, and the same "
            "call records it again"
        )


class WorkerDied(DnetError, RuntimeError):
    """A process that was to do a part of the work and is no more."""

    def __init__(self, did: str, way_out: str) -> None:
        super().__init__(f"a process that {did} was killed, perhaps for want of memory; {way_out}")


class NoSpace(DnetError, OSError):
    """A disk without room for what is to be written."""

    def __init__(self, folder: Path | str, need: int, free: int) -> None:
        super().__init__(
            f"{folder} has {_bytes(free)} free, the recording takes about "
            f"{_bytes(need)}; make room, choose another disk, or ask for fewer --pairs, "
            "--shapes or frames on the way"
        )


def _bytes(count: int) -> str:
    return f"{count / 1e9:.2f} GB" if count >= 1e9 else f"{count / 1e6:.2f} MB"


class OutputInUse(DnetError, RuntimeError):
    """A directory that another process writes into."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"another process writes into {folder}; wait for it, or choose another directory"
        )


class UnknownPicture(DnetError, ValueError):
    """A file name that says no kind of picture that we draw."""

    def __init__(self, path: Path, endings: tuple[str, ...]) -> None:
        super().__init__(
            f"picture {path} ends in {path.suffix or 'nothing'}, must end in one of "
            f"{', '.join(endings)}"
        )


class Unsettled(DnetError, RuntimeError):
    """A simulated body that does not come to rest."""

    def __init__(self, what: str, steps: int, moved: float) -> None:
        super().__init__(
            f"{what} still moved by {moved * 1e3:.3g} mm after {steps} steps; "
            "its strains are too large, or its material is too stiff for the time step"
        )


class BrokenLimit(DnetError, RuntimeError):
    """A validation that found figures outside their limits."""

    def __init__(self, broken: list[str]) -> None:
        super().__init__(
            f"{len(broken)} of the material's limits broken: {'; '.join(broken)}; "
            "don't record with this simulation before you know why"
        )


class BadReport(DnetError, ValueError):
    """Something that a report is made from, and that cannot be read."""

    def __init__(self, path: Path, why: str, way_out: str) -> None:
        super().__init__(f"{path} {why}; {way_out}")


class MissingPackage(DnetError, ImportError):
    """A package that every whole installation has, and this one has not."""

    def __init__(self, package: str, what: str, remedy: str) -> None:
        super().__init__(f"{what} needs {package}, which is not installed; {remedy}")


class Unfit(DnetError, RuntimeError):
    """A machine on which dnet does not work as it should."""

    def __init__(self, abilities: list[str]) -> None:
        super().__init__(
            f"{', '.join(abilities)} will not work here; the table above says what mends that"
        )


class MissingExtra(DnetError, ImportError):
    """A package that only some need, and that is not installed."""

    def __init__(self, package: str, extra: str, what: str) -> None:
        super().__init__(
            f'{what} needs {package}, which is not installed; pip install "deformernet[{extra}]"'
        )


class NotOnnx(DnetError, ValueError):
    """A file to export to by whose name nobody could tell what it is."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"output {path} ends in {path.suffix or 'nothing'}, must end in .onnx")


class Disagreement(DnetError, ArithmeticError):
    """An exported network that is not the original."""

    def __init__(self, path: Path, got: float, limit: float) -> None:
        super().__init__(
            f"{path} was not written: the exported network differs from the original by {got:.1e} "
            f"of its largest output, {limit:.0e} is allowed; try another version of onnxruntime, "
            "or use the checkpoint itself"
        )


class UnknownStore(DnetError, ValueError):
    """A URL of which nobody knows how to write to it."""

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"{url} is no store that can be written to: {why}; "
            "give a folder, or a URL such as s3://bucket/data"
        )


class StoreFailed(DnetError, OSError):
    """A folder or object store that does not do what is asked of it."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(
            f"{name} fails: {why}; see that it is there and that you may write to it; "
            "finished episodes are kept, the same call goes on"
        )


class Unfetched(DnetError, OSError):
    """A file in a store that cannot be read."""

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"{url} cannot be read: {why}; see that the store answers, that the file is there, "
            "and that you may read it"
        )


class ChangedEpisode(DnetError, RuntimeError):
    """A file that is not the one that was indexed."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(
            f"{path} has changed since it was indexed; run the same call again, which brings the "
            "index up to date"
        )


class OtherStream(DnetError, ValueError):
    """A state of a loader that is not of this loader."""

    def __init__(self, what: str, got: object, want: object) -> None:
        super().__init__(
            f"the loader's {what} is {got}, that of the state to go on from is {want}; go on with "
            "the same data, seed and division, or begin anew"
        )


class OtherWorker(DnetError, RuntimeError):
    """A process that would not record what was asked for, or not where."""

    def __init__(self, host: str, name: str, why: str) -> None:
        super().__init__(
            f"a worker on {host} cannot record into {name}: {why}; all of them must see the same "
            "files there, and have the same versions of dnet and of what it builds on"
        )


class NoCluster(DnetError, ConnectionError):
    """A Ray cluster that is not there, or does not answer."""

    def __init__(self, address: str, why: str) -> None:
        super().__init__(
            f"no Ray cluster at {address}: {why}; `ray start --head` begins one, "
            "`--ray local` makes one for this recording alone"
        )


class ClusterFailed(DnetError, RuntimeError):
    """A Ray cluster that does not do what is asked of it."""

    def __init__(self, address: str, why: str) -> None:
        super().__init__(
            f"the Ray cluster at {address} failed: {why}; every node needs the same dnet; "
            "finished episodes are kept, the same call goes on"
        )


class BrokenRecord(DnetError, ValueError):
    """A file that cannot be read any further from its front."""

    def __init__(self, path: Path, byte: int, why: str) -> None:
        super().__init__(
            f"{path} is broken at byte {byte}: {why}; `dnet inspect repair {path}` saves the whole "
            "frames before it"
        )
        self.byte = byte
        self.why = why


class SharedFolder(DnetError, ValueError):
    """Copies that would lie among the originals."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"{folder} holds the files to be repaired, which stay as they are; "
            "choose another directory for what is saved of them"
        )


class Unwritten(DnetError, OSError):
    """A folder that takes no file."""

    def __init__(self, folder: Path, why: str) -> None:
        super().__init__(
            f"nothing can be written into {folder}: {why}; make room, or choose another directory; "
            "the originals are as they were"
        )


class DiskFailed(DnetError, OSError):
    """A disk that does not take or give what is asked of it, where nothing else says so."""

    def __init__(self, error: OSError) -> None:
        super().__init__(
            f"{error.filename or 'a file'}: {error.strerror}; see that there is room and that you "
            "may read and write there; what was finished is kept"
        )


class NothingSaved(DnetError, ValueError):
    """Broken files that hold no whole frame."""

    def __init__(self, names: list[str], files: int) -> None:
        shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
        super().__init__(
            f"nothing could be saved of {len(names)} of {files} files ({shown}); "
            "they are kept, record them again"
        )


class FaultyEpisodes(DnetError, ValueError):
    """Episodes of which a validation found something wrong."""

    def __init__(self, errors: int, warnings: int, episodes: int) -> None:
        super().__init__(
            f"{errors} errors and {warnings} warnings in {episodes} episodes; move the files with "
            "errors elsewhere and record them again, or save their whole frames with "
            "`dnet inspect repair`"
        )


class NoSuchEpisode(DnetError, LookupError):
    """An episode that a dataset lacks."""

    def __init__(self, root: Path | str, wanted: str, episodes: list[str]) -> None:
        shown = ", ".join(episodes[:4]) + (", ..." if len(episodes) > 4 else "")
        super().__init__(
            f"{root} has no readable episode {wanted}, neither as an id nor as a number: it has "
            f"{len(episodes)} ({shown}); `dnet inspect ls {root}` lists them"
        )


class BadCondition(DnetError, ValueError):
    """A condition on frames that is none."""

    def __init__(self, condition: str, why: str, columns: list[str]) -> None:
        super().__init__(
            f"{condition!r} is no condition on frames: {why}; write SQL that is true or false of "
            f"each, with the columns {', '.join(columns)}"
        )


class NothingMatches(DnetError, LookupError):
    """A condition that holds nowhere."""

    def __init__(self, root: Path | str, condition: str, frames: int) -> None:
        super().__init__(
            f"{condition!r} holds for none of {frames} frames of {root}; ask for less, "
            f"`dnet inspect stats {root}` tells what they are like"
        )


class Unmerged(DnetError, RuntimeError):
    """Recordings that Rerun did not write into one file."""

    def __init__(self, path: Path, count: int, why: str) -> None:
        super().__init__(
            f"Rerun could not write {count} recordings into {path}: {why}; make room, or save "
            "one episode at a time"
        )


class ClashingEpisodes(DnetError, ValueError):
    """Different episodes that one dataset cannot tell apart."""

    def __init__(self, what: str, name: str, paths: list[str]) -> None:
        apart = "rename one" if what == "name" else "record one of them with another --seed"
        super().__init__(
            f"{' and '.join(paths)} are different, but have one {what}: {name}; keep them in "
            f"folders of their own, or {apart}"
        )


class UnlikePaths(DnetError, ValueError):
    """A file and a directory that were to be compared."""

    def __init__(self, folder: Path, file: Path) -> None:
        super().__init__(
            f"{folder} is a directory and {file} is a file; compare two episodes or two directories"
        )


class BadArrays(DnetError, ValueError):
    """A file of arrays that no episode can be made of."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(
            f"{path} {why}; `dnet inspect import --help` says what it must hold, in metres"
        )


class UnusedOption(DnetError, ValueError):
    """An option that does nothing beside the others."""

    def __init__(self, option: str, needs: str) -> None:
        super().__init__(f"{option} does nothing without {needs}; leave one out or add the other")


class BadTables(DnetError, RuntimeError):
    """Tables of clouds that went missing or are damaged while a training reads them."""

    def __init__(self, folder: Path, why: str) -> None:
        super().__init__(
            f"the tables of clouds in {folder}: {why}; remove that folder, it can be found anew, "
            "and run the same command again"
        )


class Uneven(DnetError, ValueError):
    """A batch that the processes of a training cannot share evenly."""

    def __init__(self, batch: int, processes: int) -> None:
        super().__init__(
            f"a batch of {batch} cannot be shared evenly by {processes} processes; "
            f"choose --groups that {processes} divides"
        )


class OtherRun(DnetError, ValueError):
    """Work that is to go on with other settings, or other data, than it began with."""

    def __init__(self, run: Path, name: str, before: object, now: object) -> None:
        super().__init__(
            f"the run in {run} has {name} {_short(before)}, not {_short(now)}; "
            "go on with the settings and the data that it began with, or choose another --out"
        )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


class UnknownAblation(DnetError, LookupError):
    """A name that no ablation has."""

    def __init__(self, name: str, names: list[str]) -> None:
        super().__init__(f"there is no ablation {name!r}; there are {', '.join(names)}")


class NoDisplacement(DnetError, ValueError):
    """A goal that the object has already, so that no point of it needs to be moved."""

    def __init__(self, what: str, got: float, least: float) -> None:
        super().__init__(
            f"{what} {got * 1e3:.1f} mm from the initial shape, need at least {least * 1e3:.1f} mm "
            "to tell where to grasp; choose a goal further away, or give the manipulation point"
        )


class BadCloudFile(DnetError, ValueError):
    """A file that holds no cloud to reach."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(
            f"{path} {why}; give the visible surface of the object as (n, 3) in metres"
        )


class NoGrasp(DnetError, RuntimeError):
    """An object that the arm can grasp nowhere."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the object cannot be grasped: {reason}; move it, or choose another goal")


class UnknownTruth(DnetError, ValueError):
    """A method that needs to know what only a simulated goal tells."""

    def __init__(self, option: str, goal: str) -> None:
        super().__init__(
            f"{option} needs to know how the goal was made, and {goal} does not tell; "
            "choose another method, or a goal of an episode"
        )


class DiskAlmostFull(NoSpace):
    """A disk on which a run could not be finished."""

    def __init__(self, folder: Path, free: int, need: int) -> None:
        Exception.__init__(
            self,
            f"{folder} has {free / 1e6:.0f} MB free, and a run needs {need / 1e6:.0f} MB to end "
            "whole; make room, or choose another disk",
        )


class NoGoals(DnetError, FileNotFoundError):
    """A directory without a single goal."""

    def __init__(self, path: Path) -> None:
        super().__init__(
            f"{path} holds no goal; put episodes (.mcap) or clouds (.npy, .ply, .pcd) there"
        )


class OneOf(DnetError, ValueError):
    """Two options of which one is needed, and one alone."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"give either {one} or {other}, and not both")


class OutOfReach(DnetError, ValueError):
    """A cloud of which no point can be grasped."""

    def __init__(self, points: int) -> None:
        super().__init__(
            f"none of {points} points of the initial cloud faces the moving arm and lies beyond "
            "the holding arm's clearance; turn the object, or choose a smaller clearance"
        )


class NoFilm(DnetError, ValueError):
    """A film of a kind that is not written."""

    def __init__(self, path: Path, kinds: tuple[str, ...]) -> None:
        super().__init__(f"{path} is no film; let its name end in {' or '.join(kinds)}")


class BadName(DnetError, ValueError):
    """A name in a file that is no name of one."""

    def __init__(self, what: str, name: object, why: str) -> None:
        super().__init__(
            f"{what} is {_short(name)}, {why}; it must be one name of at most 255 bytes, without / "
            "and \\: rename it where it comes from, or leave that file out"
        )


class TooLarge(DnetError, ValueError):
    """A file, or a part of one, that is larger than anything of its kind."""

    def __init__(self, what: str, path: Path | str, got: int, most: int) -> None:
        super().__init__(
            f"{what} {path} has {got} bytes, at most {most} are read; it is not what its name says"
            ", or was not made by dnet: see where it comes from"
        )
