"""Experiments whose figures can be computed again from what they leave on disk."""
