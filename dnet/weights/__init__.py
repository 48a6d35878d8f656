"""The trained networks that ship, each with a card that says what it was trained on."""

from pathlib import Path

DEFORMERNET = Path(__file__).with_name("deformernet.safetensors")
"""DeformerNet, trained on 150 pairs of initial configuration and manipulation point."""
