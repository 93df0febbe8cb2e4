"""Where a robot of one's own gets in its own way: postures found by search from its model."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from common.skeleton.groups import joint_groups
from common.wire.messages import Mask
from deploy.measure.apart import Distances
from slave.guard.config import GuardConfig
from slave.guard.zones import BoxZone
from slave.model.body import BodyModel
from slave.model.capsules import links
from slave.model.ends import limb_ends

_SAMPLES = 6000
_WAY = 24
"""Looks on the straight way to a posture."""
_INSIDE_M = 0.03
"""So deep the two parts would be in each other, were they not kept apart."""
OWN_REACH_S = 1.6
"""The operator's time to the posture."""
_REACH_SHARE = 0.4
"""Of each joint's velocity limit, as in the simulated operator's postures."""
_FREE_M = 0.05
"""The zone stands so much farther away than its margin from all that the robot did before."""
ZONE_MARGIN_CM = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class OwnMove:
    """A posture that the operator goes to in `OWN_REACH_S`, in a straight line of joint angles."""

    position_rad: Array
    """(J,)"""
    meets_s: float
    """When the robot would come to the margin, did it follow without delay."""
    zone: str = ""
    """The zone that is in the way, as `guard.zones` takes it."""


@lru_cache(maxsize=16)
def arms_crossed(skeleton: Skeleton, begin: tuple[float, ...]) -> OwnMove | str:
    """Left and right arm meet; or what the robot lacks. `begin`: joint angles where the operator begins."""
    left, right = _links_of(skeleton, "left_arm"), _links_of(skeleton, "right_arm")
    if not left or not right:
        return "no two arms"
    return _meeting(skeleton, begin, left, right) or "the arms do not reach each other in time"


@lru_cache(maxsize=16)
def hand_to_head(skeleton: Skeleton, begin: tuple[float, ...]) -> OwnMove | str:
    """A hand meets the head; or what the robot lacks."""
    hand, head = _links_of(skeleton, "right_hand"), _head(skeleton)
    if not head:
        return "no head"
    if not hand:
        return "no right hand"
    return _meeting(skeleton, begin, hand, head) or "no hand reaches the head in time"


@lru_cache(maxsize=16)
def into_a_zone(
    skeleton: Skeleton, begin: tuple[float, ...], before: Callable[[float], Array]
) -> OwnMove | str:
    """The right hand reaches ahead into a box. `before`: angles (J,) until the operator begins, by time."""
    hand = _links_of(skeleton, "right_hand")
    ends = limb_ends(skeleton)
    if not hand or "right_hand" not in ends.names:
        return "no right hand"
    k = ends.names.index("right_hand")
    margin_m = 0.01 * ZONE_MARGIN_CM
    done = np.array([before(t) for t in np.linspace(0.0, 1.0, 60)])
    wide = BoxZone(name="x", shape="box", center_m=[20.0, 0.0, 0.0], size_m=[20.0, 20.0, 20.0])
    farthest_m = 10.0 - float(Distances(skeleton, [wide]).to_zones_m(done).min())
    face_m = farthest_m + margin_m + _FREE_M
    found = None
    for end in _candidates(skeleton, np.array(begin), _arm_joints(skeleton, "right")):
        at = ends.at(end)[k]
        if at[0] > face_m + _INSIDE_M and (found is None or at[0] > found[1][0]):
            found = end, at
    if found is None:
        return "the hand reaches no farther ahead"
    end, at = found
    center = [round(face_m + 0.25, 3), round(float(at[1]), 3), round(float(at[2]), 3)]
    zone = BoxZone(name="bed", shape="box", center_m=center, size_m=[0.5, 1.6, 0.6], margin_cm=ZONE_MARGIN_CM)
    way = _way(np.array(begin), end)
    near = Distances(skeleton, [zone]).to_zones_m(way)[:, 0] < margin_m
    if not near.any():
        return "the hand reaches no farther ahead"
    text = f'{{name="bed", shape="box", center_m={center}, size_m={zone.size_m}, margin_cm={ZONE_MARGIN_CM}}}'
    return OwnMove(end, OWN_REACH_S * float(near.argmax()) / _WAY, text)


def _meeting(skeleton: Skeleton, begin: tuple[float, ...], one: Set[str], other: Set[str]) -> OwnMove | None:
    """The nearest posture in which these two meet, and nothing else of the robot meets before."""
    apart, start = Distances(skeleton), np.array(begin)
    margin_m = GuardConfig().self_margin_cm / 100.0
    joints = np.zeros(len(start), np.bool_)
    for side in ("left", "right"):
        joints |= _arm_joints(skeleton, side)
    ends = _candidates(skeleton, start, joints)
    deep = apart.between_m(ends, one, other) < -_INSIDE_M
    effort = (np.abs(ends - start) / skeleton.max_velocity_rad_s).max(axis=1)
    for k in np.argsort(effort):
        if not deep[k]:
            continue
        way = _way(start, ends[k])
        near, wanted = apart.own_m(way) < margin_m, apart.between_m(way, one, other) < margin_m
        if not near[0] and near.argmax() == wanted.argmax():
            return OwnMove(ends[k], OWN_REACH_S * float(near.argmax()) / _WAY)
    return None


def _way(begin: Array, end: Array) -> Array:
    return begin + np.linspace(0.0, 1.0, _WAY + 1)[:, None] * (end - begin)


def _candidates(skeleton: Skeleton, begin: Array, joints: Mask) -> Array:
    """(S, J) postures that these joints can reach in time, the same at each call."""
    most = _REACH_SHARE * OWN_REACH_S * skeleton.max_velocity_rad_s
    low = np.maximum(skeleton.lower_rad, begin - most)
    high = np.minimum(skeleton.upper_rad, begin + most)
    drawn = np.random.default_rng(1).uniform(low, np.maximum(low, high), (_SAMPLES, len(begin)))
    out: Array = np.where(joints, drawn, begin)
    return out


def _arm_joints(skeleton: Skeleton, side: str) -> Mask:
    """(J,) joints that turn a side's upper arm and forearm."""
    arm = {f"{side}_upper_arm", f"{side}_forearm"}
    turns = [{skeleton.segment_names[skeleton.angle_slots[a][0]] for a in j.drives} for j in skeleton.joints]
    return np.array([bool(arm & each) for each in turns])


def _links_of(skeleton: Skeleton, group: str) -> set[str]:
    """The bodies that joints of a group move."""
    mask = joint_groups(skeleton).get(group)
    if mask is None:
        return set()
    body = BodyModel(skeleton)
    moved: Mask = np.any(body.carries @ np.abs(body.hinges_per_joint[mask]).T > 0.0, axis=1)
    return {link.name for link, yes in zip(links(skeleton), moved.tolist(), strict=True) if yes}


def _head(skeleton: Skeleton) -> set[str]:
    follows = {segment.link or segment.name for segment in skeleton.segments if segment.name == "head"}
    return {link.name for link in links(skeleton) if link.name in follows or "head" in link.name.lower()}
