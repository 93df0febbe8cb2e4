"""What a recording computed again gave, beside what it gave when it was recorded. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from deploy.recorded.recompute import Recomputed, Replay


@dataclass(frozen=True, slots=True)
class FirstDifference:
    """The first posture that is not identical."""

    tick: int
    at_s: float
    """Since the first posture that was computed."""
    joint: str
    """The one that differs most there."""
    apart_deg: float


@dataclass(slots=True)
class ReplayFindings:
    """All postures of one replay."""

    joints: tuple[str, ...]
    postures: int = 0
    identical: int = 0
    skipped: int = 0
    """Recorded, but before a snapshot or after missing messages."""
    unrecorded: int = 0
    """Computed, but not recorded: another decimation, for instance."""
    ticks: int = 0
    first: FirstDifference | None = None
    rms_deg: dict[str, float] = field(default_factory=dict)
    worst_deg: dict[str, float] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Something was computed, and all of it is identical."""
        return 0 < self.postures == self.identical and not self.unrecorded


def compare(replay: Replay, pairs: Iterable[Recomputed]) -> ReplayFindings:
    """Go through a replay. Joints that were invalid then or are now count in no angle."""
    result = ReplayFindings(replay.joint_names)
    count = len(result.joints)
    squares, seen, worst = np.zeros(count), np.zeros(count), np.zeros(count)
    first_ns: int | None = None
    for pair in pairs:
        first_ns = pair.recorded.sampled_ns if first_ns is None else first_ns
        result.postures += 1
        both = pair.computed.valid & pair.recorded.valid
        apart_deg = np.where(both, np.abs(np.degrees(pair.apart_rad)), 0.0)
        squares, seen, worst = squares + apart_deg**2, seen + both, np.maximum(worst, apart_deg)
        if pair.identical:
            result.identical += 1
        elif result.first is None:
            joint = int(apart_deg.argmax())
            at_s = 1e-9 * (pair.recorded.sampled_ns - first_ns)
            result.first = FirstDifference(
                pair.recorded.tick, at_s, result.joints[joint], float(apart_deg[joint])
            )
    rms = np.sqrt(squares / np.maximum(seen, 1))
    result.rms_deg = {name: float(value) for name, value in zip(result.joints, rms, strict=True)}
    result.worst_deg = {name: float(value) for name, value in zip(result.joints, worst, strict=True)}
    result.skipped, result.unrecorded, result.ticks = replay.skipped, replay.unrecorded, replay.ticks
    return result
