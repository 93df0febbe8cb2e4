"""The nearest posture of any robot: least squares over its joints, whatever their number, order and axes.

`follower.py` needs segments that turn about x, y and z, each once, and then has closed formulas. There are
none for a shoulder that turns z-y-z, for a tilted axis, or for more joints between two segments than three.
Here the angle between each segment's rotation and the operator's is minimised over all joints within their
limits. As there, each segment is followed relative to its neighbour, so that nothing is handed on.

    minimise ½ Σ ‖r_s(θ)‖²,   r_s = log(wanted_s R_s(θ)⁻¹),   lower ≤ θ ≤ upper

by Levenberg's and Marquardt's steps with an active set: ∂r_s/∂θ is minus the hinges' axes as they stand. The
damping is in proportion to what is left, ‖r‖² (Fan and Yuan 2005): steps stay bounded beside a singularity,
and convergence is quadratic where the posture can be reached. Each solution begins at the one before, which
keeps it on its branch; another branch is taken where it is nearer by far.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.quaternion import IDENTITY, Array, conjugate, multiply, rotate, to_rotation_vector
from common.reach.choice import MOST_GAIN
from common.reach.follower import FORGOTTEN_S, NOMINAL_S, turned
from common.reach.step import farthest_turn
from common.skeleton import WORLD, Skeleton
from common.wire.messages import Mask

_STEPS, _STEPS_ANEW = 5, 30
_SEEDS = 15
"""Postures from which a search begins when there is none before: what one of them misses another finds."""
_SAME_RAD = 1e-10
_LEAST_DAMPING, _DAMPING = 1e-9, 0.05
_LONGEST_STEP_RAD = 0.5
_MUCH_RAD = np.radians(10.0)
"""A segment that is left by more is looked at anew; a branch that is nearer by more is taken."""
_LOOKED_EVERY = 5
_ALIKE_RAD = 0.02
"""Of branches as near as this the first seed's is taken, the one next to the zero pose."""


