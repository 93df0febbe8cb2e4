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
    node_position_m: Array
    """(N, 3) that place itself."""


class Chain:
    """A skeleton's kinematics with its derivatives, over all segments at once.

    A segment turns about K axes in sequence (three, unless the robot has more joints there), so a skeleton of
    N segments is a tree of K N single rotations, here called turns. Angular velocities and accelerations add
    up along the way from the root, which makes each of them one product with a constant matrix of zeros and
    ones:

        ω = Σ a α̇                        over the turns up to and including the segment's own
        ω̇ = Σ a α̈ + ω_before × a α̇       the axis a is itself carried round by the turns before it
        p̈ = Σ ω̇ × r + ω × (ω × r)        over the links r, each rigid in the segment it starts from

    (the forward half of the recursive Newton-Euler method, Luh, Walker and Paul 1980, unrolled). It is
    exact, where a difference of positions would trade truncation against rounding.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        count = len(skeleton.segments)
        self._angles_from_joints = skeleton.angles_from_joints
        self._zero_rad = skeleton.zero_rad
        self._axes = skeleton.turn_axes[..., None]
        self._cross = _cross_matrices(self._axes[..., 0])
        self._cross_squared = self._cross @ self._cross
        self._along = np.eye(3) + self._cross_squared

        # row N of the arrays below is the world, which never moves
        parents = np.append(np.where(skeleton.parents < 0, count, skeleton.parents), count)
        self._parents = parents[:-1]
        self._jumps = _jumps(parents)
        self._links = np.zeros((count + 1, count))
        for i, parent in enumerate(self._parents):
            self._links[i] = self._links[parent]
            self._links[i, i] = 1.0
        self._turns = np.repeat(self._links, self._axes.shape[1], axis=1)

        # two levers a segment: the link from the parent's joint to its own, and from that to the node
        self._foot = np.append(self._parents, np.arange(count))
        levers = [s.origin_m for s in skeleton.segments] + [s.node_m for s in skeleton.segments]
        self._lever_m = np.array(levers)[..., None]

    def motion(self, position_rad: Array, velocity_rad_s: Array, acceleration_rad_s2: Array) -> ChainMotion:
        """Every segment's motion for joint positions, velocities and accelerations, (J,) each."""
        count, most = self._axes.shape[:2]
        joints = np.array([position_rad - self._zero_rad, velocity_rad_s, acceleration_rad_s2])
        angles, speeds, pushes = (self._angles_from_joints @ joints.T).T.reshape(3, count, most, 1)
        world, axes = self._rotations(angles)

        spin = axes * speeds
        rate = self._turns @ spin.reshape(-1, 3)
        # up to and with the turn itself, which adds nothing: a × a = 0
        carrying = np.cumsum(spin, axis=1) + rate.take(self._parents, axis=0)[:, None]
        swirl = axes * pushes + _cross(carrying, spin)
        rate_change = self._turns @ swirl.reshape(-1, 3)

        lever = (world.take(self._foot, axis=0) @ self._lever_m)[..., 0]
        carried = _carried(rate.take(self._foot, axis=0), rate_change.take(self._foot, axis=0), lever)
        node_acceleration = self._links[:-1] @ carried[:count] + carried[count:]
        node_position = self._links[:-1] @ lever[:count] + lever[count:]
        return ChainMotion(world[:-1], rate[:-1], node_acceleration, node_position)

    def _rotations(self, angles_rad: Array) -> tuple[Array, Array]:
        """World rotations (N + 1, 3, 3) and the turns' axes in the world (N, K, 3), for angles (N, K, 1)."""
        angles = angles_rad[..., None]
        # Rodrigues: I + sin K + (1 - cos) K²
        turns = np.sin(angles) * self._cross - np.cos(angles) * self._cross_squared + self._along
        axes = self._axes[..., 0].copy()
        turned = turns[:, 0]
        for k in range(1, axes.shape[1]):
            axes[:, k] = (turned @ self._axes[:, k])[..., 0]
            turned = turned @ turns[:, k]

        world = np.empty((len(turns) + 1, 3, 3))
        world[:-1] = turned
        world[-1] = np.eye(3)
        for ancestors in self._jumps:
            world = world.take(ancestors, axis=0) @ world
        # axes stand in rows: times the transposed rotation
        return world, axes @ world.take(self._parents, axis=0).swapaxes(-1, -2)


def _jumps(parents: Indices) -> list[Indices]:
    """Everyone's ancestor 1, 2, 4, … generations up, until all are the world.

    Composed in this order, each round doubles the generations that a rotation spans (pointer doubling).
    """
    jumps = []
    ancestors = parents
    while (ancestors < len(parents) - 1).any():
        jumps.append(ancestors)
        ancestors = ancestors[ancestors]
    return jumps


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
    along = np.einsum("ij,ij->i", rate, lever_m)[:, None]
    squared = np.einsum("ij,ij->i", rate, rate)[:, None]
    out: Array = _cross(rate_change, lever_m) + rate * along - lever_m * squared
    return out
