"""One step from the last posture to the next: how far each joint and each segment may turn in it."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.reach.chart import JointGroup
from common.reach.choice import MOST_GAIN
from common.reach.nearest import Triple, left_rad

_GAIN, _CREEP_RAD_S = 1.5, math.radians(20.0)
_MOST_CREEP_RAD = math.radians(1.8)


def farthest_turn(turned_rad: Array, elapsed_s: float) -> Array:
    """How far (...) a joint may turn while the operator's segment turns by `turned_rad` (...).

    min(max(3 t, creep), 1.5 t + creep): three times as far, and never more than half as far again and 1.8°.
    """
    creep = min(_CREEP_RAD_S * elapsed_s, _MOST_CREEP_RAD)
    out: Array = np.minimum(np.maximum(MOST_GAIN * turned_rad, creep), _GAIN * turned_rad + creep)
    return out


class BoundedStep:
    """One step from the last posture to the next, as plain numbers: a dozen of them are quicker so."""

    def __init__(
        self,
        elapsed_s: float,
        most: Array,
        most_of_joint: Array,
        last: Array,
        free: Array,
        position: Array,
        velocity: Array,
    ) -> None:
        self.elapsed_s = elapsed_s
        self.last: list[float] = last.tolist()
        self.free: list[float] = free.tolist()
        self.position: list[float] = position.tolist()
        self.velocity: list[float] = velocity.tolist()
        self._most: list[float] = most.tolist()
        self._most_of_joint: list[float] = most_of_joint.tolist()

    def limit(self, joints: list[int]) -> None:
        """None of these joints goes farther at once than it may."""
        for j in joints:
            now, last, most = self.position[j], self.last[j], self._most_of_joint[j]
            if abs(now - last) > most:
                self._put(j, last + math.copysign(most, now - last))

    def limit_turn(self, group: JointGroup) -> None:
        """Nor does the segment that a group of joints turns."""
        last, most = group.angles(self.last), self._most[group.segment]
        for _ in range(3):
            turn = left_rad(_product(last, group.angles(self.position)))
            if not turn > most:
                return
            for j in group.turning:
                self._put(j, self.last[j] + 0.98 * most / turn * (self.position[j] - self.last[j]))

    def _put(self, joint: int, position_rad: float) -> None:
        self.position[joint] = position_rad
        self.velocity[joint] = (position_rad - self.last[joint]) / self.elapsed_s


def _product(p: Triple, q: Triple) -> float:
    """Scalar product of the quaternions that two triples of angles make."""
    # ⟨qx(a) qy(b) qz(c), qx(d) qy(e) qz(f)⟩ depends on a - d and c - f alone, and not on a and c
    x, z = 0.5 * (p[0] - q[0]), 0.5 * (p[2] - q[2])
    b, e = 0.5 * p[1], 0.5 * q[1]
    return math.cos(x) * math.cos(b - e) * math.cos(z) - math.sin(x) * math.sin(b + e) * math.sin(z)
