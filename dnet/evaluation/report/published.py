"""What was published: the figures that a report is held against, each as it was stated."""

from collections.abc import Mapping

METHODS: Mapping[str, str] = {"keypoints": "keypoint method", "regressor": "PointConv method"}
"""What the paper calls its two ways to choose the manipulation point."""

GRASP_MM: Mapping[str, float] = {"keypoints": 35.0, "regressor": 36.0}
"""Mean distance of the manipulation point from the truth over 100 cases, in millimetres (Thach,
Kuntz, Hermans 2021, the results; 0.035 m and 0.036 m there)."""
GRASP_CASES = 100

FINAL_CHAMFER: Mapping[str, tuple[float, ...]] = {
    "keypoints": (0.23, 0.32, 0.26, 0.22),
    "regressor": (0.18, 0.39, 0.53, 0.52),
}
"""Final "Chamfer distance" of the four cases, table I there. The authors' scripts compute the
norm of the distances of all goal points to the current cloud: 0.23 are 5 mm RMS of 2048 points."""

TRAIN_MSE_MM2: Mapping[str, float] = {"deformernet": 1.5, "hu": 41.2}
"""Loss on training pairs, a mean over x, y, z in mm²."""
TEST_MSE_MM2: Mapping[str, float] = {"deformernet": 2.4, "hu": 125.1}
"""Loss on test pairs, which the authors' scripts sum over x, y, z."""

HU_CHAMFER = 1.0
"""Final "Chamfer distance" which the controller of Hu et al. stayed above in all four cases."""

SUCCESS_TOLERANCES = (0.1, 0.2, 0.3, 0.4)
"""Of the legacy norm (Thach, Cho, Kuntz, Hermans 2022)."""
SUCCESS_SHARES: Mapping[str, tuple[float, ...]] = {
    "deformernet": (0.2, 1.0, 1.0, 1.0),
    "rrt": (0.0, 0.3, 0.9, 1.0),
}
"""Share of the goals that were reached within each of them, of other objects than ours."""
