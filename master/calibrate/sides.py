"""Whether left is left: everything of one side worn on the other fits all joints, but no person moves so.

Arms and legs swing outwards farther than inwards, and turn outwards farther; what a joint's limits say of the
angles as they are is compared with what they say of the same orientations on the other side. Where the
recording tells it, the left joint's centre must also lie to the left of the right one's.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import IDENTITY, conjugate, rotate
from common.skeleton import Skeleton
from master.calibrate.evidence import CrossCheck, at_most, not_judged
from master.calibrate.facing import Ends, angles_at, beyond, limits_of, segment_orientation
from master.calibrate.joint_motion import JointFinding
from master.calibrate.oriented import Oriented

_WORST_RAD = math.radians(0.5)
"""Mean excess over the limits by which the other side must be better, and less than half of it."""
_KNOWN_M = 0.05
"""Centres nearer than that to each other, sideways, tell nothing."""


def check_sides(skeleton: Skeleton, suit: Oriented, joints: list[JointFinding], ends: Ends) -> CrossCheck:
    """All pairs of limbs together, by their joints with the trunk."""
    compared = "the limbs' angles against their limits, this side and the other"
    as_assigned = exchanged = 0.0
    pairs = 0
    for left in (n for n in ends if n.startswith("left_")):
        right = left.replace("left_", "right_", 1)
        i, j = skeleton.segment_names.index(left), _index(skeleton, right)
        if j is None or right not in ends or skeleton.segments[i].parent != skeleton.segments[j].parent:
            continue
        pairs += 1
        as_assigned += _excess(skeleton, suit, ends, (i, i)) + _excess(skeleton, suit, ends, (j, j))
        exchanged += _excess(skeleton, suit, ends, (i, j)) + _excess(skeleton, suit, ends, (j, i))
    if not pairs:
        return not_judged(compared, "no limb of either side is known")
    wrong_way = _wrong_way(joints, ends)
    reason = f"the limbs go {math.degrees(as_assigned / pairs):.0f}° beyond their limits on average, " + (
        f"and {math.degrees(exchanged / pairs):.0f}° with left and right exchanged"
    )
    figure = (as_assigned - exchanged) / pairs
    if exchanged > 0.5 * as_assigned:
        figure = min(figure, _WORST_RAD)
    if wrong_way is True:
        figure = max(figure, 2.0 * _WORST_RAD)
        reason = "the left joint's centre lies to the right of the right one's"
    elif wrong_way is False:
        figure = min(figure, _WORST_RAD)
    return at_most(
        compared,
        math.degrees(figure),
        math.degrees(_WORST_RAD),
        "°",
        advice=f"left and right seem to be exchanged ({reason}). Exchange the units of both sides, or their "
        "ids in the master's file, and record again",
    )


def _excess(skeleton: Skeleton, suit: Oriented, ends: Ends, rows: tuple[int, int]) -> float:
    """Mean excess, rad, of segment rows[0]'s orientations by the joint of segment rows[1]."""
    entry, judge = skeleton.segments[rows[0]], skeleton.segments[rows[1]]
    step = max(1, round(suit.rate_hz / 10.0))
    child = segment_orientation(suit, ends, entry.name, step)
    # a trunk that does not tell how it moves stands upright, as everyone faced in the zero pose
    parent = segment_orientation(suit, ends, entry.parent, step) if entry.parent in ends else IDENTITY
    angles = angles_at(skeleton, rows[1], parent, child)
    limits = [limits_of(skeleton, name) for name in judge.angles]
    return sum(float(np.mean(beyond(a, of))) for a, of in zip(angles, limits, strict=True) if of)


def _wrong_way(joints: list[JointFinding], ends: Ends) -> bool | None:
    """Whether the left joints' centres lie right of the right ones'; None where that is not known."""
    sideways: dict[str, float] = {}
    for joint in joints:
        if joint.fit is not None and joint.refusal is None and joint.parent in ends:
            centre_m = rotate(conjugate(ends[joint.parent][1]), -joint.fit.levers_m[0])
            sideways[joint.segment] = float(centre_m[1])
    apart = [
        y - sideways[other]
        for name, y in sideways.items()
        if name.startswith("left_") and (other := name.replace("left_", "right_", 1)) in sideways
        and _same_parent(joints, name, other)
    ]  # fmt: skip
    plain = [a for a in apart if abs(a) > _KNOWN_M]
    return None if not plain else sum(plain) < 0.0


def _same_parent(joints: list[JointFinding], one: str, other: str) -> bool:
    parents = {j.segment: j.parent for j in joints}
    return parents[one] == parents[other]


def _index(skeleton: Skeleton, name: str) -> int | None:
    return skeleton.segment_names.index(name) if name in skeleton.segment_names else None
