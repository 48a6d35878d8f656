"""The trained networks that ship, each with a card that says what it was trained on."""

from pathlib import Path

DEFORMERNET = Path(__file__).with_name("deformernet.safetensors")
"""DeformerNet, trained on 150 pairs of initial configuration and manipulation point."""
HU = DEFORMERNET.with_name("hu.safetensors")
"""The network of Hu et al., trained on the same, to compare with."""
REGRESSOR = DEFORMERNET.with_name("grasp.safetensors")
"""Where to grasp, as a position."""
DENSE = DEFORMERNET.with_name("dense.safetensors")
"""Where to grasp, as a score for each point."""
KEYPOINTS = DEFORMERNET.with_name("keypoints.safetensors")
"""Which point of an object is which in another cloud of it."""
