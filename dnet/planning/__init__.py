"""Collision-free joint paths for one arm."""
