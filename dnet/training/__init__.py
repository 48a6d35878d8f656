"""Training networks from episodes."""
