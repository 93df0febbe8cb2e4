"""Which way the person faced in the zero pose, by the level axes of the joints, with the sign of each.

An axis of a joint that lies level in the zero pose points where the table says, so every one tells where the
zero pose faced. Its sign is the one by which the joint bends within its limits; where that is not plain, the
one that agrees with the other joints.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, conjugate, heading_turn, multiply, rotate, to_matrix
from common.skeleton import Skeleton
from master.calibrate.joint_motion import JointFinding, zero_axes
from master.calibrate.oriented import Oriented
from master.joint_angles.angles import intrinsic_angles

_LEVEL = 0.5
"""Sine of the steepest axis that still has a heading."""
_PLAIN_RAD = math.radians(1.5)
"""Mean excess over the limits by which the wrong sign of an axis is told."""
_AXIS_FLOOR_RAD = math.radians(1.0)
"""No axis of a person is known better."""
_ONE_LIMB_RAD, _PAIR_RAD = math.radians(15.0), math.radians(8.0)
"""How far a person's limb, or the mean of a pair of them, faces from ahead in the zero pose."""


@dataclass(slots=True)
class Axis:
    """A level axis: which way the zero pose faces by it, in the common frame of its island."""

    joint: int
    facing_rad: float
    sigma_rad: float
    known: bool
    """False: its sign is open, the facing may be half a turn off."""


Ends = Mapping[str, tuple[float, Array]]
"""Of each aligned node the heading of its own earth frame, rad, and `q_sensor_from_segment`."""
Island = dict[str, tuple[float, float]]
"""Nodes whose headings are known against each other: offset into the island's frame, and its variance."""


def islands_of(names: tuple[str, ...], joints: list[JointFinding]) -> list[Island]:
    """Parents stand before children, so one pass is enough."""
    links = {j.segment: j for j in joints if j.refusal is None}
    islands: list[Island] = []
    for name in names:
        joint = links.get(name)
        home = None if joint is None else next((i for i in islands if joint.parent in i), None)
        if joint is None or joint.fit is None or home is None:
            islands.append({name: (0.0, 0.0)})
            continue
        offset, variance = home[joint.parent]
        home[name] = (offset + joint.fit.offset_rad, variance + joint.fit.offset_sigma_rad**2)
    return islands


def axes_by_node(
    skeleton: Skeleton,
    suit: Oriented,
    q_zero_pose: dict[str, Array],
    joints: list[JointFinding],
    island: Island,
) -> dict[str, list[Axis]]:
    """Every node's own level axes, by node, with their signs."""
    out: dict[str, list[Axis]] = {}
    for number, joint in enumerate(joints):
        if not joint.axes_known or joint.segment not in island or joint.fit is None:
            continue
        assert joint.fit.axes is not None
        i = skeleton.segment_names.index(joint.segment)
        zero = zero_axes(skeleton, i)
        assert zero is not None
        found = []
        ends = ((joint.parent, zero[0]), (joint.segment, zero[-1]))
        for (name, zero_axis), axis, sigma in zip(
            ends, joint.fit.axes, joint.fit.axis_sigma_rad, strict=True
        ):
            if abs(zero_axis[2]) < _LEVEL:
                there = rotate(multiply(heading_turn(island[name][0]), q_zero_pose[name]), axis)
                facing = _heading(there) - _heading(zero_axis)
                found.append((name, Axis(number, facing, math.hypot(sigma, _AXIS_FLOOR_RAD), True)))
        if not found:
            continue
        # both ends of a joint share one sign: as its angle stays within its limits
        lead = found[0][1].facing_rad
        excess = [
            _excess(skeleton, suit, i, joint, q_zero_pose, island, lead + turn) for turn in (0.0, math.pi)
        ]
        flip = math.pi if excess[1] < excess[0] else 0.0
        known = abs(excess[1] - excess[0]) > _PLAIN_RAD
        for name, axis_found in found:
            facing = axis_found.facing_rad
            if math.cos(facing - lead) < 0.0:
                facing += math.pi
            axis_found.facing_rad, axis_found.known = facing + flip, known
            out.setdefault(name, []).append(axis_found)
    return out


