"""From a depth image to the cloud that a network sees."""
