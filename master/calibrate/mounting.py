"""How each unit sits on its segment, from a stance in the zero pose and a motion, with no magnetometer.

The stance says where up is in every unit. That leaves one angle a unit open: which way its segment faced, in
the unit's own earth frame. Two things tell it (`joint_fit.py`):

- an axis of a joint that lies level in the zero pose (elbow, knee, finger): the table says which way it then
  points, so both units at a hinge know by themselves how they sit;
- the heading offset between neighbours: with it chest, head and hands, which have no such axis, face as the
  limbs do. Limbs left and right are turned in or out alike, so that their mean faces ahead.

The sign of an axis is the one by which the joint bends within its limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from common.quaternion import (
    Array,
    conjugate,
    heading_turn,
    multiply,
    rotate,
    to_matrix,
)
from common.skeleton import Skeleton
from master.calibrate.hinge import PoorMotionError
from master.calibrate.joint_fit import JointFit, Moving, fit_joint
from master.calibrate.oriented import Oriented, mean_rotation, moving, orient, rows_moving
from master.calibrate.recording import NodeRecording
from master.calibrate.standing import find_stance, given_stance
from master.solve.angles import intrinsic_angles

_LEVEL = 0.5
"""Sine of the steepest axis that still has a heading."""
_WORST_AXIS_RAD = math.radians(6.0)
_WORST_OFFSET_RAD = math.radians(8.0)
_WORST_RIVAL = 1.15
_LEAST_SAMPLES = 60
_PLAIN_RAD = math.radians(1.5)
"""Mean excess over the limits by which the wrong sign of an axis is told."""
_AXIS_FLOOR_RAD = math.radians(1.0)
"""No axis of a person is known better."""
_ONE_LIMB_RAD, _PAIR_RAD = math.radians(15.0), math.radians(8.0)
"""How far a person's limb, or the mean of a pair of them, faces from ahead in the stance."""


@dataclass(frozen=True, slots=True)
class JointMotion:
    """What the motion told about one joint."""

    segment: str
    """The child's name."""
    parent: str
    kind: str
    """`hinge`, `two axes` or `ball`."""
    fit: JointFit | None
    """None: there was nothing to fit."""
    refusal: str | None
    """Why its heading offset is not used, and what to do; None where it is."""
    axes_known: bool
    """Whether its axes are used."""
    flexion_deg: tuple[float, float] | None = None
    """5th and 95th percentile of its first angle over the motion, where its axes are used."""


@dataclass(frozen=True, slots=True)
class NodeMounting:
    """One unit's answer."""

    q_sensor_from_segment: Array
    """(4,)."""
    sigma_rad: float
    """One standard deviation of the angle about the long axis; the stance itself is not in it."""
    tilt_rad: float | None
    """How far its own axis was from level in the stance; None where it has none."""
    heading_rad: float
    """Turns the unit's own earth frame into the common one, in which the person faces east in the stance."""
    told_by: str
    """Its own joint's axis, or the segment whose facing it shares."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """The whole suit's answer."""

    nodes: dict[str, NodeMounting]
    refused: dict[str, str]
    """Nodes that the recording does not determine: why, and what to do."""
    joints: list[JointMotion]
    stance_s: tuple[float, float]


