"""How far each node's heading is off against its neighbour's, and how sure that is, before it shows.

The joints' Kalman filter (`joints/`) weighs what elbows, knees and fingers cannot do, the magnetometers as
far as they are believed, the gyros' drift, and the zero pose. Where it corrects the headings, only its own
uncertainty is left. Where it does not (`constraints = "off"`, or no calibrated alignment), one runs beside
the headings in use: the difference is what they are off by, and is said, not corrected. Alignments then come
from the zero pose, so its joints count for less.
"""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array, conjugate, heading_rad, multiply
from common.skeleton import Skeleton
from common.wire.messages import Mask
from master.orientation.config import EstimationConfig
from master.orientation.joints.constraints import JointConstraints
from master.orientation.joints.field import wrap
from master.orientation.joints.online import OnlineConfig, OnlineHeadings, constrains
from master.suit.doubt import NodeDoubt, Weight

_POSED_SD_DEG = 6.0
"""How far a joint turns about an axis about which it should not, with alignments from a zero pose alone."""
_MEMORY_S = 5.0
"""Time constant of the mean that is judged."""
_ENDS = 0.7
"""Share of the limit below which a heading is no longer doubted."""


class HeadingWatch:
    """Figures of N nodes. `applied`: the headings in use where joints correct them; None: they do not."""

    def __init__(
        self,
        config: OnlineConfig,
        skeleton: Skeleton,
        rate_hz: float,
        limit_deg: float,
        applied: OnlineHeadings | None,
    ) -> None:
        posed = config.model_copy(update={"joint_sd_deg": max(config.joint_sd_deg, _POSED_SD_DEG)})
        self.beside = OnlineHeadings(posed, skeleton, rate_hz) if applied is None else None
        """The filter that runs beside the headings in use; None: those in use are its own."""
        self._filter = applied or self.beside
        self._names = skeleton.segment_names
        self._parents = skeleton.parents
        self._limit_rad = math.radians(limit_deg)
        self._rate_hz = rate_hz
        count = len(self._names)
        self.off_rad: Array = np.zeros(count)
        """(N,) against the parent's; 0 for a root, whose heading moves no joint."""
        self.sd_rad: Array = np.zeros(count)
        """(N,) standard deviation of that."""
        self._doubted: Mask = np.zeros(count, np.bool_)

    def stand(
        self, nodes: Mask, q_used: Array, correction_rad: Array, q_inertial: Array, mag_ut: Array
    ) -> None:
        """A zero pose turns the headings in use, `q_used` (N, 4), by `correction_rad` (N,)."""
        if self.beside is not None:
            own = multiply(self.beside.turn, q_inertial)
            between = heading_rad(multiply(q_used, conjugate(own)))
            self.beside.stand(nodes, between + correction_rad, q_inertial, mag_ut)
        self.off_rad = np.where(nodes, 0.0, self.off_rad)

    def look(self, q_used: Array, q_inertial: Array, usable: Mask, dt_s: float) -> None:
        """Judge the headings in use (N, 4); nodes that are not `usable` (N,) keep their figures."""
        assert self._filter is not None
        has_parent = self._parents >= 0
        known = usable & has_parent & usable[self._parents]
        share = -math.expm1(-dt_s / _MEMORY_S)
        if self.beside is not None:
            turned = heading_rad(multiply(q_used, conjugate(multiply(self.beside.turn, q_inertial))))
            off = wrap(turned - turned[self._parents])
            self.off_rad = np.where(known, self.off_rad + share * (off - self.off_rad), self.off_rad)
        self.sd_rad = np.where(known, self._filter.uncertainty_rad(self._parents), self.sd_rad)
        limit = np.where(self._doubted, _ENDS, 1.0) * self._limit_rad
        off_for_sure = (np.abs(self.off_rad) > limit) & (np.abs(self.off_rad) > 2.0 * self.sd_rad)
        self._doubted = known & (off_for_sure | (self.sd_rad > 2.0 * limit))

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes, by number, whose heading is off by more than the limit, or may be by twice as much."""
        doubted = np.flatnonzero(self._doubted).tolist()
        return {node: NodeDoubt(self._words(node), Weight.NOTED) for node in doubted}

    def figures_deg(self) -> dict[str, tuple[float, float]]:
        """By segment, how far its heading is off and the standard deviation; small ones are left out."""
        off, sd = np.degrees(self.off_rad), np.degrees(self.sd_rad)
        told = np.flatnonzero((np.abs(off) >= 1.0) | (sd >= 2.0)).tolist()
        return {self._names[n]: (round(float(off[n]), 1), round(float(sd[n]), 1)) for n in told}

    def _words(self, node: int) -> str:
        off, sd = math.degrees(self.off_rad[node]), math.degrees(self.sd_rad[node])
        parent = self._names[self._parents[node]]
        if abs(off) > sd:
            found = f"its heading is {off:+.0f}° ± {sd:.0f}° off against {parent}"
        else:
            found = f"its heading may be off by ± {sd:.0f}° against {parent}: nothing has told it for a while"
        return f"{found}; take the zero pose again"


def constrained(config: EstimationConfig, skeleton: Skeleton, aligned: Mask) -> bool:
    """Whether joints correct the headings: if wanted, or by default once one of them can be believed."""
    if config.constraints == "auto":
        return bool(constrains(JointConstraints(skeleton), aligned).any())
    return config.constraints == "online"


def watch_of(
    config: EstimationConfig, skeleton: Skeleton | None, rate_hz: float, headings: object
) -> HeadingWatch | None:
    """The watch for the `headings` in use. None: unwanted, or nothing is known of how the sensors sit."""
    applied = headings if isinstance(headings, OnlineHeadings) else None
    if skeleton is None or not config.heading_limit_deg or (applied is None and not config.zero_pose_s):
        return None
    return HeadingWatch(config.online, skeleton, rate_hz, config.heading_limit_deg, applied)
