"""Drive a servo run with a controller of your own."""

import sys
from pathlib import Path

import dnet
from dnet.laboratory import LaboratorySettings, laboratory
from dnet.servo.controllers import Controller
from dnet.trials.request import Trial
from dnet.trials.trial import run_trial
from dnet.types import Cloud, Point


class Cautious:
    """Goes half the way that another controller would, and looks again."""

    def __init__(self, other: Controller) -> None:
        self._other = other

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp, in metres."""
        return 0.5 * self._other.predict(current, goal)


settings = LaboratorySettings(world="quasistatic")
trial = Trial(goal=sys.argv[1], out=Path(sys.argv[2]), laboratory=settings)
with laboratory(settings) as lab:
    trace = run_trial(trial, lab, say=print, controller=Cautious(dnet.load()))
print(trace.outcome)
