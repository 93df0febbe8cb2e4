"""How the robot came to rest after a fault, as its 12-bit encoders show it. Pure.

An encoder shows an angle to half a count, so the way between two readings is known to ± one count (0.088°).
Speed is therefore taken over 50 ms, where that makes ± 1.8 °/s. A joint stands still from when on it never
leaves where it ends by more than two counts, 0.18°; where others of its arm go on and shake it, by more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.encoders.counts import RAD_PER_COUNT

WINDOW_S = 0.05
"""Over which speed is taken."""
SPEED_ERROR_RAD_S = RAD_PER_COUNT / WINDOW_S
"""What quantisation adds to it at most."""
STILL_RAD = 2.5 * RAD_PER_COUNT
REST_S = 0.3
"""A joint must have stood for at least this long when the trial ends."""


@dataclass(frozen=True, slots=True)
class StoppingMotion:
    """What was asked of the joints and what the encoders showed, at the same instants."""

    at_s: Array
    """(T,) rising; 0 is the moment of the fault."""
    setpoint_rad: Array
    """(T, J)"""
    encoder_rad: Array
    """(T, J)"""


@dataclass(frozen=True, slots=True)
class Stillness:
    """Figures of the joints concerned, each of the worst joint; angles of the output shafts."""

    peak_joint: str
    """The joint that came nearest to its speed limit."""
    peak_speed_rad_s: float
    """The speed of that joint over 50 ms."""
    peak_share: float
    """That speed over the joint's limit."""
    way_rad: float
    """How far a joint was from where it had been at the fault, at most."""
    overshoot_rad: float
    """How far a joint went outside of the way between where it was at the fault and its last setpoint."""
    standstill_s: float | None
    """Time from the fault until every joint was at rest for good; None if one still moved at the end."""


def stillness(
    course: StoppingMotion, skeleton: Skeleton, concerned: Mask, still_rad: float = STILL_RAD
) -> Stillness:
    """Judge the joints (J,) `concerned`, at least one. The course begins at or before the fault."""
    joints = np.flatnonzero(concerned)
    after = course.at_s >= 0.0
    at_s, encoder = course.at_s[after], course.encoder_rad[np.ix_(after, joints)]
    speed = speeds(course.at_s, course.encoder_rad[:, joints])
    share = speed / skeleton.max_velocity_rad_s[joints]
    worst = int(share[after].max(axis=0).argmax())
    first, asked = encoder[0], course.setpoint_rad[-1, joints]
    beyond = np.maximum(encoder - np.maximum(first, asked), np.minimum(first, asked) - encoder)
    return Stillness(
        peak_joint=skeleton.joint_names[joints[worst]],
        peak_speed_rad_s=float(speed[after][:, worst].max()),
        peak_share=float(share[after][:, worst].max()),
        way_rad=float(np.abs(encoder - first).max()),
        overshoot_rad=max(0.0, float(beyond.max())),
        standstill_s=_standstill_s(at_s, encoder, still_rad),
    )


def speeds(at_s: Array, position_rad: Array) -> Array:
    """Mean speed over the last `WINDOW_S`, or where rows are sparse a little more, (T, J); 0 before that."""
    before = np.searchsorted(at_s, at_s - WINDOW_S + 1e-6, side="right") - 1
    whole = before >= 0
    elapsed = np.where(whole, at_s - at_s[before], 1.0)
    out: Array = np.where(whole[:, None], np.abs(position_rad - position_rad[before]), 0.0) / elapsed[:, None]
    return out


def _standstill_s(at_s: Array, encoder_rad: Array, still_rad: float) -> float | None:
    end_rad = np.median(encoder_rad[at_s > at_s[-1] - REST_S], axis=0)
    moving = (np.abs(encoder_rad - end_rad) > still_rad).any(axis=1)
    still_from = int(np.flatnonzero(moving)[-1]) + 1 if moving.any() else 0
    if still_from == len(at_s) or at_s[-1] - at_s[still_from] < REST_S:
        return None
    return max(0.0, float(at_s[still_from]))