class ChainFollower:
    """A robot's limits, and the posture it was last given. Its methods are those of `PostureFollower`."""

    def __init__(
        self, skeleton: Skeleton, lower_rad: Array, upper_rad: Array, *, spread: bool = False
    ) -> None:
        """For joint limits (J,), rad.

        `spread`: other branches are looked for over five postures, so that none takes long. Until then the
        branch next to the zero pose, or the one so far, is followed.
        """
        self._steps_a_call = _STEPS_ANEW // _LOOKED_EVERY if spread else _STEPS_ANEW
        self._first_steps = 2 * _STEPS if spread else _STEPS_ANEW
        count, most = skeleton.turn_axes.shape[:2]
        joints = len(skeleton.joints)
        self._lower, self._upper, self._zero = lower_rad.copy(), upper_rad.copy(), skeleton.zero_rad
        self._axes = skeleton.turn_axes
        self._ratios = skeleton.angles_from_joints
        self._ratio_of = self._ratios.reshape(count, most, joints)
        self._turns: Mask = (self._ratio_of != 0.0).any(axis=1)
        """(N, J): whether the joint turns the segment."""
        self._follows = self._turns.any(axis=1)
        self._roots = [i for i, s in enumerate(skeleton.segments) if s.parent == WORLD and self._follows[i]]
        self._part_of_joint, self._part_of_segment = _parts(self._turns)
        self._seeds = _seeds(self._zero, self._lower, self._upper)
        self._found, self._last = np.full((2, joints), np.nan)
        self._last_q = np.full((count, 4), np.nan)
        self._since_looked = 0
        self._tried: Array | None = None
        """(S, J) where the search from each seed is; None: no search is under way."""
        self._looks_at: Mask = np.zeros(joints, np.bool_)
        self._gain, self._steps_left = 0.0, 0
        self.short_rad: Array = np.zeros(count)
        """(N,) what the robot cannot follow of each segment: the angle from the robot's posture to theirs."""

    def forget(self) -> None:
        """The next posture has nothing to do with those before: it becomes the nearest there is."""
        self._found[:] = self._last[:] = np.nan
        self._tried = None

    def joints_beside(self, joints: Mask) -> Mask:
        """Those (J,) that turn a segment together with one of `joints` (J,), these included."""
        out: Mask = np.isin(self._part_of_joint, self._part_of_joint[joints])
        return out

    def follow(self, q: Array, q_rate: Array, elapsed_s: float = NOMINAL_S) -> tuple[Array, Array]:
        """Joint positions (J,) rad, all within limits, and velocities (J,) rad/s.

        As `PostureFollower.follow`: of the segments' rotations relative to their neighbours, parent from
        segment (N, 4), and their derivatives (N, 4) 1/s.
        """
        if not 0.0 < elapsed_s <= FORGOTTEN_S:
            self.forget()
            elapsed_s = NOMINAL_S
        known: Mask = np.isfinite(np.concatenate([q, q_rate], axis=1)).all(axis=1)
        lost: Mask = np.asarray(self._turns[~known].any(axis=0))
        weight = (known & self._follows).astype(np.float64)
        wanted = np.where(known[:, None], q, IDENTITY)
        self._search(wanted, weight, lost)
        found = self._found
        left, columns = self._left(found[None], wanted, weight)
        self.short_rad = np.linalg.norm(left[0], axis=-1)
        # 2 q' = ω ⊗ q, with ω in the parent's frame
        rate = 2.0 * multiply(np.where(known[:, None], q_rate, 0.0), conjugate(wanted))[:, 1:]
        velocity = self._velocity(columns[0], rate * weight[:, None])
        most = farthest_turn(turned(self._last_q, wanted), elapsed_s)
        fastest = 2.0 * MOST_GAIN * np.linalg.norm(q_rate, axis=1)
        position, velocity = self._bounded(velocity, most, np.nan_to_num(fastest), elapsed_s)
        position[lost] = velocity[lost] = np.nan
        self._found[lost] = np.nan
        self._last, self._last_q = position.copy(), np.where(known[:, None], q, np.nan)
        return position, velocity

    def _search(self, wanted: Array, weight: Array, lost: Mask) -> None:
        """Put the nearest posture (J,) into `_found`."""
        fresh: Mask = ~np.isfinite(self._found)
        if fresh.any():
            start = np.where(fresh, self._seeds[0], self._found)
            self._found = self._solve(start[None], wanted, weight, self._first_steps)[0]
            # where the first seed's branch is as near as any can be, the others need not be tried
            unsettled = self._costs(self._found[None], wanted, weight)[0] >= _ALIKE_RAD
            self._since_looked = 0
            self._look_among(fresh & ~lost & unsettled[self._part_of_joint], _ALIKE_RAD)
            if self._first_steps < _STEPS_ANEW:
                return  # the search begins with the next posture
        else:
            self._found = self._solve(self._found[None], wanted, weight, _STEPS)[0]
            self._since_looked += 1
            if self._tried is None and self._since_looked >= _LOOKED_EVERY:
                far = np.linalg.norm(self._left(self._found[None], wanted, weight)[0][0], axis=-1) > _MUCH_RAD
                self._look_among(np.isin(self._part_of_joint, self._part_of_segment[far]), _MUCH_RAD)
        if self._tried is not None:
            self._look(wanted, weight, lost)

    def _look_among(self, joints: Mask, gain: float) -> None:
        """Begin to look for another branch of these joints' parts (J,), to be taken if nearer by `gain`."""
        self._tried = np.where(joints, self._seeds, self._found) if joints.any() else None
        self._looks_at, self._gain, self._steps_left = joints, gain, _STEPS_ANEW

    def _look(self, wanted: Array, weight: Array, lost: Mask) -> None:
        """Go on with the search from all seeds; at its end take the branches that are nearer."""
        assert self._tried is not None
        tried = self._tried = self._solve(self._tried, wanted, weight, self._steps_a_call)
        self._steps_left -= self._steps_a_call
        if self._steps_left > 0:
            return
        self._tried, self._since_looked = None, 0
        tried[0] = self._found
        costs = self._costs(tried, wanted, weight)
        for part in np.unique(self._part_of_joint[self._looks_at & ~lost]):
            cost = costs[:, part]
            best = int(np.argmax(cost < cost.min() + _ALIKE_RAD))
            if cost[best] < cost[0] - self._gain:
                of_part = self._part_of_joint == part
                self._found[of_part] = tried[best, of_part]

    def _costs(self, tried: Array, wanted: Array, weight: Array) -> Array:
        """(S, P) how far the segments of each part are from the operator's, for postures (S, J)."""
        left = np.linalg.norm(self._left(tried, wanted, weight)[0], axis=-1)
        out = np.zeros((len(tried), len(self._lower)))
        for part in np.unique(self._part_of_joint):
            out[:, part] = np.sqrt((left[:, self._part_of_segment == part] ** 2).sum(axis=1))
        return out

    def _solve(self, position: Array, wanted: Array, weight: Array, steps: int) -> Array:
        """Nearest postures (S, J) next to `position` (S, J)."""
        for _ in range(steps):
            left, columns = self._left(position, wanted, weight)
            downhill = np.einsum("sncj,snc->sj", columns, left)
            flat = columns.reshape(len(columns), -1, columns.shape[-1])
            curved = flat.swapaxes(-1, -2) @ flat
            square = (left**2).sum(axis=-1) @ self._turns
            stuck = (position <= self._lower) & (downhill < 0.0)
            stuck |= (position >= self._upper) & (downhill > 0.0)
            curved[stuck] = 0.0
            curved.swapaxes(-1, -2)[stuck] = 0.0
            downhill[stuck] = 0.0
            every = np.arange(curved.shape[-1])
            curved[:, every, every] += np.where(stuck, 1.0, _LEAST_DAMPING + _DAMPING * square)
            step = np.linalg.solve(curved, downhill[..., None])[..., 0]
            step = np.clip(step, -_LONGEST_STEP_RAD, _LONGEST_STEP_RAD)
            position = np.clip(position + step, self._lower, self._upper)
            if np.abs(step).max() < _SAME_RAD:
                break
        return position

    def _left(self, position: Array, wanted: Array, weight: Array) -> tuple[Array, Array]:
        """For postures (S, J): rotations (S, N, 3) from each to the operator's, and axes (S, N, 3, J).

        The axes are those about which each joint turns a segment, rad of it for 1 rad; all in parents'
        frames.
        """
        half = 0.5 * ((position - self._zero) @ self._ratios.T)
        half = half.reshape(len(position), *self._axes.shape[:2])
        c, s = np.cos(half)[..., None], np.sin(half)[..., None] * self._axes
        q = np.tile(IDENTITY, (*half.shape[:2], 1))
        axes = np.empty((*half.shape, 3))
        for k in range(half.shape[-1]):
            axes[:, :, k] = rotate(q, self._axes[:, k])
            q = multiply(q, np.concatenate([c[:, :, k], s[:, :, k]], axis=-1))
        columns = np.einsum("snkc,nkj->sncj", axes, self._ratio_of) * weight[:, None, None]
        turn = multiply(wanted, conjugate(q))
        for i in self._roots:
            # of the world only the vertical is known: any heading will do
            heading = turn[:, i] * _ABOUT_Z
            length = np.maximum(np.linalg.norm(heading, axis=-1, keepdims=True), 1e-12)
            turn[:, i] = multiply(conjugate(heading / length), turn[:, i])
            columns[:, i, 2] = 0.0
        return to_rotation_vector(turn) * weight[:, None], columns

    def _velocity(self, columns: Array, rate: Array) -> Array:
        """(J,) that turns the segments as the operator's turn, (N, 3) rad/s, where no limit is in the way."""
        for i in self._roots:
            rate[i, 2] = 0.0
        flat, free = columns.reshape(-1, columns.shape[-1]), np.ones(len(self._found), np.bool_)
        velocity = np.zeros(len(free))
        for _ in range(2):
            some = flat * free
            normal = some.T @ some + np.diag(np.where(free, 1e-6, 1.0))
            velocity = np.linalg.solve(normal, some.T @ rate.ravel())
            outward = (self._found <= self._lower) & (velocity < 0.0)
            outward |= (self._found >= self._upper) & (velocity > 0.0)
            if not outward.any():
                break
            free &= ~outward
        velocity[~free] = 0.0
        return velocity

    def _bounded(self, velocity: Array, most: Array, fastest: Array, elapsed_s: float) -> tuple[Array, Array]:
        """One step towards `_found`: the joints of a part by the same share, none farther than it may."""
        position = self._found.copy()
        step = position - self._last
        most_of_joint = np.where(self._turns, np.nan_to_num(most, nan=np.inf)[:, None], 0.0).max(axis=0)
        fastest_of_joint = np.where(self._turns, fastest[:, None], 0.0).max(axis=0)
        velocity = np.clip(velocity, -fastest_of_joint, fastest_of_joint)
        over = np.nan_to_num(np.abs(step) / most_of_joint, nan=0.0)
        if (over > 1.0).any():
            worst = np.zeros(self._part_of_joint.max() + 1)
            np.maximum.at(worst, self._part_of_joint, over)
            late = worst[self._part_of_joint] > 1.0
            share = 1.0 / np.maximum(worst[self._part_of_joint], 1.0)
            position[late] = (self._last + share * step)[late]
            velocity[late] = (share * step)[late] / elapsed_s
        return position, velocity


_ABOUT_Z = np.array([1.0, 0.0, 0.0, 1.0])


def _parts(turns: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Joints (J,) and segments (N,) by the part they belong to: joints that turn one segment share it."""
    joints = np.arange(turns.shape[1])
    for _ in range(turns.shape[1]):
        for row in turns:
            if row.any():
                joints[row] = joints[row].min()
    segments = np.array([joints[row].min() if row.any() else -1 for row in turns], dtype=np.intp)
    return joints, segments


def _seeds(zero: Array, lower: Array, upper: Array) -> Array:
    """(S, J) postures spread over the limits, the one next to the zero pose first."""
    low, high = np.maximum(lower, zero - np.pi), np.minimum(upper, zero + np.pi)
    shares = np.random.default_rng(0).random((_SEEDS - 2, len(zero)))
    spread = low + shares * (high - low)
    out: Array = np.clip(np.vstack([zero, 0.5 * (low + high), spread]), lower, upper)
    return out
