"""Driving an object to a goal shape in a closed loop."""
