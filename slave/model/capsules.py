"""The robot's bodies and their shape, which the simulated robot, avoidance and contact all read.

A profile may list them: the `[[link]]`s of a robot's own model, each with its bars. Otherwise every segment
is one, and its `shape` tells its capsules: one bar with round ends, from the segment's joint to amid its
children's joints or to its tip, or one to each child's joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from common.skeleton import RobotHinge, RobotLink, Segment, Skeleton

_SLENDERNESS = 0.18
"""Radius over length of segments whose radius the skeleton does not tell."""

_Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Capsule:
    """All points within `radius_m` of the line between two points of a body's own frame."""

    segment: int
    """Place of the body in `links(skeleton)`: of a robot without links of its own, the segment's."""
    from_m: _Point
    to_m: _Point
    radius_m: float


@lru_cache(maxsize=16)
def capsules(skeleton: Skeleton) -> tuple[Capsule, ...]:
    """The capsules of all bodies, in the order of the bodies."""
    if skeleton.own_links:
        return tuple(
            Capsule(i, bar.from_m, bar.to_m, bar.radius_m)
            for i, link in enumerate(skeleton.own_links)
            for bar in link.bars
        )
    return tuple(
        Capsule(i, (0.0, 0.0, 0.0), end, segment.shape.radius_m or _SLENDERNESS * float(np.linalg.norm(end)))
        for i, segment in enumerate(skeleton.segments)
        for end in _ends_m(segment, skeleton)
    )


@lru_cache(maxsize=16)
def links(skeleton: Skeleton) -> tuple[RobotLink, ...]:
    """The robot's bodies: its own links, else one for each segment, with a hinge for each driven angle."""
    if skeleton.own_links:
        return skeleton.own_links
    driven = {angle for joint in skeleton.joints for angle in joint.drives}
    return tuple(
        RobotLink(
            segment.name,
            segment.parent,
            segment.origin_m,
            # MuJoCo turns a body by its hinges in their order: the table's intrinsic sequence
            hinges=tuple(RobotHinge(turn.angle, turn.axis) for turn in segment.turns if turn.angle in driven),
        )
        for segment in skeleton.segments
    )


def _ends_m(segment: Segment, skeleton: Skeleton) -> list[_Point]:
    """Where its bars end: at or amid its children's joints, at its tip, or twice as far as its node."""
    children = [s.origin_m for s in skeleton.segments if s.parent == segment.name]
    if children and segment.shape.fan:
        return children
    if children:
        x, y, z = np.mean(children, axis=0).tolist()
        return [(x, y, z)]
    return [segment.shape.tip_m or (0.0, 0.0, 2.0 * segment.node_m[2])]
