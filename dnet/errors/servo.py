"""Goals, grasps and motions of a servo run."""

from pathlib import Path

from dnet.errors.root import DnetError


class BadMotion(DnetError, ValueError):
    """A controller that asks for a motion that is no motion."""

    def __init__(self, motion: object, step: int) -> None:
        super().__init__(
            f"step {step}: the predicted motion is {motion}, must be finite; "
            "the checkpoint is spoilt, train again"
        )


class NoDisplacement(DnetError, ValueError):
    """A goal that the object has already, so that no point of it needs to be moved."""

    def __init__(self, what: str, got: float, least: float) -> None:
        super().__init__(
            f"{what} {got * 1e3:.1f} mm from the initial shape, need at least {least * 1e3:.1f} mm "
            "to tell where to grasp; choose a goal further away, or give the manipulation point"
        )


class NoGrasp(DnetError, RuntimeError):
    """An object that the arm can grasp nowhere."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the object cannot be grasped: {reason}; move it, or choose another goal")


class OutOfReach(DnetError, ValueError):
    """A cloud of which no point can be grasped."""

    def __init__(self, points: int) -> None:
        super().__init__(
            f"none of {points} points of the initial cloud faces the moving arm and lies beyond "
            "the holding arm's clearance; turn the object, or choose a smaller clearance"
        )


class UnknownTruth(DnetError, ValueError):
    """A method that needs to know what only a simulated goal tells."""

    def __init__(self, option: str, goal: str) -> None:
        super().__init__(
            f"{option} needs to know how the goal was made, and {goal} does not tell; "
            "choose another method, or a goal of an episode"
        )


class NoGoals(DnetError, FileNotFoundError):
    """A directory without a single goal."""

    def __init__(self, path: Path) -> None:
        super().__init__(
            f"{path} holds no goal; put episodes (.mcap) or clouds (.npy, .ply, .pcd) there"
        )
