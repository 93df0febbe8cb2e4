"""How a movement goes on from an estimate: what is foretold fades exponentially.

With velocity v, acceleration a, and τ the time for which the joint's movement keeps its direction
(`persistence.py`), s later:

    v(s) = e^(-s/τ) (v + b s)
    p(s) = p + τ (1 - e^(-s/τ)) v + τ² (1 - e^(-s/τ) (1 + s/τ)) b,      b = a + c v / τ

c, between 0 and 1, is the movement's steadiness. At c = 1 the velocity begins to change at the rate a: right
for long, even reaches, whose acceleration can be known. At c = 0 it begins to change at a - v / τ: right for
people, who turn about sooner than their acceleration tells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from slave.track.estimate import Estimate
from slave.track.persistence import steadiness


@dataclass(frozen=True, slots=True)
class Continuation:
    """What is foretold from one instant on."""

    motion: Array
    """(3, J): p, rad, v, rad/s, and b, rad/s²."""
    lasts_s: Array
    """(J,) τ."""

    @classmethod
    def of(cls, estimate: Estimate, lasts_s: Array) -> Continuation:
        """From an estimate of J joints; τ is (J,), or of shape () for all of them."""
        motion = estimate.motion.copy()
        lasts_s = np.broadcast_to(lasts_s, motion.shape[1:])
        motion[2] += steadiness(lasts_s) / lasts_s * motion[1]
        return cls(motion, lasts_s)

    def way(self, span_s: Array | float) -> Array:
        """(J,) rad: how far it has gone `span_s` later."""
        x = span_s / self.lasts_s
        fade = np.exp(-x)
        _, v, b = self.motion
        out: Array = self.lasts_s * ((1.0 - fade) * v + self.lasts_s * (1.0 - fade * (1.0 + x)) * b)
        return out

    def course(self, span_s: float) -> Array:
        """(2, J) position and velocity `span_s` later."""
        p, v, b = self.motion
        out: Array = np.stack([p, np.exp(-span_s / self.lasts_s) * (v + span_s * b)])
        out[0] += self.way(span_s)
        return out

    def farthest(self, span_s: float) -> Array:
        """(J,) rad: how far it gets away from its beginning within `span_s`.

        At the end; or, where it turns back, at v(s) = 0, which is s = -v / b.
        """
        _, v, b = self.motion
        # with too little acceleration against it, it does not turn within the span
        turns = (v * b < 0.0) & (np.abs(v) < span_s * np.abs(b))
        turns_s = np.divide(-v, b, out=np.full_like(v, span_s), where=turns)
        out: Array = np.maximum(np.abs(self.way(turns_s)), np.abs(self.way(span_s)))
        return out

    def scaled(self, share: Array) -> Continuation:
        """With (J,) of the velocity and of b: so far are all ways foretold."""
        motion = self.motion.copy()
        motion[1:] *= share
        return Continuation(motion, self.lasts_s)
