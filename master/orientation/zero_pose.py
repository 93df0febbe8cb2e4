"""What standing in the zero pose determines for each node: its heading, or how its sensor sits.

It assumes that every segment then stands as in the skeleton's zero pose and that the operator faces a known
heading. Of a node whose alignment is calibrated only the heading is taken. Of any other node the alignment
itself is taken: a stopgap, because a six-axis node's own heading is arbitrary, so that for a sensor worn
askew the axes found here may be turned about the vertical.

A pose is refused, and asked for again, if any node turns during it, or if a segment whose sensor's alignment
is known leans from upright: a bent waist or elbow. It is then refused for all nodes that were taking it. A
node whose gyro is not to be believed yet takes no part: it neither refuses nor delays the others' pose. What
cannot be noticed: how a segment stands whose alignment is not known, and what is turned about the vertical.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, angle_between, conjugate, heading_rad, heading_turn, multiply, normalise
from common.wire.messages import Mask
from master.suit.doubt import NodeDoubt, Weight

_STRAY_RAD = math.radians(6.0)
"""How far a node may turn in all during the pose: a slow lean stays below any rate."""


@dataclass(frozen=True, slots=True)
class ZeroPoseLimits:
    """What is still the zero pose."""

    turn_rad_s: float = math.radians(15.0)
    """Rate of any node; swaying and breathing stay below."""
    lean_rad: float = math.radians(15.0)
    """Inclination of any segment whose alignment is known."""


class ZeroPose:
    """Takes the nodes' mean orientations over `ticks` ticks without fault as those of the zero pose."""

    def __init__(
        self,
        q_sensor_from_segment: Array,
        ticks: int,
        facing_rad: float,
        aligned: Mask | None = None,
        *,
        limits: ZeroPoseLimits | None = None,
        posed_before: bool = False,
    ) -> None:
        """`q_sensor_from_segment` (N, 4) stands until the zero pose is complete, for good if `ticks` is 0.

        For good also that of the nodes `aligned` (N,), by default none. `posed_before`: that of the others is
        an earlier zero pose's, so their lean is known too.
        """
        count = len(q_sensor_from_segment)
        self._ticks = ticks
        self._facing = heading_turn(facing_rad)
        self._aligned = np.zeros(count, dtype=np.bool_) if aligned is None else aligned
        self._upright = np.ones(count, dtype=np.bool_) if posed_before else self._aligned
        self._limits = limits or ZeroPoseLimits()
        self._sum = np.zeros((count, 4))
        self._first = np.zeros((count, 4))
        self._taken = np.zeros(count, dtype=np.int64)
        self.known: Mask = np.full(count, ticks == 0)
        """(N,) nodes whose zero pose is complete."""
        self.refused = 0
        """How many poses were refused."""
        self.reasons: dict[int, str] = {}
        """What was wrong with the last pose that was refused, by node, the worst first."""
        self.q_sensor_from_segment = q_sensor_from_segment.copy()
        """(N, 4)."""
        self.correction_rad = np.zeros(count)
        """(N,) what the headings lacked when the pose was complete; 0 for nodes whose lean is not known."""
        self.lean_rad = np.full(count, np.nan)
        """(N,) how far nodes leaned from the zero pose in the last pose; NaN where that is not known."""

    def add(self, q_world_from_sensor: Array, settled: Mask, rate_rad_s: Array | None = None) -> Mask:
        """One tick: orientations (N, 4), which of them count, and their rates (N, 3) without the bias.

        Returns the nodes that are complete now, (N,). A node that drops out begins again.
        """
        gone = ~self.known & ~settled
        self._sum[gone] = 0.0
        self._taken[gone] = 0
        taking = ~self.known & settled
        if not taking.any():
            return taking
        new = taking & (self._taken == 0)
        self._first[new] = q_world_from_sensor[new]
        reasons = self._motion(q_world_from_sensor, taking, rate_rad_s)
        reasons = reasons or self._others(q_world_from_sensor, settled)
        if reasons:
            self._refuse(reasons, taking)
            return np.zeros_like(taking)
        # q and -q are one rotation: sum them on one side
        side = np.where(np.sum(self._sum * q_world_from_sensor, axis=-1) < 0.0, -1.0, 1.0)
        self._sum[taking] += (side[:, None] * q_world_from_sensor)[taking]
        self._taken[taking] += 1
        done = taking & (self._taken >= self._ticks)
        if not done.any():
            return done
        # nodes that came later count too: if any segment leans, the operator is not in the zero pose
        leaning = self._lean(taking & self._upright)
        if leaning:
            self._refuse(leaning, taking)
            return np.zeros_like(taking)
        self._conclude(done)
        return done

    def _motion(self, q: Array, taking: Mask, rate_rad_s: Array | None) -> dict[int, str]:
        """Nodes that turn, and how, the fastest first."""
        limit = self._limits.turn_rad_s
        out = {}
        if rate_rad_s is not None:
            rate = np.where(taking, np.sqrt(np.einsum("ni,ni->n", rate_rad_s, rate_rad_s)), 0.0)
            if rate.max() > limit:
                for node in _largest_first(rate, limit):
                    out[node] = f"turned at {_deg(rate[node])}°/s, at most {_deg(limit)} is standing still"
                return out
        stray = np.where(taking, angle_between(self._first, q), 0.0)
        if stray.max() > _STRAY_RAD:
            for node in _largest_first(stray, _STRAY_RAD):
                out[node] = f"turned by {_deg(stray[node])}°, at most {_deg(_STRAY_RAD)} is standing still"
        return out

    def _others(self, q: Array, settled: Mask) -> dict[int, str]:
        """Known nodes that stand elsewhere: a node that comes later needs the whole pose again."""
        others = self.known & settled
        if self._ticks == 0 or not others.any():
            return {}
        segment = multiply(q, self.q_sensor_from_segment)
        off = np.where(others, angle_between(segment, self._facing), 0.0)
        limit = 2.0 * self._limits.lean_rad  # their headings may have drifted
        return {
            node: f"is {_deg(off[node])}° from the zero pose, which another node waits for"
            for node in _largest_first(off, limit)
        }

    def _lean(self, nodes: Mask) -> dict[int, str]:
        """Which aligned nodes lean, by node, the farthest first."""
        segment = multiply(normalise(self._sum[nodes]), self.q_sensor_from_segment[nodes])
        correction = -heading_rad(multiply(segment, conjugate(self._facing)))
        self.correction_rad[nodes] = correction
        self.lean_rad[nodes] = angle_between(multiply(heading_turn(correction), segment), self._facing)
        limit = self._limits.lean_rad
        lean = np.where(nodes, self.lean_rad, 0.0)
        return {
            node: f"leaned by {_deg(lean[node])}°, at most {_deg(limit)} is upright"
            for node in _largest_first(lean, limit)
        }

    def _refuse(self, reasons: dict[int, str], taking: Mask) -> None:
        """Begin the pose again."""
        # motion goes on from tick to tick: counted once for each pose that had begun
        self.refused += bool((self._taken[taking] > 0).any())
        self.reasons = reasons
        self._sum[taking] = 0.0
        self._taken[taking] = 0

    def _conclude(self, done: Mask) -> None:
        sits = done & ~self._aligned
        self.q_sensor_from_segment[sits] = multiply(conjugate(normalise(self._sum[sits])), self._facing)
        self.known = self.known | done
        self.reasons = {}

    def doubts(self, settled: Mask) -> dict[int, NodeDoubt]:
        """Settled nodes (N,) whose zero pose has yet to be taken, with what was wrong with the last one."""
        waiting = settled & ~self.known
        if not waiting.any():
            return {}
        out = {
            node: NodeDoubt(f"zero pose refused: {why}", Weight.REFUSED)
            for node, why in self.reasons.items()
            if settled[node]
        }
        rest = NodeDoubt("waits for the zero pose: stand upright, arms hanging, and still", Weight.REFUSED)
        return out | {node: rest for node in np.flatnonzero(waiting).tolist() if node not in out}


def _largest_first(values: Array, limit: float) -> list[int]:
    """Nodes beyond the limit."""
    beyond = np.flatnonzero(values > limit)
    out: list[int] = beyond[np.argsort(-values[beyond], kind="stable")].tolist()
    return out


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.0f}"
