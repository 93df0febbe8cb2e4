"""What a skeleton is: a tree of segments, the angles between neighbours, and the joints that drive them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array

Point = tuple[float, float, float]

WORLD = "world"
"""The parent of a root segment: the ground, of which only the vertical is known."""


@dataclass(frozen=True, slots=True)
class Shape:
    """What a segment of the simulated robot is made of: bars with round ends, from its joint outwards."""

    radius_m: float | None = None
    """None: in proportion to its length."""
    fan: bool = False
    """A bar to each of its children's joints; otherwise one, to amid them."""
    tip_m: tuple[float, float, float] | None = None
    """Where a segment without children ends, in its own frame; None: twice as far down as its node."""


@dataclass(frozen=True, slots=True)
class Post:
    """One bar of what holds the simulated robot's root: from and to, world frame, and its radius."""

    from_m: tuple[float, float, float]
    to_m: tuple[float, float, float]
    radius_m: float


@dataclass(frozen=True, slots=True)
class RobotHinge:
    """One joint of a robot's own model, between a link and its parent."""

    name: str
    axis: Point
    """Unit vector, the link's frame."""
    anchor_m: Point = (0.0, 0.0, 0.0)
    """A point on the axis, the link's frame."""
    slides: bool = False
    """Moves along the axis, m; otherwise turns about it, rad."""


@dataclass(frozen=True, slots=True)
class Bar:
    """A capsule: all points within `radius_m` of the line between two points of a link's own frame."""

    from_m: Point
    to_m: Point
    radius_m: float


@dataclass(frozen=True, slots=True)
class RobotLink:
    """One rigid body of a robot's own model: where it hangs on its parent, and its shape."""

    name: str
    parent: str
    origin_m: Point
    q_parent_from_link: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """With all its hinges at 0."""
    hinges: tuple[RobotHinge, ...] = ()
    bars: tuple[Bar, ...] = ()


@dataclass(frozen=True, slots=True)
class Turn:
    """One of the rotations that take a segment's parent into the segment, in their order."""

    angle: str | None
    """None: a residual that no robot joint follows."""
    axis: Point
    """Unit vector, the parent's frame in the zero pose."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A body segment, which carries one node, and its joint with the neighbour it hangs on.

    `axes` are the three signed unit axes (rows, parent frame in zero pose) of the intrinsic rotation
    parent → segment; `angles` names the angle about each, None for a residual no robot joint follows.
    `human` tells about which of them the person's own joint turns: what does not turn constrains the two
    nodes on either side of the joint.
    """

    name: str
    parent: str
    axes: tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]
    angles: tuple[str | None, str | None, str | None]
    origin_m: tuple[float, float, float]
    node_m: tuple[float, float, float]
    human: tuple[bool, bool, bool] = (True, True, True)
    shape: Shape = Shape()
    group: str | None = None
    """Name of the joint group that begins here (`groups.py`); None: if one begins, the segment's name."""
    link: str | None = None
    """The link of the robot's own model that follows the segment; None: the segment is its own."""
    chain: tuple[Turn, ...] | None = None
    """How that link turns relative to the parent's: all hinges between the two; None: `axes`, `angles`."""

    @property
    def turns(self) -> tuple[Turn, ...]:
        """The robot's rotations that take the parent into the segment."""
        if self.chain is not None:
            return self.chain
        return tuple(Turn(angle, axis) for angle, axis in zip(self.angles, self.axes, strict=True))


@dataclass(frozen=True, slots=True)
class Joint:
    """A robot joint, its limits, and the segment angles that follow it, each with its ratio."""

    name: str
    lower_rad: float
    upper_rad: float
    max_velocity_rad_s: float
    max_acceleration_rad_s2: float
    drives: dict[str, float]
    zero_rad: float = 0.0
    """Its position in the operator's zero pose."""
    hinges: dict[str, float] | None = None
    """The hinges of the robot's own model that it moves, each with its ratio; None: as in `drives`."""

    @property
    def moves(self) -> dict[str, float]:
        """The hinges of the slave's model that it moves, each with its ratio."""
        return self.drives if self.hinges is None else self.hinges


