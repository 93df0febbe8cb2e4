"""Postures of an operator, and the motion from one to the next, whatever robot with arms follows."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, multiply
from common.reach import make_follower
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, Move

POSTURES: Mapping[str, Mapping[str, float]] = {
    "zero pose": {},
    "elbows bent": {"elbow_pitch": 90.0},
    "arms ahead": {"shoulder_pitch": 80.0, "elbow_pitch": 10.0},
    "arms sideways": {"shoulder_roll": 60.0, "elbow_pitch": 20.0},
    "forearms turned": {"elbow_pitch": 80.0, "elbow_roll": 50.0},
    "wrists bent": {"elbow_pitch": 60.0, "wrist_yaw": 30.0},
    "reaching": {"shoulder_pitch": 40.0, "shoulder_roll": 20.0, "elbow_pitch": 50.0, "elbow_roll": 30.0},
}
"""Of a person, in the nursing profile's joints of both arms, degrees."""
_STILL_S, _PAUSE_S, _LEAST_S = 3.5, 0.3, 1.0
_SHARE = 0.4
"""Of each joint's velocity and acceleration limit at most."""
_CLOSED_SHARE = 0.6
"""Of their range, hands close where elbows bend."""


def relative_postures(skeleton: Skeleton, posture_deg: Mapping[str, float]) -> Array:
    """(N, 4): rotations of the operator's segments, any profile's, from their parents."""
    person = load_skeleton("nursing")
    angles = np.zeros(len(person.joints))
    for j, joint in enumerate(person.joint_names):
        for part, angle in posture_deg.items():
            if joint.endswith(part):
                angles[j] = math.radians(angle)
    q_of = dict(zip(person.segment_names, orientations(person, angles), strict=True))
    q = np.empty((len(skeleton.segments), 4))
    for i, name in enumerate(skeleton.segment_names):
        hand = f"{name.partition('_')[0]}_hand"
        # a segment that the person lacks, a glove's, goes with its hand
        q[i] = q_of.get(name, q_of.get(hand, IDENTITY))
    above = np.array([IDENTITY if p < 0 else q[p] for p in skeleton.parents])
    return multiply(conjugate(above), q)


def robot_posture(skeleton: Skeleton, posture_deg: Mapping[str, float]) -> tuple[Array, Array]:
    """What a robot's joints (J,) become, rad, and what of each segment (N,) it cannot follow, rad."""
    q = relative_postures(skeleton, posture_deg)
    follower = make_follower(skeleton, skeleton.lower_rad, skeleton.upper_rad)
    position, _ = follower.follow(q, np.zeros_like(q))
    return position, follower.short_rad


def posture_motion(skeleton: Skeleton) -> MinimumJerkMotion:
    """From posture to posture and back, as slowly as the slowest joint needs; hands close and open."""
    at = [robot_posture(skeleton, posture)[0] for posture in POSTURES.values()]
    grips = [j for j, joint in enumerate(skeleton.joints) if joint.name.endswith("_grip")]
    for position, posture in zip(at, POSTURES.values(), strict=True):
        for j in grips:
            joint = skeleton.joints[j]
            closed = joint.upper_rad if joint.zero_rad <= joint.lower_rad else joint.lower_rad
            share = _CLOSED_SHARE if "elbow_roll" in posture else 0.0
            position[j] = joint.zero_rad + share * (closed - joint.zero_rad)
    at = [np.clip(position, skeleton.lower_rad, skeleton.upper_rad) for position in at]
    moves, now_s = [], _STILL_S
    for before, after in zip(at, [*at[1:], at[0]], strict=True):
        way = np.abs(after - before)
        # peaks of a minimum-jerk move: 1.875 Δ / T and 10 / √3 Δ / T²
        longest = np.maximum(
            1.875 * way / (_SHARE * skeleton.max_velocity_rad_s),
            np.sqrt(10.0 / math.sqrt(3.0) * way / (_SHARE * skeleton.max_acceleration_rad_s2)),
        )
        duration_s = max(_LEAST_S, float(longest.max()))
        moves += [
            Move(name, now_s, duration_s, float(to))
            for name, to, far in zip(skeleton.joint_names, after, way, strict=True)
            if far > 1e-6
        ]
        now_s += duration_s + _PAUSE_S
    return MinimumJerkMotion(skeleton.joint_names, at[0], moves, now_s)
