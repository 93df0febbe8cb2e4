"""What came of a fault, and what of it was wrong: joints that did not stand, limits that were broken."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.harness.faults.fault import FaultRow
from deploy.measure.stillness import SPEED_ERROR_RAD_S, Stillness, StoppingMotion, speeds

SERVO_SHARE = 0.05
"""The share by which a servo may exceed a setpoint at its limit: 4.3 % for a second order at damping √½."""
STOP_RAD = math.radians(3.0)
"""The mechanical stops stand this far outside the position limits. A joint that stands at its limit is shaken
beyond it when its neighbours brake (a finger by 1°); the stop it must not reach."""
BRAKES_S = 0.1
"""The nursing robot's joints stop from full speed in this time; `BRAKED_S` has it and the settling."""
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class FaultOutcome:
    """What came of a fault."""

    fault: FaultRow
    state: str
    """The guard's."""
    reason: str
    """The guard's own words."""
    stillness: Stillness
    """The stillness of the affected joints."""
    wrong: tuple[str, ...]
    """What should not have been; empty where all is as it must be."""
    reacted_s: float | None = None
    """When the guard had reached the state in which it was to end; None where it did not, or nobody knows."""
    strayed_rad: float | None = None
    """How far joints that were to go on were from where they would have been; None where none was to."""
    refused: Mapping[str, int] = field(default_factory=dict)
    """Commands refused since the fault, by gate."""


def standing_amiss(fault: FaultRow, seen: Stillness, excused_s: float = 0.0) -> list[str]:
    """What is wrong with how the joints came to stand.

    `excused_s`: what the host itself lost meanwhile, or how much longer than the nursing robot it brakes.
    """
    if fault.stands_s is None:
        return []
    if seen.standstill_s is None:
        return [f"still moves at the end of the trial, {seen.peak_joint} foremost"]
    if seen.standstill_s > fault.stands_s + excused_s:
        return [f"stands after {seen.standstill_s:.3f} s, at most {fault.stands_s:g} s"]
    return []


def brakes_longer_s(skeleton: Skeleton) -> float:
    """By how much a robot takes longer to brake from its limits' speeds than the rows' times allow for."""
    return max(0.0, float((skeleton.max_velocity_rad_s / skeleton.max_acceleration_rad_s2).max()) - BRAKES_S)


@dataclass(frozen=True, slots=True)
class Asked:
    """The guard's setpoints, one row a step, in the guard's own time."""

    step_s: Array
    """(T - 1,) from one row to the next, as the guard counts it."""
    position_rad: Array
    """(T, J)"""
    velocity_rad_s: Array
    """(T, J)"""


def asked_beyond(asked: Asked, skeleton: Skeleton) -> list[str]:
    """Limits that setpoints broke, the worst joint of each; exact."""
    step_s = asked.step_s[:, None]
    fastest, hardest = skeleton.max_velocity_rad_s * step_s, skeleton.max_acceleration_rad_s2 * step_s
    moved, gained = np.diff(asked.position_rad, axis=0), np.diff(asked.velocity_rad_s, axis=0)
    lower, upper = skeleton.lower_rad, skeleton.upper_rad
    return [
        *_beyond("setpoint's position", asked.position_rad, lower, upper, skeleton),
        *_beyond("setpoint's speed", moved, -fastest, fastest, skeleton),
        *_beyond("setpoint's acceleration", gained, -hardest, hardest, skeleton),
    ]


def moved_beyond(course: StoppingMotion, skeleton: Skeleton) -> list[str]:
    """Limits that the joints themselves broke, the worst of each, servos and encoders allowed for."""
    fastest = skeleton.max_velocity_rad_s * (1.0 + SERVO_SHARE) + SPEED_ERROR_RAD_S
    lower, upper = skeleton.lower_rad - STOP_RAD, skeleton.upper_rad + STOP_RAD
    speed = speeds(course.at_s, course.encoder_rad)
    return [
        *_beyond("encoder's position", course.encoder_rad, lower, upper, skeleton),
        *_beyond("encoder's speed", speed, -fastest, fastest, skeleton),
    ]


def _beyond(what: str, values: Array, lower: Array, upper: Array, skeleton: Skeleton) -> list[str]:
    over = np.maximum(values - upper, lower - values).max(axis=0)
    worst = int(over.argmax())
    if over[worst] <= _ROUNDING:
        return []
    return [f"the {what} of {skeleton.joint_names[worst]} passed its limit by {over[worst]:.3g}"]
