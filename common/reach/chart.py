"""From the rotation of each segment to the angles of the nearest one that its joints can make: the constants.

Whatever of the three angles a robot has, the nearest rotation without limits is a sum and a difference of two
atan2 of sums of the quaternion's components (w, x, y, z) in the segment's axis frame:

    angles      half sum s of               half difference d of      then
    a, b, c     atan2(x + z, w + y)         atan2(x - z, w - y)       a = s + d, c = s - d; b by length
    a, c        the same                    the same                  a = s + d, c = s - d
    a, b        atan2(x + y, w - z)         atan2(x - y, w + z)       a = s + d, b = s - d
    b, c        atan2(y + z, w - x)         atan2(y - z, w + x)       b = s + d, c = s - d
    one, as a   atan2(x, w)                 the same                  a = s + d

Where the rotation has no part about the axes that the robot lacks, these are the angles of the intrinsic
decomposition, Zuo, Yu and Gong (2016), Eqs 13 to 24.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.reach.nearest import Box, Triple, angle_range, box
from common.skeleton import Skeleton

SUM, DIFFERENCE, MIDDLE = range(3)
"""Rows of the computed angles (3, N): s + d, s - d, and the second of three."""

_SUM_OF_THREE = [[0, 1, 0, 1], [1, 0, 1, 0], [0, 1, 0, -1], [1, 0, -1, 0]]
# rows: numerator and denominator of s, numerator and denominator of d; columns: w, x, y, z
_FORMS: dict[tuple[int, ...], list[list[int]]] = {
    (0, 1, 2): _SUM_OF_THREE,
    (0, 2): _SUM_OF_THREE,
    (0, 1): [[0, 1, 1, 0], [1, 0, 0, -1], [0, 1, -1, 0], [1, 0, 0, 1]],
    (1, 2): [[0, 0, 1, 1], [1, -1, 0, 0], [0, 0, 1, -1], [1, 1, 0, 0]],
    (0,): [[0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
    (1,): [[0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0]],
    (2,): [[0, 0, 0, 1], [1, 0, 0, 0], [0, 0, 0, 1], [1, 0, 0, 0]],
    (): [[0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
}


@dataclass(frozen=True, slots=True)
class JointGroup:
    """A segment that two or three independent angles turn: what is beyond a limit is projected together."""

    segment: int
    joints: tuple[int | None, int | None, int | None]
    """Which joint turns each angle; None: no joint does."""
    scale: Triple
    """The angle for 1 rad of its joint; 1 where there is none."""
    turning: list[int]
    """Those joints that there are."""
    box: Box
    """Of the angles: fixed where no joint turns it, without ends where any value will do (the heading)."""
    middle: Triple
    """Amid the ranges, rad."""
    ball: bool
    """Whether it has all three angles, so that it has a pole."""

    def angles(self, position_rad: list[float]) -> Triple:
        """Its angles at joint positions (J,)."""
        (i, j, k), (a, b, c) = self.joints, self.scale
        return (
            0.0 if i is None else a * position_rad[i],
            0.0 if j is None else b * position_rad[j],
            0.0 if k is None else c * position_rad[k],
        )


@dataclass(frozen=True, slots=True)
class Chart:
    """The constants of one skeleton with certain limits."""

    forms: Array
    """(N, 4, 4): numerators and denominators of s and d from the quaternion in the parent's coordinates."""
    driven: NDArray[np.intp]
    """(J, K): each joint's angles, as places among the flattened (3, N); a shorter list repeats its first."""
    weights: Array
    """(J, K): least squares, 0 where the list is shorter."""
    centre_rad: Array
    """(3 N,): middle of each angle's range: of angles a whole turn apart the one nearest to it is meant."""
    segment_of_joint: NDArray[np.intp]
    """(J, K): the segments of those angles."""
    groups: tuple[JointGroup, ...]