def _excess(
    skeleton: Skeleton,
    suit: Oriented,
    i: int,
    joint: JointFinding,
    q_zero_pose: dict[str, Array],
    island: Island,
    facing_rad: float,
) -> float:
    """By how much, rad on average, the joint's bending is beyond its limits if the zero pose faced so."""
    entry = skeleton.segments[i]
    first = entry.human.index(True)
    limits = limits_of(skeleton, entry.angles[first])
    if limits is None:
        return 0.0
    turns = {name: facing_rad - island[name][0] for name in (joint.parent, joint.segment)}
    ends = {
        name: (island[name][0], multiply(conjugate(q_zero_pose[name]), heading_turn(turn)))
        for name, turn in turns.items()
    }
    return float(np.mean(beyond(joint_angles(skeleton, suit, i, ends)[first], limits)))


def joint_angles(skeleton: Skeleton, suit: Oriented, i: int, ends: Ends) -> Array:
    """Intrinsic angles (3, K) of a joint at some 20 Hz, for heading and alignment by name."""
    entry, step = skeleton.segments[i], max(1, round(suit.rate_hz / 20.0))
    parent, child = (segment_orientation(suit, ends, name, step) for name in (entry.parent, entry.name))
    return angles_at(skeleton, i, parent, child)


def segment_orientation(suit: Oriented, ends: Ends, name: str, step: int) -> Array:
    """A segment's orientation (K, 4) in the common frame, of every `step`-th sample."""
    heading_rad, q_sensor_from_segment = ends[name]
    q = suit.q[suit.names.index(name)][::step]
    return multiply(multiply(heading_turn(heading_rad), q), q_sensor_from_segment)


def angles_at(skeleton: Skeleton, i: int, parent: Array, child: Array) -> Array:
    """Intrinsic angles (3, K) at the joint of segment `i`, for orientations (K, 4) of both sides."""
    frame = skeleton.axis_frames[i]
    angles = intrinsic_angles(frame.T @ to_matrix(multiply(conjugate(parent), child)) @ frame)
    angles[2] *= skeleton.axis_handedness[i]
    return angles


def beyond(angle: Array, limits: tuple[float, float]) -> Array:
    """How far angles (K,) are outside their limits, rad."""
    out: Array = np.maximum(limits[0] - angle, 0.0) + np.maximum(angle - limits[1], 0.0)
    return out


def limits_of(skeleton: Skeleton, angle: str | None) -> tuple[float, float] | None:
    """A joint angle's limits by the table, rad; None where it has none."""
    for joint in skeleton.joints:
        if angle is not None and angle in joint.drives:
            ends = sorted(joint.drives[angle] * limit for limit in (joint.lower_rad, joint.upper_rad))
            return ends[0], ends[1]
    return None


def facing_of(axes: dict[str, list[Axis]]) -> tuple[float, float] | None:
    """Which way the person faced in the zero pose, and its standard deviation; settles signs that were open.

    Limbs are turned in or out alike on both sides: a pair of limbs says more than either.
    """
    every = [axis for mine in axes.values() for axis in mine]
    known = [axis.facing_rad for axis in every if axis.known]
    if not known:
        return None
    about = _mean_angle(known)
    for axis in every:
        if not axis.known and math.cos(axis.facing_rad - about) < 0.0:
            axis.facing_rad += math.pi
    by_segment = {name: _mean_angle([a.facing_rad for a in mine]) for name, mine in axes.items()}
    pairs = [
        _mean_angle([facing, by_segment[other]])
        for name, facing in by_segment.items()
        if name.startswith("left_") and (other := name.replace("left_", "right_", 1)) in by_segment
    ]
    single = _ONE_LIMB_RAD if not pairs else _PAIR_RAD
    estimates = pairs or list(by_segment.values())
    facing = _mean_angle(estimates)
    spread = math.sqrt(
        sum(math.remainder(s - facing, 2.0 * math.pi) ** 2 for s in estimates) / len(estimates)
    )
    return facing, max(single, spread) / math.sqrt(len(estimates))


def _mean_angle(angles_rad: list[float]) -> float:
    return math.atan2(sum(map(math.sin, angles_rad)), sum(map(math.cos, angles_rad)))


def _heading(v: Array) -> float:
    return math.atan2(v[1], v[0])
