"""Joint groups: parts of the robot that people name, such as an arm with its hand. Derived from the tree."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from common.skeleton.table import WORLD, Skeleton

_Mask = NDArray[np.bool_]


def joint_groups(skeleton: Skeleton) -> Mapping[str, _Mask]:
    """The joints (J,) of each group that has any, in the order of the table.

    A group is a segment with all that hangs on it: an arm has its hand and fingers. Only a root's group has
    the root's own joints alone. A group begins at every root, at every child of a root, and wherever the
    table names one.
    """
    out: dict[str, _Mask] = {}
    for i, segment in enumerate(skeleton.segments):
        parent = int(skeleton.parents[i])
        begins = parent < 0 or skeleton.segments[parent].parent == WORLD
        if segment.group is None and not begins:
            continue
        joints = _joints_of(skeleton, {i} if parent < 0 else _hanging_on(skeleton, i))
        if joints.any():
            out[segment.group or segment.name] = joints
    return out


def _hanging_on(skeleton: Skeleton, first: int) -> set[int]:
    """The segment and all beyond it; a parent stands before its children."""
    found = {first}
    for i, parent in enumerate(skeleton.parents.tolist()):
        if parent in found:
            found.add(i)
    return found


def _joints_of(skeleton: Skeleton, segments: set[int]) -> _Mask:
    driven = (any(skeleton.angle_slots[a][0] in segments for a in joint.drives) for joint in skeleton.joints)
    return np.fromiter(driven, np.bool_, len(skeleton.joints))
