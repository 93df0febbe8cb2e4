"""The first stage of the pipeline: which commands count, and when the robot may move."""

from slave.guard.admit import GATES, Admission
from slave.guard.config import GuardConfig
from slave.guard.guard import Guard
from slave.guard.permission import Permission
from slave.guard.states import State

__all__ = ["GATES", "Admission", "Guard", "GuardConfig", "Permission", "State"]
