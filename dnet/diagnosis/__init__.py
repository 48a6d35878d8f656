"""What this machine can do with dnet: tried, not guessed."""
