"""The robot as a tree of frames with one hinge each, which URDF and transforms share. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from common.quaternion import IDENTITY, Array, from_axis_angle, multiply, rotate
from common.skeleton import WORLD, RobotHinge, RobotLink, Skeleton
from common.skeleton.links import hinge_values
from slave.model.capsules import links


@dataclass(frozen=True, slots=True)
class FrameEdge:
    """A frame and the one that it hangs on. A link has a frame for each hinge, the last is its own."""

    parent: str
    child: str
    translation_m: Array
    """(3,) with its hinge at 0."""
    q_parent_from_child: Array
    """(4,) wxyz, with its hinge at 0."""
    hinge: RobotHinge | None
    """None: fixed. It moves the child's frame, about or along an axis through the child's origin."""

    def placed(self, values: Mapping[str, Array]) -> tuple[Array, Array]:
        """Translation (3,) and rotation (4,) of the child in its parent. A hinge without a value is at 0."""
        value = None if self.hinge is None else values.get(self.hinge.name)
        if self.hinge is None or value is None:
            return self.translation_m, self.q_parent_from_child
        axis = np.array(self.hinge.axis)
        if self.hinge.slides:
            moved = self.translation_m + rotate(self.q_parent_from_child, axis) * value
            return moved, self.q_parent_from_child
        return self.translation_m, multiply(self.q_parent_from_child, from_axis_angle(axis, value))


def edges(skeleton: Skeleton) -> list[FrameEdge]:
    """All frames of a robot, parents before their children; the root hangs on `world`."""
    return [edge for link in links(skeleton) for edge in _of_link(link)]


def transforms(skeleton: Skeleton, position_rad: Array) -> list[tuple[FrameEdge, Array, Array]]:
    """Every frame with its translation (3,) m and rotation (4,) in its parent, for joints (J,)."""
    values = hinge_values(skeleton.joints, position_rad)
    return [(edge, *edge.placed(values)) for edge in edges(skeleton)]


def _of_link(link: RobotLink) -> Iterator[FrameEdge]:
    parent, q = link.parent, np.array(link.q_parent_from_link)
    origin = np.array(link.origin_m)
    before = np.zeros(3)
    """Where the frame that this one hangs on stands in the link's own frame."""
    for number, hinge in enumerate(link.hinges, start=1):
        anchor = np.zeros(3) if hinge.slides else np.array(hinge.anchor_m)
        ends = number == len(link.hinges) and not anchor.any()
        child = link.name if ends else f"{link.name}__{hinge.name}"
        yield FrameEdge(parent, child, origin + rotate(q, anchor - before), q, hinge)
        if ends:
            return
        parent, q, origin, before = child, IDENTITY, np.zeros(3), anchor
    yield FrameEdge(parent, link.name, origin + rotate(q, -before), q, None)


ROOT = WORLD
"""The frame in which the robot stands."""
