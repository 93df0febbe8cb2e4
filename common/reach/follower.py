"""The postures that a robot takes for those that an operator takes: nearest, continuous, of bounded speed.

What is nearest. Each segment's rotation relative to its neighbour is followed by itself: of all the rotations
that the joints between the two can make within their limits, the one at the least angle to the operator's is
taken, all those joints together. An angle that the robot lacks is one whose limits are both 0. What a segment
cannot reach is not handed on to the segments beyond it: they keep their posture relative to it, as the
operator's do. So a joint depends on the two nodes beside it and on nothing else, an arm that cannot be raised
further does not bend its elbow instead, and a lean that the trunk lacks does not turn the head. A joint that
drives angles of several segments follows them by least squares, and is limited likewise.

What is continuous. The nearest posture can lie far from the last one although the operator hardly moved:
beside the pole of a ball joint (its middle angle at ±90°), and where two postures at limits are equally
near. So

- of the two decompositions the one nearer to the last posture is kept, its angles unwrapped. Clamped, it
  is preferred to a nearest posture that needs joints to turn far and gains little (`choice.py`);
- no joint turns farther from one posture to the next than a share of what the operator's segment turned
  (`farthest_turn`), nor does the robot's segment. What is left is made up for as the operator goes on, or
  slowly while he stands still.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.reach.chart import JointGroup, make_chart
from common.reach.choice import (
    BESIDE_POLE_RAD,
    MOST_GAIN,
    SAME_RAD,
    TURN,
    choose,
    kept_decomposition,
    worth_turning,
)
from common.reach.nearest import NOTHING, Nearest, nearest_angles, scalar_product, tensor
from common.reach.step import BoundedStep, farthest_turn
from common.skeleton import Skeleton
from common.wire.messages import Mask

NOMINAL_S = 0.08
"""The default time from one posture to the next."""
FORGOTTEN_S = 0.5
"""Postures farther apart than this have nothing to do with each other."""
_FLOOR = 1e-12
_ROUNDING_RAD = 1e-9
"""At rest many joints stand at their limits: rounding puts none of them beyond."""


class PostureFollower:
    """A robot's limits, and the posture it was last given."""

    def __init__(self, skeleton: Skeleton, lower_rad: Array, upper_rad: Array) -> None:
        """For joint limits (J,), rad."""
        count, joints = len(skeleton.segments), len(skeleton.joints)
        self._lower, self._upper = lower_rad.copy(), upper_rad.copy()
        self._chart = chart = make_chart(skeleton, self._lower, self._upper)
        self._centre = chart.centre_rad.take(chart.driven)
        # where a joint turns by more than a whole turn the last position tells which one is meant
        self._wide = np.flatnonzero(self._upper - self._lower > 2.0 * math.pi)
        self._limits = list(zip(self._lower.tolist(), self._upper.tolist(), strict=True))
        self._axes = [_signed_order(skeleton.axis_frames[group.segment]) for group in chart.groups]
        self._group_of_joint = np.full(joints, -1)
        for g, group in enumerate(chart.groups):
            self._group_of_joint[group.turning] = g
        self._group_segments = np.array([group.segment for group in chart.groups], dtype=np.intp)
        self._sums = (self._group_of_joint == np.arange(len(chart.groups))[:, None]).astype(np.float64)
        self._sums *= np.abs(_scales(chart.groups, joints))
        self._pair = np.empty((count, 4, 2))
        self._free_angles = np.empty((2, 3, count))
        self._last_q = np.full((count, 4), np.nan)
        self._last = np.full(joints, np.nan)
        self.short_rad: Array = np.zeros(count)
        """(N,) what the robot cannot follow of each segment: the angle from the robot's posture to theirs."""

    def forget(self) -> None:
        """The next posture has nothing to do with those before: it becomes the nearest there is."""
        self._last[:] = np.nan

    def joints_beside(self, joints: Mask) -> Mask:
        """Those (J,) that turn a segment together with one of `joints` (J,), these included."""
        concerned = np.unique(self._group_of_joint[joints])
        out: Mask = np.isin(self._group_of_joint, concerned[concerned >= 0])
        return out

    def follow(self, q: Array, q_rate: Array, elapsed_s: float = NOMINAL_S) -> tuple[Array, Array]:
        """Joint positions (J,) rad, all within limits, and velocities (J,) rad/s.

        Takes the segments' rotations relative to their neighbours, parent from segment (N, 4), their
        derivatives (N, 4) 1/s, and the time since the posture before. NaN stays within the joints that need
        its segment, and these begin anew after it.
        """
        if not 0.0 < elapsed_s <= FORGOTTEN_S:
            self.forget()
            elapsed_s = NOMINAL_S
        free, velocity = self._free(q, q_rate)
        position = np.minimum(np.maximum(free, self._lower), self._upper)
        # of each segment: how far it may turn, and how fast its joints may be told to; |q'| is half its speed
        bounds = np.empty((2, len(q)))
        bounds[0] = most = farthest_turn(turned(self._last_q, q), elapsed_s)
        bounds[1] = (2.0 * MOST_GAIN) * np.sqrt(np.einsum("ij,ij->i", q_rate, q_rate))
        most_of_joint, fastest = bounds.take(self._chart.segment_of_joint, axis=1).max(axis=-1)
        beyond = np.abs(position - free) > _ROUNDING_RAD
        step = np.abs(position - self._last)
        late = step > most_of_joint
        # a group's joints together turn its segment by no more than the sum of their steps; a step that is
        # not known counts as far, and must not spread
        far = self._sums @ np.fmin(step, TURN) > most.take(self._group_segments)
        self.short_rad = np.zeros(len(q))
        if beyond.any() or late.any() or far.any():
            velocity[beyond] = 0.0
            self.short_rad[self._chart.segment_of_joint[:, 0]] = np.abs(free - position)
            step_of = BoundedStep(elapsed_s, most, most_of_joint, self._last, free, position, velocity)
            position, velocity = self._together(q, step_of, beyond, late, far)
        velocity = np.minimum(np.maximum(velocity, -fastest), fastest)
        self._last, self._last_q = position, q.copy()
        return position.copy(), velocity

    def _free(self, q: Array, q_rate: Array) -> tuple[Array, Array]:
        """Positions and velocities (J,) of the nearest rotations without limits (chart.py)."""
        chart, pair = self._chart, self._pair
        pair[:, :, 0], pair[:, :, 1] = q, q_rate
        terms = chart.forms @ pair
        over, under = terms[:, 0::2, 0], terms[:, 1::2, 0]
        over_rate, under_rate = terms[:, 0::2, 1], terms[:, 1::2, 1]
        square = np.maximum(over * over + under * under, _FLOOR)
        half = np.arctan2(over, under)
        half_rate = (under * over_rate - over * under_rate) / square
        length = np.sqrt(square)
        angles, rates = self._free_angles
        np.add(half[:, 0], half[:, 1], out=angles[0])
        np.subtract(half[:, 0], half[:, 1], out=angles[1])
        np.arctan2(length[:, 0], length[:, 1], out=angles[2])
        angles[2] += angles[2]
        angles[2] -= 0.5 * math.pi
        np.add(half_rate[:, 0], half_rate[:, 1], out=rates[0])
        np.subtract(half_rate[:, 0], half_rate[:, 1], out=rates[1])
        # of three angles the squared lengths are 1 ± sin b, and the product of the lengths is cos b
        growth = over[:, 0] * over_rate[:, 0] + under[:, 0] * under_rate[:, 0]
        np.divide(2.0 * growth, length[:, 0] * length[:, 1], out=rates[2])
        driven = self._free_angles.reshape(2, -1).take(chart.driven, axis=1)
        driven[0] -= TURN * np.rint((driven[0] - self._reference()) / TURN)
        free: Array = np.einsum("tjk,jk->tj", driven, chart.weights)
        return free[0], free[1]

    def _reference(self) -> Array:
        """Of angles that a whole turn lies between, the one nearest to this is meant, (J, K)."""
        if not self._wide.size:
            return self._centre
        reference = self._centre.copy()
        known = self._wide[np.isfinite(self._last[self._wide])]
        reference[known, 0] = self._last[known] / self._chart.weights[known, 0]
        return reference

    def _together(
        self, q: Array, at: BoundedStep, beyond: Mask, late: Mask, far: Mask
    ) -> tuple[Array, Array]:
        """Positions and velocities (J,) where groups are beyond limits, or joints cannot keep up."""
        project = set(self._group_of_joint[beyond].tolist()) - {-1}
        behind = set(self._group_of_joint[late].tolist()) - {-1}
        # where the pole is within its limits a group may be on the wrong one of two decompositions
        project.update(g for g in behind if self._chart.groups[g].box.twofold)
        for g in project:
            self._project(g, q[self._chart.groups[g].segment].tolist(), at)
        moved = np.flatnonzero(late).tolist()
        for g in project:
            moved += self._chart.groups[g].turning
        at.limit(moved)
        for g in project.union(behind, np.flatnonzero(far).tolist()):
            at.limit_turn(self._chart.groups[g])
        return np.array(at.position), np.array(at.velocity)

    def _project(self, g: int, q: list[float], at: BoundedStep) -> None:
        """Put one group's nearest posture into `at`, and the velocities that go with it."""
        group = self._chart.groups[g]
        w, *vector = q
        if not math.isfinite(sum(q)):
            return
        i, j, k = self._axes[g][0]
        a, b, c = self._axes[g][1]
        wanted = tensor(w, a * vector[i], b * vector[j], c * vector[k])
        last = group.angles(at.last)
        known = math.isfinite(last[0] + last[1] + last[2])
        towards = last if known else group.middle
        kept = NOTHING
        if known and group.ball:
            angles = kept_decomposition(group.angles(at.free), group, last)
            kept = Nearest(angles, abs(scalar_product(wanted, angles)))
        nearest = nearest_angles(wanted, group.box, towards, group.box.twofold, kept)
        if kept is not NOTHING:
            nearest = worth_turning(wanted, group, choose(wanted, nearest, kept), last)
        self.short_rad[group.segment] = nearest.left_rad
        # beside the pole the decomposition's velocity of now tells nothing of what comes next
        beside_pole = group.ball and abs(nearest.angles[1]) > BESIDE_POLE_RAD
        for k, joint in enumerate(group.joints):
            if joint is not None:
                lower, upper = self._limits[joint]
                at.position[joint] = now = min(max(nearest.angles[k] / group.scale[k], lower), upper)
                if abs(now - at.free[joint]) < SAME_RAD and not beside_pole:
                    continue  # the velocity of the decomposition is its own
                resting = now in (lower, upper) or not known
                at.velocity[joint] = 0.0 if resting else (now - at.last[joint]) / at.elapsed_s


def _scales(groups: Sequence[JointGroup], joints: int) -> Array:
    """(J,): each joint's angle for 1 rad; 1 where it is of no group."""
    out = np.ones(joints)
    for group in groups:
        for j, scale in zip(group.joints, group.scale, strict=True):
            if j is not None:
                out[j] = scale
    return out


def _signed_order(frame: Array) -> tuple[list[int], list[float]]:
    """Which component of a vector, with which sign, is each of its components in the axis frame (3, 3)."""
    order = np.argmax(np.abs(frame), axis=0)
    return order.tolist(), frame[order, np.arange(3)].tolist()


def turned(before: Array, after: Array) -> Array:
    """By how much each rotation (N, 4) turned, rad; a little less where it is much. NaN where not known."""
    product = np.abs(np.einsum("ij,ij->i", before, after))
    # twice the chord between the two quaternions, which is 2 sin(t / 4)
    out: Array = 2.0 * np.sqrt(np.maximum(2.0 - 2.0 * product, 0.0))
    return out
