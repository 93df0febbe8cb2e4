"""How long an operator's arms are raised, and how long one is held, by the suit itself. Pure.

*Raised*: the upper arm is 60° or more from hanging, or the hand is above the shoulder. Inclinations come from
gravity, so no heading counts. By the action level of Arvidsson, Dahlqvist, Enquist and Nordander (Annals of
Work Exposures and Health 65, 2021) an upper arm is above 60° in at most a tenth of the time; here of the last
quarter of an hour, so that it is told in time.

*Held*: the upper arm stands within 10° of where it has been, unsupported, at 20° to 60°. ISO 11226:2000
(static working postures) lets it do so for 3 minutes at 20°, falling to 1 minute at 60°; above 60° it
recommends none. The rule is no promise of conformity: the suit does not see whether an arm is supported.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from common.clock import NS_PER_S, to_s
from common.metrics.master import ArmLoad
from common.quaternion import Array, rotate
from common.skeleton import Skeleton
from common.wire.messages import Mask

WINDOW_S = 900.0
RAISED_DEG, RAISED_SHARE = 60.0, 0.1
HELD_FROM_DEG, HELD_WITHIN_DEG = 20.0, 10.0
_BUCKET_S = 5.0
_LONGEST_S = 0.5
"""Between two looks; what happened in a longer gap nobody knows."""
_AGAIN_S = 300.0
"""The same is said once in this time."""


def holding_limit_s(elevation_deg: float) -> float:
    """For how long an upper arm may be held there; infinite below 20°."""
    if elevation_deg < HELD_FROM_DEG:
        return math.inf
    return float(np.interp(elevation_deg, [HELD_FROM_DEG, RAISED_DEG], [180.0, 60.0]))


class _Arm:
    """One arm: its segments from the shoulder to the hand, and its times."""

    def __init__(self, segments: list[int], bones_m: Array) -> None:
        self.segments = segments
        self._bones_m = bones_m
        self._buckets: deque[tuple[int, float]] = deque()
        self._from_deg, self._since_ns = 0.0, 0
        self._said_ns: dict[str, int] = {}
        self.raised_s = self.held_s = 0.0
        self.elevation_deg = 0.0

    def take(self, q_world_from_segment: Array, elapsed_s: float, now_ns: int) -> None:
        bones = rotate(q_world_from_segment[self.segments[: len(self._bones_m)]], self._bones_m)
        level_m = math.hypot(bones[0, 0], bones[0, 1])
        self.elevation_deg = math.degrees(math.atan2(level_m, -bones[0, 2]))
        raised = self.elevation_deg >= RAISED_DEG or float(bones[:, 2].sum()) > 0.0
        bucket = now_ns // round(_BUCKET_S * NS_PER_S)
        if not self._buckets or self._buckets[-1][0] != bucket:
            self._buckets.append((bucket, 0.0))
        self._buckets[-1] = bucket, self._buckets[-1][1] + raised * elapsed_s
        while self._buckets[0][0] <= bucket - round(WINDOW_S / _BUCKET_S):
            self._buckets.popleft()
        self.raised_s = sum(seconds for _, seconds in self._buckets)
        moved = abs(self.elevation_deg - self._from_deg) > HELD_WITHIN_DEG
        if moved or self.elevation_deg < HELD_FROM_DEG:
            self._from_deg, self._since_ns = self.elevation_deg, now_ns
        self.held_s = to_s(now_ns - self._since_ns)

    def forget_hold(self, now_ns: int) -> None:
        """The arm was not seen for a while."""
        self._since_ns = now_ns

    def words(self, name: str, now_ns: int) -> list[str]:
        out = []
        if self.raised_s > RAISED_SHARE * WINDOW_S:
            out.append(
                ("raised", f"raised for {self.raised_s / 60.0:.1f} of the last {WINDOW_S / 60.0:.0f} min")
            )
        if self.held_s > holding_limit_s(self.elevation_deg):
            out.append(("held", f"held at {self.elevation_deg:.0f}° for {self.held_s / 60.0:.1f} min"))
        new = [(w, t) for w, t in out if now_ns - self._said_ns.get(w, -(1 << 62)) > _AGAIN_S * NS_PER_S]
        self._said_ns |= {word: now_ns for word, _ in new}
        return [f"{name} {text}: let it rest (tandem rest {name})" for _, text in new]


class ArmLoadMeter:
    """The arms of a profile: its joint groups that are named `…arm`; without one it measures nothing."""

    def __init__(self, skeleton: Skeleton) -> None:
        names = [s.group or "" for s in skeleton.segments]
        self._arms = {name: _arm(skeleton, i) for i, name in enumerate(names) if name.endswith("arm")}
        self._taken_ns: dict[str, int] = {}

    def take(self, now_ns: int, q_world_from_segment: Array, known: Mask) -> list[str]:
        """Take a posture (N, 4) and which nodes are believed (N,); returns what to tell the operator."""
        said = []
        for name, arm in self._arms.items():
            if not known[arm.segments].all():
                self._taken_ns.pop(name, None)
                continue
            before_ns, self._taken_ns[name] = self._taken_ns.get(name), now_ns
            elapsed_s = math.inf if before_ns is None else to_s(now_ns - before_ns)
            if not 0.0 <= elapsed_s <= _LONGEST_S:
                arm.forget_hold(now_ns)
                elapsed_s = 0.0
            arm.take(q_world_from_segment, elapsed_s, now_ns)
            said += arm.words(name, now_ns)
        return said

    def metrics(self) -> Mapping[str, ArmLoad]:
        """By arm."""
        return {
            name: ArmLoad(round(arm.raised_s, 1), round(arm.held_s, 1), round(arm.elevation_deg, 1))
            for name, arm in self._arms.items()
        }


def _arm(skeleton: Skeleton, first: int) -> _Arm:
    """From the shoulder on, as long as one segment hangs on the other: the last is the hand."""
    chain = [first]
    while len(beyond := np.flatnonzero(skeleton.parents == chain[-1]).tolist()) == 1:
        chain += beyond
    ends = [skeleton.segments[i].origin_m for i in chain[1:]] or [skeleton.segments[first].node_m]
    return _Arm(chain, np.array(ends))
