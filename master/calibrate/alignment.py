"""How each unit sits on its segment, from standing in the zero pose and a motion, with no magnetometer.

The zero pose says where up is in every unit. That leaves one angle a unit open: the way its segment faced, in
the unit's own earth frame. Two things tell it (`joint_fit.py`):

- an axis of a joint that lies level in the zero pose (elbow, knee, finger): the table says which way it then
  points, so both units at a hinge know by themselves how they sit;
- the heading offset between neighbours: with it chest, head and hands, which have no such axis, face as the
  limbs do. Limbs left and right are turned in or out alike, so that their mean faces ahead.

The sign of an axis is the one by which the joint bends within its limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from common.quaternion import Array, conjugate, heading_turn, multiply, rotate
from common.skeleton import Skeleton
from master.calibrate.clock_lag import check_lags, joint_lag
from master.calibrate.evidence import CrossCheck, first_contradiction
from master.calibrate.facing import Axis, Island, axes_by_node, facing_of, islands_of, joint_angles
from master.calibrate.hinge import PoorMotionError
from master.calibrate.joint_motion import JointFinding, joint_motion
from master.calibrate.joint_residuals import Moving
from master.calibrate.neighbours import check_order, fit_pairs
from master.calibrate.oriented import Oriented, mean_rotation, moving, orient
from master.calibrate.recording import NodeRecording
from master.calibrate.sides import check_sides
from master.calibrate.unit_evidence import unit_evidence
from master.calibrate.zero_pose import find_zero_pose, given_zero_pose

_TURNED_RAD = math.radians(36.0)
"""How far a limb may be turned in or out in the zero pose: a real person's arms are, by so much each."""
_WORST_FACING_RAD = math.radians(25.0)
_ALONE = "no neighbour of it is left to compare it with"


@dataclass(frozen=True, slots=True)
class NodeAlignment:
    """One unit's answer."""

    q_sensor_from_segment: Array
    """(4,)."""
    sigma_rad: float
    """One standard deviation of the angle about the long axis; the zero pose itself is not in it."""
    tilt_rad: float | None
    """How far its own axis was from level in the zero pose; None where it has none."""
    heading_rad: float
    """Turns the unit's own earth frame into the common one; the person faces east in the zero pose."""
    told_by: str
    """Its own joint's axis, or the segment whose facing it shares."""


@dataclass(frozen=True, slots=True)
class SuitAlignment:
    """The whole suit's answer."""

    nodes: dict[str, NodeAlignment]
    refused: dict[str, str]
    """Nodes that the recording does not determine, or whose evidence contradicts it: why, and what to do."""
    joints: list[JointFinding]
    zero_pose_s: tuple[float, float]
    evidence: dict[str, list[CrossCheck]]
    """What was compared before the answer was believed, by node."""


