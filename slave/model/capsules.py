"""The robot's shape: a segment's capsules, which the simulated robot, avoidance and contact all read.

A segment's `shape` in the profile's table tells them: one bar with round ends, from the segment's joint to
amid its children's joints or to its tip, or one to each child's joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from common.skeleton import Segment, Skeleton

_SLENDERNESS = 0.18
"""Radius over length of segments whose radius the skeleton does not tell."""

_Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Capsule:
    """All points within `radius_m` of the line between two points of a segment's own frame."""

    segment: int
    """Its place in `skeleton.segments`."""
    from_m: _Point
    to_m: _Point
    radius_m: float


@lru_cache(maxsize=16)
def capsules(skeleton: Skeleton) -> tuple[Capsule, ...]:
    """The capsules of all segments, in the order of the segments."""
    return tuple(
        Capsule(i, (0.0, 0.0, 0.0), end, segment.shape.radius_m or _SLENDERNESS * float(np.linalg.norm(end)))
        for i, segment in enumerate(skeleton.segments)
        for end in _ends_m(segment, skeleton)
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
