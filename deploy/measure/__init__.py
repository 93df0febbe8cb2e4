"""Judge a finished run: what was solved and what the robot did, against the operator's true joint angles."""

from deploy.measure.accuracy import Accuracy, accuracy
from deploy.measure.motion import FollowedMotion, motion
from deploy.measure.trace import MovedSeries, SolvedSeries, Trace, TruthSeries

__all__ = [
    "Accuracy",
    "FollowedMotion",
    "MovedSeries",
    "SolvedSeries",
    "Trace",
    "TruthSeries",
    "accuracy",
    "motion",
]
