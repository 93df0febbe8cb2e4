"""The operator's joint angles at one instant: what the master computes, and what the robots are sent."""

from __future__ import annotations

from dataclasses import dataclass

from common.quaternion import Array
from common.wire.messages import Mask


@dataclass(frozen=True, slots=True)
class JointAngleSample:
    """The operator's joint angles at one deciding tick."""

    tick: int
    sampled_ns: int
    frames_in_ns: int
    position_rad: Array
    velocity_rad_s: Array
    valid: Mask
    doubt: str = ""
    """Why the robot must not be engaged on this sample, in words; empty where it may."""
    period_ms: int = 0
    """Until the next sample is due, as the rate in force has it; 0 where that is not known."""