@dataclass(frozen=True, slots=True)
class Synergy:
    """A joint of a coarser robot that stands for several joints here, each with its ratio to it."""

    name: str
    drives: dict[str, float]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """One robot's table, compared by identity.

    Node arrays are in the order of `segments`, joint arrays in that of `joints`.
    """

    name: str
    segments: tuple[Segment, ...]
    joints: tuple[Joint, ...]
    synergies: tuple[Synergy, ...] = ()
    stand: tuple[Post, ...] = ()
    own_links: tuple[RobotLink, ...] = ()
    """The bodies of the robot's own model; none: the segments are its bodies."""
    model: Path | None = None
    """The file of that model (MJCF), which the slave simulates."""
    unconfirmed: tuple[str, ...] = ()
    """What an import guessed and nobody has confirmed yet."""

    @cached_property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments (and of their nodes), in order."""
        return tuple(s.name for s in self.segments)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(j.name for j in self.joints)

    @cached_property
    def parents(self) -> NDArray[np.intp]:
        """Index of each segment's parent, (N,); -1 for the world. A parent stands before its children."""
        index = {name: i for i, name in enumerate(self.segment_names)}
        return np.array([index.get(s.parent, -1) for s in self.segments], dtype=np.intp)

    @cached_property
    def axis_frames(self) -> Array:
        """(N, 3, 3) proper rotations whose columns are a1, a2, a1 × a2 of each segment's `axes`.

        In these frames every segment's rotation is the plain intrinsic x-y-z one, the third angle
        times `axis_handedness`.
        """
        a = np.array([s.axes for s in self.segments], dtype=np.float64)
        return np.stack([a[:, 0], a[:, 1], np.cross(a[:, 0], a[:, 1])], axis=-1)

    @cached_property
    def axis_handedness(self) -> Array:
        """(N,): +1 where a3 = a1 × a2, -1 where a3 is its opposite."""
        a = np.array([s.axes for s in self.segments], dtype=np.float64)
        out: Array = np.sum(np.cross(a[:, 0], a[:, 1]) * a[:, 2], axis=-1)
        return out

    @cached_property
    def plain(self) -> bool:
        """Whether every segment turns about its `axes` and stands at 0 in the zero pose."""
        return all(s.chain is None for s in self.segments) and not self.zero_rad.any()

    @cached_property
    def turn_axes(self) -> Array:
        """(N, K, 3) unit axes of each segment's `turns`; where it has fewer than K, zeros follow."""
        most = max(len(s.turns) for s in self.segments)
        out = np.zeros((len(self.segments), most, 3))
        for i, segment in enumerate(self.segments):
            for k, turn in enumerate(segment.turns):
                out[i, k] = turn.axis
        return out

    @cached_property
    def angle_slots(self) -> dict[str, tuple[int, int]]:
        """Where each named angle lives: (segment index, place in its `turns`)."""
        return {
            t.angle: (i, k) for i, s in enumerate(self.segments) for k, t in enumerate(s.turns) if t.angle
        }

    @cached_property
    def zero_rad(self) -> Array:
        """Positions in the operator's zero pose, (J,)."""
        return np.array([j.zero_rad for j in self.joints])

    @cached_property
    def lower_rad(self) -> Array:
        """Lower position limits, (J,)."""
        return np.array([j.lower_rad for j in self.joints])

    @cached_property
    def upper_rad(self) -> Array:
        """Upper position limits, (J,)."""
        return np.array([j.upper_rad for j in self.joints])

    @cached_property
    def max_velocity_rad_s(self) -> Array:
        """Velocity limits, (J,)."""
        return np.array([j.max_velocity_rad_s for j in self.joints])

    @cached_property
    def max_acceleration_rad_s2(self) -> Array:
        """Acceleration limits, (J,)."""
        return np.array([j.max_acceleration_rad_s2 for j in self.joints])

    @cached_property
    def angles_from_joints(self) -> Array:
        """Ratios (K N, J): angle `K * segment + place` of every segment, for positions less `zero_rad`."""
        most = self.turn_axes.shape[1]
        ratios = np.zeros((most * len(self.segments), len(self.joints)))
        for j, joint in enumerate(self.joints):
            for angle, ratio in joint.drives.items():
                segment, place = self.angle_slots[angle]
                ratios[most * segment + place, j] = ratio
        return ratios

    @cached_property
    def joints_from_angles(self) -> Array:
        """Weights (J, K N), the least-squares inverse of `angles_from_joints`: θ = Σ c α / Σ c²."""
        ratios = self.angles_from_joints
        out: Array = (ratios / np.sum(ratios**2, axis=0)).T
        return out

    @cached_property
    def joint_needs_node(self) -> NDArray[np.bool_]:
        """(J, N): True where a joint's angle needs that node (the segment's own or its parent's)."""
        needs = np.zeros((len(self.joints), len(self.segments)), dtype=np.bool_)
        for j, joint in enumerate(self.joints):
            for angle in joint.drives:
                segment, _ = self.angle_slots[angle]
                needs[j, segment] = True
                if self.parents[segment] >= 0:
                    needs[j, self.parents[segment]] = True
        return needs
