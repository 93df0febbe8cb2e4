"""What a profile makes of the operator's postures, and what its joints do over their ranges. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.report.tables import plain_table
from deploy.sim.suit.postures import POSTURES, robot_posture
from slave.contact.config import ContactConfig
from slave.contact.watch import ContactWatch
from slave.guard.config import GuardConfig
from slave.model.distance import DistanceModel

_STEPS = 15
_TOLD_M = 0.05
"""Parts that stay further apart than this are not worth a word."""


@dataclass(frozen=True, slots=True)
class JointCourse:
    """One joint from its lower to its upper limit, the others in the zero pose."""

    name: str
    range_deg: tuple[float, float]
    zero_deg: float
    turns: str
    nearest_m: float
    """Between two parts of the robot that the joint brings together; infinite where there are none."""
    between: str
    noticed_nm: float
    """Torque from outside at rest from which it counts as pushed, by output encoders; inf: not watched."""


@dataclass(frozen=True, slots=True)
class TakenPosture:
    """One posture of the operator, as the robot takes it."""

    posture: str
    position_rad: Array
    left_deg: Mapping[str, float]
    """By segment: what the robot cannot follow."""


@dataclass(frozen=True, slots=True)
class Checked:
    """All of it."""

    skeleton: Skeleton
    courses: Sequence[JointCourse]
    taken: Sequence[TakenPosture]
    touching: Sequence[str]
    """Parts that are nearer than the guard's margin in the zero pose."""
    dull: str
    """Below which force no push is noticed, in words."""


def checked(skeleton: Skeleton) -> Checked:
    """Look at a profile."""
    margin_m = GuardConfig().self_margin_cm / 100.0
    distances = DistanceModel(skeleton)
    zero = np.clip(skeleton.zero_rad, skeleton.lower_rad, skeleton.upper_rad)
    near = distances.near(zero)
    touching = [
        f"{' and '.join(distances.names[p])} are {100.0 * d:.1f} cm apart in the zero pose"
        for p, d in zip(near.pair.tolist(), near.distance_m.tolist(), strict=True)
        if d < margin_m
    ]
    watch = ContactWatch(skeleton, ContactConfig())
    courses = [
        _course(skeleton, distances, zero, j, float(watch.floor_nm[j])) for j in range(len(skeleton.joints))
    ]
    taken = [worn(skeleton, name, posture) for name, posture in POSTURES.items()]
    return Checked(skeleton, courses, taken, list(dict.fromkeys(touching)), watch.dull)


def worn(skeleton: Skeleton, name: str, posture_deg: Mapping[str, float]) -> TakenPosture:
    """What the robot's joints become for a posture of the operator."""
    position, left_rad = robot_posture(skeleton, posture_deg)
    left = dict(zip(skeleton.segment_names, np.degrees(left_rad).tolist(), strict=True))
    return TakenPosture(name, position, left)


def _course(
    skeleton: Skeleton, distances: DistanceModel, zero: Array, j: int, noticed_nm: float
) -> JointCourse:
    joint = skeleton.joints[j]
    nearest, between = math.inf, ""
    for angle in np.linspace(joint.lower_rad, joint.upper_rad, _STEPS):
        position = zero.copy()
        position[j] = angle
        near = distances.near(position)
        if len(near.distance_m) and near.distance_m.min() < nearest:
            k = int(near.distance_m.argmin())
            nearest, between = float(near.distance_m[k]), " – ".join(distances.names[near.pair[k]])
    limits = (math.degrees(joint.lower_rad), math.degrees(joint.upper_rad))
    turns = ", ".join(dict.fromkeys(skeleton.segment_names[skeleton.angle_slots[a][0]] for a in joint.drives))
    return JointCourse(joint.name, limits, math.degrees(joint.zero_rad), turns, nearest, between, noticed_nm)


def range_table(found: Checked) -> Table:
    """A row a joint."""
    table = plain_table("joint", "from °", "to °", "zero pose °", "turns", "pushed from N m", "nearest cm")
    for one in found.courses:
        near = f"{100.0 * one.nearest_m:.1f} {one.between}" if one.nearest_m < _TOLD_M else ""
        low, high = (f"{angle:.0f}" for angle in one.range_deg)
        noticed = f"{one.noticed_nm:.2g}" if math.isfinite(one.noticed_nm) else "not watched"
        table.add_row(one.name, low, high, f"{one.zero_deg:.0f}", one.turns, noticed, near)
    return table


def posture_lines(found: Checked) -> list[str]:
    """One a posture: what is left of each segment, and the joints."""
    lines = []
    for one in found.taken:
        left = ", ".join(f"{name} {angle:.0f}°" for name, angle in one.left_deg.items() if angle > 1.0)
        away = np.degrees(one.position_rad - found.skeleton.zero_rad)
        moved = ", ".join(
            f"{name} {angle:+.0f}"
            for name, angle in zip(found.skeleton.joint_names, away.tolist(), strict=True)
            if abs(angle) > 2.0
        )
        lines.append(
            f"{one.posture}: {left or 'nothing'} left over; from its zero pose, °: {moved or 'none'}"
        )
    return lines


def troubles(found: Checked) -> list[str]:
    """What makes the check fail."""
    return list(found.touching)
