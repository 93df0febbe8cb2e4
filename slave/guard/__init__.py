"""Between a command and the servos: who may move the robot, when, how far and how fast."""

from slave.guard.admit import GATES, Verdict
from slave.guard.config import GuardConfig
from slave.guard.guard import Guard, Setpoint
from slave.guard.states import State

__all__ = ["GATES", "Guard", "GuardConfig", "Setpoint", "State", "Verdict"]
