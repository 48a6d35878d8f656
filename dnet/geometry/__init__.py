"""Points in space: sampling, neighbours, distances, poses and the camera model."""
