"""An open DeformerNet: simulate, record, train, servo and play back soft-tissue manipulation."""

from importlib.metadata import version

__version__ = version("deformernet")
