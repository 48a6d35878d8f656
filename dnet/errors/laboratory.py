"""The robot and the object, as they are simulated."""

from dnet.errors.root import DnetError


class Unreachable(DnetError, ValueError):
    """A pose that the arm cannot take within its limits."""

    def __init__(self, what: str, point: tuple[float, float, float], why: str) -> None:
        x, y, z = point
        super().__init__(
            f"{what} at ({x:.4f}, {y:.4f}, {z:.4f}) m is out of reach: {why}; "
            "choose a point nearer the middle of the workspace"
        )


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


class NoReachableSurface(DnetError, ValueError):
    """An object of which no part can be grasped."""

    def __init__(self, size: tuple[float, float, float], clearance: float) -> None:
        length, width, height = (1e3 * edge for edge in size)
        super().__init__(
            f"no surface of an object of {length:.0f} x {width:.0f} x {height:.0f} mm is "
            f"reachable: it must face the moving arm and lie {clearance * 1e3:.0f} mm from the "
            "held end; make the object longer or the clearance smaller"
        )


class Unsettled(DnetError, RuntimeError):
    """A simulated body that does not come to rest."""

    def __init__(self, what: str, steps: int, moved: float) -> None:
        super().__init__(
            f"{what} still moved by {moved * 1e3:.3g} mm after {steps} steps; "
            "its strains are too large, or its material is too stiff for the time step"
        )
