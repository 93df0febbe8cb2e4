"""How a posture in motion moves every segment: exact first and second derivatives of the kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class ChainMotion:
    """Motion of N segments in world coordinates at one instant."""

    world_from_segment: Array
    """(N, 3, 3) rotation matrices."""
    rate_rad_s: Array
    """(N, 3) angular velocity."""
    node_acceleration_m_s2: Array
    """(N, 3) linear acceleration of the place where the node sits (`node_m`), gravity not included."""


class Chain:
    """A skeleton's kinematics with its derivatives, over all segments at once.

    A segment turns about three axes in sequence, so a skeleton of N segments is a tree of 3 N single
    rotations, here called turns. Angular velocities and accelerations add up along the way from the root,
    which makes each of them one product with a constant matrix of zeros and ones:

        ω = Σ a α̇                        over the turns up to and including the segment's own
        ω̇ = Σ a α̈ + ω_before × a α̇       the axis a is itself carried round by the turns before it
        p̈ = Σ ω̇ × r + ω × (ω × r)        over the links r, each rigid in the segment it starts from

    (the forward half of the recursive Newton-Euler method, Luh, Walker and Paul 1980, unrolled). It is
    exact, where a difference of positions would trade truncation against rounding.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        count = len(skeleton.segments)
        self._angles_from_joints = skeleton.angles_from_joints
        self._axes = np.array([s.axes for s in skeleton.segments], dtype=np.float64)
        self._cross = _cross_matrices(self._axes)
        self._cross_squared = self._cross @ self._cross
        self._parents = skeleton.parents
        self._generations = _generations(skeleton)
        self._origin_m = np.array([s.origin_m for s in skeleton.segments])[:, :, None]
        self._node_m = np.array([s.node_m for s in skeleton.segments])[:, :, None]

        self._links = np.eye(count)
        for i, parent in enumerate(skeleton.parents):
            if parent >= 0:
                self._links[i] += self._links[parent]
        self._turns = np.repeat(self._links, 3, axis=1)
        within = np.kron(np.eye(count), np.tri(3, k=-1))
        above = np.repeat(np.repeat(self._links - np.eye(count), 3, axis=0), 3, axis=1)
        self._turns_before = above + within

    def motion(self, position_rad: Array, velocity_rad_s: Array, acceleration_rad_s2: Array) -> ChainMotion:
        """Every segment's motion for joint positions, velocities and accelerations, (J,) each."""
        angles = self._angles_from_joints @ np.stack(
            [position_rad, velocity_rad_s, acceleration_rad_s2], axis=-1
        )
        world, axes = self._rotations(angles[:, 0].reshape(-1, 3))
        spin = axes * angles[:, 1, None]
        rate = _with_world(self._turns @ spin)
        swirl = axes * angles[:, 2, None] + _cross(self._turns_before @ spin, spin)
        rate_change = _with_world(self._turns @ swirl)

        parents = self._parents
        link = (world[parents] @ self._origin_m)[..., 0]
        place = (world[:-1] @ self._node_m)[..., 0]
        joint_acceleration = self._links @ _carried(rate[parents], rate_change[parents], link)
        node_acceleration = joint_acceleration + _carried(rate[:-1], rate_change[:-1], place)
        return ChainMotion(world[:-1], rate[:-1], node_acceleration)

    def _rotations(self, angles_rad: Array) -> tuple[Array, Array]:
        """World rotations (N + 1, 3, 3), the world's own last; axes of the turns (3 N, 3) in the world."""
        sine = np.sin(angles_rad)[..., None, None]
        versine = (1.0 - np.cos(angles_rad))[..., None, None]
        turns = sine * self._cross + versine * self._cross_squared
        turns[..., [0, 1, 2], [0, 1, 2]] += 1.0
        first, second, third = turns[:, 0], turns[:, 1], turns[:, 2]
        two = first @ second
        segment = two @ third

        axes = self._axes[..., None].copy()
        axes[:, 1] = first @ axes[:, 1]
        axes[:, 2] = two @ axes[:, 2]

        # row -1 is the world, so the parent index -1 of a root finds it without a special case
        world = np.empty((len(segment) + 1, 3, 3))
        world[-1] = np.eye(3)
        for rows, parents in self._generations:
            world[rows] = world[parents] @ segment[rows]
        return world, (world[self._parents][:, None] @ axes).reshape(-1, 3)


def _generations(skeleton: Skeleton) -> list[tuple[Indices, Indices]]:
    """Segments that are equally far from the world, with their parents, nearest first."""
    depth = np.zeros(len(skeleton.segments), dtype=int)
    for i, parent in enumerate(skeleton.parents):
        depth[i] = 0 if parent < 0 else depth[parent] + 1
    rows = [np.flatnonzero(depth == d) for d in range(depth.max() + 1)]
    return [(r, skeleton.parents[r]) for r in rows]


def _cross_matrices(v: Array) -> Array:
    """Matrices (..., 3, 3) that multiply as v × does."""
    out = np.zeros((*v.shape, 3))
    x, y, z = np.moveaxis(v, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


_YZX = np.array([1, 2, 0])


def _cross(a: Array, b: Array) -> Array:
    """The product a × b over the last axis; np.cross takes four times as long on arrays this small."""
    out: Array = (a * b.take(_YZX, axis=-1) - a.take(_YZX, axis=-1) * b).take(_YZX, axis=-1)
    return out


def _carried(rate: Array, rate_change: Array, lever_m: Array) -> Array:
    """Acceleration of a lever's tip against its foot: tangential ω̇ × r and centripetal ω × (ω × r)."""
    along = np.sum(rate * lever_m, axis=-1, keepdims=True)
    squared = np.sum(rate * rate, axis=-1, keepdims=True)
    out: Array = _cross(rate_change, lever_m) + rate * along - lever_m * squared
    return out


def _with_world(values: Array) -> Array:
    """One more row of zeros at the end: the world stands still."""
    out = np.zeros((len(values) + 1, 3))
    out[:-1] = values
    return out