def find_alignment(
    recordings: Mapping[str, NodeRecording],
    skeleton: Skeleton,
    zero_pose_s: tuple[float, float] | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> SuitAlignment:
    """The alignment of every node of the skeleton that was recorded.

    `recordings` are by segment; readings must be calibrated. Without `zero_pose_s` the first stretch in which
    everyone rests is the zero pose. Raises PoorMotionError where nothing at all can be said; what fails for
    single nodes is in `refused`. A node whose own readings contradict each other takes no part.
    """
    names = [name for name in skeleton.segment_names if name in recordings]
    if len(names) < 2:
        raise PoorMotionError(f"the recording has fewer than two nodes of the profile {skeleton.name}")
    evidence = {name: unit_evidence(recordings[name]) for name in names}
    contradicted = {name: e.advice for name in names if (e := first_contradiction(evidence[name]))}
    names = [name for name in names if name not in contradicted]
    if len(names) < 2:
        alone = dict.fromkeys(names, _ALONE)
        return SuitAlignment({}, contradicted | alone, [], (0.0, 0.0), evidence)
    suit = orient(recordings, names)
    if zero_pose_s is None:
        zero_pose = find_zero_pose(suit.gyr_rad_s, suit.rate_hz)
    else:
        zero_pose = given_zero_pose(*zero_pose_s, suit.q.shape[1], suit.rate_hz)
    units, spacing_s = moving(suit, zero_pose)
    wrong = _misplaced(skeleton, names, units, spacing_s, evidence)
    names = [name for name in names if name not in wrong]
    contradicted |= wrong
    if len(names) < 2:
        left = dict.fromkeys(names, _ALONE)
        return SuitAlignment({}, contradicted | left, [], _seconds(zero_pose, suit), evidence)
    at = dict(zip(suit.names, units, strict=True))
    suit = suit.some(names)
    joints = []
    pairs = _pairs(skeleton, names)
    for done, (parent, child) in enumerate(pairs):
        progress(done, len(pairs))
        joints.append(
            joint_motion(skeleton, skeleton.segment_names.index(child), at[parent], at[child], spacing_s)
        )
    progress(len(pairs), len(pairs))
    found = _by_sides(skeleton, suit, _assemble(skeleton, suit, zero_pose, joints), evidence)
    return replace(found, refused=contradicted | found.refused, evidence=evidence)


def _by_sides(
    skeleton: Skeleton, suit: Oriented, found: SuitAlignment, evidence: dict[str, list[CrossCheck]]
) -> SuitAlignment:
    """Nothing at all where left and right seem to be exchanged."""
    ends = {name: (node.heading_rad, node.q_sensor_from_segment) for name, node in found.nodes.items()}
    sides = check_sides(skeleton, suit, found.joints, ends)
    for name in found.nodes:
        evidence[name].append(sides)
    if not sides.contradicts:
        return found
    return replace(found, nodes={}, refused=found.refused | dict.fromkeys(found.nodes, sides.advice))


def _pairs(skeleton: Skeleton, names: Sequence[str]) -> list[tuple[str, str]]:
    """(parent, child) of every joint whose two segments were recorded."""
    return [(s.parent, s.name) for s in skeleton.segments if s.name in names and s.parent in names]


def _misplaced(
    skeleton: Skeleton,
    names: list[str],
    units: list[Moving],
    spacing_s: float,
    evidence: dict[str, list[CrossCheck]],
) -> dict[str, str]:
    """Nodes whose neighbours contradict them, and why: one that is late, or, of two exchanged, everyone.

    A late node fits its neighbours badly, so it may look exchanged: what explains more is the cause.
    """
    links = [(names.index(parent), names.index(child)) for parent, child in _pairs(skeleton, names)]
    lags = [joint_lag(units[parent], units[child], spacing_s) for parent, child in links]
    late = check_lags(names, links, lags)
    order = check_order(fit_pairs(names, units), links)
    if order.contradicts and (order.figure or 0.0) > sum(gain for _, gain in late.values()):
        for name in names:
            evidence[name].append(order)
        return dict.fromkeys(names, order.advice)
    for name in names:
        evidence[name].append(late[name][0])
    return {name: late[name][0].advice for name in names if late[name][0].contradicts}


def _seconds(zero_pose: slice, suit: Oriented) -> tuple[float, float]:
    return zero_pose.start / suit.rate_hz, zero_pose.stop / suit.rate_hz


def posture(suit: Oriented, alignment: SuitAlignment) -> Array:
    """Orientations (T, N, 4) of the segments over a recording, with the headings that its motion told."""
    out = [
        multiply(
            multiply(heading_turn(node.heading_rad), suit.q[suit.names.index(name)]),
            node.q_sensor_from_segment,
        )
        for name, node in alignment.nodes.items()
    ]
    return np.stack(out, axis=1)


def _assemble(
    skeleton: Skeleton, suit: Oriented, zero_pose: slice, joints: list[JointFinding]
) -> SuitAlignment:
    q_zero_pose = {name: mean_rotation(q[zero_pose]) for name, q in zip(suit.names, suit.q, strict=True)}
    islands = islands_of(suit.names, joints)
    nodes: dict[str, NodeAlignment] = {}
    refused: dict[str, str] = {}
    for island in islands:
        axes = axes_by_node(skeleton, suit, q_zero_pose, joints, island)
        facing = facing_of(axes)
        if facing is None:
            refused.update({name: _why(name, joints) for name in island})
            continue
        if not any(name in axes and other in axes for name, other in _other_side(skeleton).items()):
            lone = any(name in axes for name in _other_side(skeleton))
            facing = (facing[0], max(facing[1], _TURNED_RAD)) if lone else facing
        for name in island:
            node = _node(skeleton, name, q_zero_pose[name], island, axes, facing, joints)
            if node.sigma_rad > _WORST_FACING_RAD:
                refused[name] = (
                    f"which way it faced is only known to ± {math.degrees(node.sigma_rad):.0f}°: a person's "
                    "limb may be turned in or out. Bend elbows or knees of both sides ten times, and record "
                    "again"
                )
            else:
                nodes[name] = node
    limits = _seconds(zero_pose, suit)
    joints = [_with_flexion(skeleton, suit, joint, nodes) for joint in joints]
    return SuitAlignment(
        {name: nodes[name] for name in suit.names if name in nodes}, refused, joints, limits, {}
    )


def _other_side(skeleton: Skeleton) -> dict[str, str]:
    """Each segment of the left and the right that has its like on the other side."""
    names = skeleton.segment_names
    pairs = {n: n.replace("left_", "right_", 1) for n in names if n.startswith("left_")}
    pairs = {left: right for left, right in pairs.items() if right in names}
    return pairs | {right: left for left, right in pairs.items()}


def _node(
    skeleton: Skeleton,
    name: str,
    q_zero_pose: Array,
    island: Island,
    axes: dict[str, list[Axis]],
    facing: tuple[float, float],
    joints: list[JointFinding],
) -> NodeAlignment:
    """Its own axes' facing, else that of the segment it hangs on, else everyone's."""
    facing_rad, facing_sigma = facing
    offset, variance = island[name]
    source: str | None = name
    while source is not None and not axes.get(source):
        parent = skeleton.segments[skeleton.segment_names.index(source)].parent
        source = parent if parent in island else None
    if source is None:
        mine, sigma, told_by = facing_rad, facing_sigma, "the limbs' mean"
        if name in _other_side(skeleton):
            sigma = max(sigma, _TURNED_RAD)
    else:
        weights = [1.0 / a.sigma_rad**2 for a in axes[source]]
        mine = facing_rad + sum(
            w * math.remainder(a.facing_rad - facing_rad, 2.0 * math.pi)
            for w, a in zip(weights, axes[source], strict=True)
        ) / sum(weights)
        sigma = 1.0 / math.sqrt(sum(weights))
        told_by = "its own axis" if source == name else source
        if source != name:
            sigma = math.sqrt(sigma**2 + abs(variance - island[source][1]))
    tilt = None
    if source == name:
        tilts = [_tilt(skeleton, joints[a.joint], name, q_zero_pose) for a in axes[name]]
        tilt = max(tilts, key=abs)
    return NodeAlignment(
        multiply(conjugate(q_zero_pose), heading_turn(mine - offset)),
        sigma,
        tilt,
        math.remainder(offset - facing_rad, 2.0 * math.pi),
        told_by,
    )


def _tilt(skeleton: Skeleton, joint: JointFinding, name: str, q_zero_pose: Array) -> float:
    """How far the joint's axis is from level (or from where the skeleton has it) in the zero pose, rad."""
    assert joint.fit is not None
    assert joint.fit.axes is not None
    axis = joint.fit.axes[0 if name == joint.parent else 1]
    return math.asin(max(-1.0, min(1.0, float(rotate(q_zero_pose, axis)[2]))))


def _with_flexion(
    skeleton: Skeleton, suit: Oriented, joint: JointFinding, nodes: Mapping[str, NodeAlignment]
) -> JointFinding:
    if not joint.axes_known or joint.segment not in nodes or joint.parent not in nodes:
        return joint
    i = skeleton.segment_names.index(joint.segment)
    ends = {n: (nodes[n].heading_rad, nodes[n].q_sensor_from_segment) for n in (joint.parent, joint.segment)}
    angle = np.degrees(joint_angles(skeleton, suit, i, ends)[skeleton.segments[i].human.index(True)])
    low, high = np.quantile(angle, [0.05, 0.95]).tolist()
    return JointFinding(
        joint.segment, joint.parent, joint.kind, joint.fit, joint.refusal, joint.axes_known, (low, high)
    )


def _why(name: str, joints: list[JointFinding]) -> str:
    """The refusals of the joints at a node, or what no joint of it can tell."""
    reasons = [
        f"joint {j.segment} on {j.parent}: {j.refusal}"
        for j in joints
        if name in (j.segment, j.parent) and j.refusal is not None
    ]
    if reasons:
        return "; ".join(reasons)
    return "which way its axes point is not told: bend elbows, knees or fingers well away from straight"
