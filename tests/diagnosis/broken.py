"""Attempts that end in every way in which an attempt can."""

import os
import signal
import time


def works() -> str:
    print("what a library prints is no answer")
    return "it works"


def fails() -> str:
    raise RuntimeError("it does not\nwork")


def crashes() -> str:
    os.kill(os.getpid(), signal.SIGILL)
    return "no processor gets here"


def hangs() -> str:
    time.sleep(600)
    return "nobody waits for that"
