"""The report of the paper: every figure of it beside ours, read from the logs of experiments."""