def find_mounting(
    recordings: Mapping[str, NodeRecording],
    skeleton: Skeleton,
    stance_s: tuple[float, float] | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Mounting:
    """The mounting of every node of the skeleton that was recorded.

    `recordings` are by segment; readings must be calibrated. Without `stance_s` the first stretch in which
    everyone rests is the stance. Raises PoorMotionError where nothing at all can be said; what fails for
    single nodes is in `refused`.
    """
    names = [name for name in skeleton.segment_names if name in recordings]
    if len(names) < 2:
        raise PoorMotionError(f"the recording has fewer than two nodes of the profile {skeleton.name}")
    suit = orient(recordings, names)
    if stance_s is None:
        stance = find_stance(suit.gyr_rad_s, suit.rate_hz)
    else:
        stance = given_stance(*stance_s, suit.q.shape[1], suit.rate_hz)
    units, spacing_s = moving(suit, stance)
    pairs = [(i, skeleton.segments[i].parent) for i, n in enumerate(skeleton.segment_names) if n in names]
    pairs = [(i, parent) for i, parent in pairs if parent in names]
    joints = []
    for done, (i, parent) in enumerate(pairs):
        progress(done, len(pairs))
        child = skeleton.segment_names[i]
        joints.append(_fit(skeleton, i, units[names.index(parent)], units[names.index(child)], spacing_s))
    progress(len(pairs), len(pairs))
    return _assemble(skeleton, suit, stance, joints)


def posture(suit: Oriented, mounting: Mounting) -> Array:
    """Orientations (T, N, 4) of the segments over a recording, with the headings that its motion told."""
    out = [
        multiply(
            multiply(heading_turn(node.heading_rad), suit.q[suit.names.index(name)]),
            node.q_sensor_from_segment,
        )
        for name, node in mounting.nodes.items()
    ]
    return np.stack(out, axis=1)


def zero_axes(skeleton: Skeleton, segment: int) -> list[Array] | None:
    """The axes that constrain a joint, in the zero pose: one of a hinge, two of two axes, None of a ball."""
    entry = skeleton.segments[segment]
    moved = [
        np.asarray(a, dtype=np.float64) for a, turns in zip(entry.axes, entry.human, strict=True) if turns
    ]
    return moved if len(moved) in (1, 2) else None


def _fit(skeleton: Skeleton, i: int, parent: Moving, child: Moving, spacing_s: float) -> JointMotion:
    entry = skeleton.segments[i]
    axes = zero_axes(skeleton, i)
    kind = "ball" if axes is None else ("hinge", "two axes")[len(axes) - 1]
    rows = rows_moving(parent, child)
    ask = _ask(kind, entry.name, entry.parent)
    if len(rows) < _LEAST_SAMPLES:
        return JointMotion(entry.name, entry.parent, kind, None, f"it hardly moved; {ask}", False)
    fit = fit_joint(parent.some(rows), child.some(rows), axes, spacing_s)
    refusal = None
    if fit.offset_sigma_rad > _WORST_OFFSET_RAD:
        refusal = f"heading only known to ± {math.degrees(fit.offset_sigma_rad):.0f}°; {ask}"
    elif fit.rival < _WORST_RIVAL:
        refusal = f"another heading explains the motion as well; {ask}"
    known = (
        axes is not None
        and refusal is None
        and max(fit.axis_sigma_rad) < _WORST_AXIS_RAD
        and fit.axis_rival > _WORST_RIVAL
    )
    return JointMotion(entry.name, entry.parent, kind, fit, refusal, known)


def _ask(kind: str, segment: str, parent: str) -> str:
    if kind == "ball":
        return f"walk some steps, bow briskly and turn, and move {segment} against {parent} meanwhile"
    return f"bend {segment} against {parent} ten times while the whole limb moves about"


@dataclass(slots=True)
class _Axis:
    """A level axis: which way the zero pose faces by it, in the common frame of its island."""

    joint: int
    facing_rad: float
    sigma_rad: float
    told: bool
    """False: its sign is open, the facing may be half a turn off."""


def _assemble(skeleton: Skeleton, suit: Oriented, stance: slice, joints: list[JointMotion]) -> Mounting:
    q_stance = {name: mean_rotation(q[stance]) for name, q in zip(suit.names, suit.q, strict=True)}
    islands = _islands(suit.names, joints)
    nodes: dict[str, NodeMounting] = {}
    refused: dict[str, str] = {}
    for island in islands:
        axes = _axes(skeleton, suit, q_stance, joints, island)
        facing = _facing(axes)
        if facing is None:
            refused.update({name: _why(name, joints) for name in island})
            continue
        for name in island:
            nodes[name] = _node(skeleton, name, q_stance[name], island, axes, facing, joints)
    limits = (stance.start / suit.rate_hz, stance.stop / suit.rate_hz)
    joints = [_with_flexion(skeleton, suit, joint, nodes) for joint in joints]
    return Mounting({name: nodes[name] for name in suit.names if name in nodes}, refused, joints, limits)


Island = dict[str, tuple[float, float]]
"""Nodes whose headings are known against each other: offset into the island's frame, and its variance."""


def _islands(names: tuple[str, ...], joints: list[JointMotion]) -> list[Island]:
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


def _axes(
    skeleton: Skeleton,
    suit: Oriented,
    q_stance: dict[str, Array],
    joints: list[JointMotion],
    island: Island,
) -> dict[str, list[_Axis]]:
    """Every node's own level axes, by node, with their signs."""
    out: dict[str, list[_Axis]] = {}
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
                there = rotate(multiply(heading_turn(island[name][0]), q_stance[name]), axis)
                facing = _heading(there) - _heading(zero_axis)
                found.append((name, _Axis(number, facing, math.hypot(sigma, _AXIS_FLOOR_RAD), True)))
        if not found:
            continue
        # both ends of a joint share one sign: as its angle stays within its limits
        lead = found[0][1].facing_rad
        excess = [_excess(skeleton, suit, i, joint, q_stance, island, lead + turn) for turn in (0.0, math.pi)]
        flip = math.pi if excess[1] < excess[0] else 0.0
        told = abs(excess[1] - excess[0]) > _PLAIN_RAD
        for name, axis_found in found:
            facing = axis_found.facing_rad
            if math.cos(facing - lead) < 0.0:
                facing += math.pi
            axis_found.facing_rad, axis_found.told = facing + flip, told
            out.setdefault(name, []).append(axis_found)
    return out


def _excess(
    skeleton: Skeleton,
    suit: Oriented,
    i: int,
    joint: JointMotion,
    q_stance: dict[str, Array],
    island: Island,
    facing_rad: float,
) -> float:
    """By how much, rad on average, the joint's bending is beyond its limits if the zero pose faced so."""
    entry = skeleton.segments[i]
    first = entry.human.index(True)
    limits = _limits(skeleton, entry.angles[first])
    if limits is None:
        return 0.0
    turns = {name: facing_rad - island[name][0] for name in (joint.parent, joint.segment)}
    angle = _angles(skeleton, suit, i, {
        name: (island[name][0], multiply(conjugate(q_stance[name]), heading_turn(turn)))
        for name, turn in turns.items()
    })[first]  # fmt: skip
    return float(np.mean(np.maximum(limits[0] - angle, 0.0) + np.maximum(angle - limits[1], 0.0)))


def _angles(skeleton: Skeleton, suit: Oriented, i: int, ends: Mapping[str, tuple[float, Array]]) -> Array:
    """Intrinsic angles (3, K) of a joint at some 20 Hz, for heading and mounting by name."""
    entry = skeleton.segments[i]
    step = max(1, round(suit.rate_hz / 20.0))
    q = [
        multiply(multiply(heading_turn(ends[n][0]), suit.q[suit.names.index(n)][::step]), ends[n][1])
        for n in (entry.parent, entry.name)
    ]
    frame = skeleton.axis_frames[i]
    angles = intrinsic_angles(frame.T @ to_matrix(multiply(conjugate(q[0]), q[1])) @ frame)
    angles[2] *= skeleton.axis_handedness[i]
    return angles


def _limits(skeleton: Skeleton, angle: str | None) -> tuple[float, float] | None:
    for joint in skeleton.joints:
        if angle is not None and angle in joint.drives:
            ends = sorted(joint.drives[angle] * limit for limit in (joint.lower_rad, joint.upper_rad))
            return ends[0], ends[1]
    return None


def _facing(axes: dict[str, list[_Axis]]) -> tuple[float, float] | None:
    """Which way the person faced in the stance, and its standard deviation; settles signs that were open.

    Limbs are turned in or out alike on both sides: a pair of limbs says more than either.
    """
    every = [axis for mine in axes.values() for axis in mine]
    told = [axis.facing_rad for axis in every if axis.told]
    if not told:
        return None
    about = _mean_angle(told)
    for axis in every:
        if not axis.told and math.cos(axis.facing_rad - about) < 0.0:
            axis.facing_rad += math.pi
    by_segment = {name: _mean_angle([a.facing_rad for a in mine]) for name, mine in axes.items()}
    pairs = [
        _mean_angle([facing, by_segment[other]])
        for name, facing in by_segment.items()
        if name.startswith("left_") and (other := name.replace("left_", "right_", 1)) in by_segment
    ]
    single = _ONE_LIMB_RAD if not pairs else _PAIR_RAD
    said = pairs or list(by_segment.values())
    facing = _mean_angle(said)
    spread = math.sqrt(sum(math.remainder(s - facing, 2.0 * math.pi) ** 2 for s in said) / len(said))
    return facing, max(single, spread) / math.sqrt(len(said))


def _mean_angle(angles_rad: list[float]) -> float:
    return math.atan2(sum(map(math.sin, angles_rad)), sum(map(math.cos, angles_rad)))


def _node(
    skeleton: Skeleton,
    name: str,
    q_stance: Array,
    island: Island,
    axes: dict[str, list[_Axis]],
    facing: tuple[float, float],
    joints: list[JointMotion],
) -> NodeMounting:
    """Its own axes' facing, else that of the segment it hangs on, else everyone's."""
    facing_rad, facing_sigma = facing
    offset, variance = island[name]
    source: str | None = name
    while source is not None and not axes.get(source):
        parent = skeleton.segments[skeleton.segment_names.index(source)].parent
        source = parent if parent in island else None
    if source is None:
        mine, sigma, told_by = facing_rad, facing_sigma, "the limbs' mean"
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
        tilts = [_tilt(skeleton, joints[a.joint], name, q_stance) for a in axes[name]]
        tilt = max(tilts, key=abs)
    return NodeMounting(
        multiply(conjugate(q_stance), heading_turn(mine - offset)),
        sigma,
        tilt,
        math.remainder(offset - facing_rad, 2.0 * math.pi),
        told_by,
    )


def _tilt(skeleton: Skeleton, joint: JointMotion, name: str, q_stance: Array) -> float:
    """How far the joint's axis is from level (or from where the zero pose has it) in the stance, rad."""
    assert joint.fit is not None
    assert joint.fit.axes is not None
    axis = joint.fit.axes[0 if name == joint.parent else 1]
    return math.asin(max(-1.0, min(1.0, float(rotate(q_stance, axis)[2]))))


def _with_flexion(
    skeleton: Skeleton, suit: Oriented, joint: JointMotion, nodes: Mapping[str, NodeMounting]
) -> JointMotion:
    if not joint.axes_known or joint.segment not in nodes or joint.parent not in nodes:
        return joint
    i = skeleton.segment_names.index(joint.segment)
    ends = {n: (nodes[n].heading_rad, nodes[n].q_sensor_from_segment) for n in (joint.parent, joint.segment)}
    angle = np.degrees(_angles(skeleton, suit, i, ends)[skeleton.segments[i].human.index(True)])
    low, high = np.quantile(angle, [0.05, 0.95]).tolist()
    return JointMotion(
        joint.segment, joint.parent, joint.kind, joint.fit, joint.refusal, joint.axes_known, (low, high)
    )


def _why(name: str, joints: list[JointMotion]) -> str:
    """The refusals of the joints at a node, or what no joint of it can tell."""
    reasons = [
        f"joint {j.segment} on {j.parent}: {j.refusal}"
        for j in joints
        if name in (j.segment, j.parent) and j.refusal is not None
    ]
    if reasons:
        return "; ".join(reasons)
    return "which way its axes point is not told: bend elbows, knees or fingers well away from straight"


def _heading(v: Array) -> float:
    return math.atan2(v[1], v[0])