def make_chart(skeleton: Skeleton, lower_rad: Array, upper_rad: Array) -> Chart:
    """Work the constants out for joint limits (J,)."""
    count = len(skeleton.segments)
    lives = [_live(skeleton, i) for i in range(count)]
    forms = np.empty((count, 4, 4))
    to_axes = np.eye(4)
    for i, live in enumerate(lives):
        to_axes[1:, 1:] = skeleton.axis_frames[i].T
        forms[i] = np.array(_FORMS[live], dtype=np.float64) @ to_axes
    joints = len(skeleton.joints)
    most = max(len(joint.drives) for joint in skeleton.joints)
    driven, weights = np.zeros((joints, most), dtype=np.intp), np.zeros((joints, most))
    centre = np.zeros(3 * count)
    for j, joint in enumerate(skeleton.joints):
        squares = sum(ratio**2 for ratio in joint.drives.values())
        middle = 0.5 * (lower_rad[j] + upper_rad[j])
        for n, (angle, ratio) in enumerate(joint.drives.items()):
            segment, place = skeleton.angle_slots[angle]
            sign = float(skeleton.axis_handedness[segment]) if place == 2 else 1.0
            driven[j, n] = _row(lives[segment], place) * count + segment
            weights[j, n] = sign * ratio / squares
            centre[driven[j, n]] = sign * ratio * middle
        # a repeated place with weight 0: a matrix product would spread NaN to all
        driven[j, len(joint.drives) :] = driven[j, 0]
    return Chart(
        forms, driven, weights, centre, driven % count, _groups(skeleton, lives, lower_rad, upper_rad)
    )


def _live(skeleton: Skeleton, index: int) -> tuple[int, ...]:
    """Which of a segment's three angles count: those with a name, and a root's turn about the vertical."""
    segment = skeleton.segments[index]
    named = {k for k, angle in enumerate(segment.angles) if angle}
    if named and _free_heading(skeleton, index):
        named.add(0)
    return tuple(sorted(named))


def _free_heading(skeleton: Skeleton, index: int) -> bool:
    """Of the world only the vertical is known: no joint sets which way a root faces."""
    segment = skeleton.segments[index]
    return skeleton.parents[index] < 0 and segment.angles[0] is None and abs(segment.axes[0][2]) == 1


def _row(live: tuple[int, ...], place: int) -> int:
    if len(live) == 3 and place == 1:
        return MIDDLE
    return SUM if place == live[0] else DIFFERENCE


def _groups(
    skeleton: Skeleton, lives: list[tuple[int, ...]], lower_rad: Array, upper_rad: Array
) -> tuple[JointGroup, ...]:
    alone = {next(iter(joint.drives)): j for j, joint in enumerate(skeleton.joints) if len(joint.drives) == 1}
    groups = []
    for i, segment in enumerate(skeleton.segments):
        named = [angle for angle in segment.angles if angle]
        if len(lives[i]) < 2 or any(angle not in alone for angle in named):
            continue
        groups.append(_group(skeleton, i, alone, lower_rad, upper_rad, 0 in lives[i]))
    return tuple(groups)


def _group(
    skeleton: Skeleton, index: int, alone: dict[str, int], lower_rad: Array, upper_rad: Array, heading: bool
) -> JointGroup:
    """The group of one segment. `alone`: the joint of each angle; `heading`: the first angle is free."""
    joints: list[int | None] = [None, None, None]
    scale, ends = [1.0, 1.0, 1.0], [(0.0, 0.0)] * 3
    for k, angle in enumerate(skeleton.segments[index].angles):
        if angle is not None:
            joints[k] = j = alone[angle]
            handed = float(skeleton.axis_handedness[index]) if k == 2 else 1.0
            scale[k] = handed * skeleton.joints[j].drives[angle]
            low, high = sorted((scale[k] * float(lower_rad[j]), scale[k] * float(upper_rad[j])))
            ends[k] = (low, high)
        elif k == 0 and heading:
            ends[k] = (-math.inf, math.inf)
    middle = [0.5 * (low + high) if math.isfinite(low) else 0.0 for low, high in ends]
    return JointGroup(
        index,
        (joints[0], joints[1], joints[2]),
        (scale[0], scale[1], scale[2]),
        [j for j in joints if j is not None],
        box(angle_range(*ends[0]), angle_range(*ends[1]), angle_range(*ends[2])),
        (middle[0], middle[1], middle[2]),
        all(low != high for low, high in ends),
    )
