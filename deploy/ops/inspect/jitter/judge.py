"""Names the first stage at which jitter jumps. Pure.

A stage adds jitter if some channel shakes at least twice as much between 3 and 15 Hz as in the stage before.
The nodes have no stage before them: they are judged by how much they shake beside how much they move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from common.errors import RecordingError
from deploy.ops.inspect.jitter.bands import Bands, Signal, bands

LEAST_S = 4.0
"""Less shows too few periods of 3 Hz."""
LONGEST_GAP_S = 0.25
"""A longer silence ends the stretch that is judged: a spline across it would be invented."""
JUMP = 2.0
"""Times the jitter of the stage before."""
FLOOR_RAD_S = 0.02
"""RMS (1.1 °/s): less is not seen on a robot, and an encoder of 12 bits alone makes half of it."""
SHAKY_NODE = 0.5
"""Jitter of a node beside its motion; a person's is below a quarter."""
SHAKY_NODE_RAD_S = 0.1
"""RMS (6 °/s), below which a node that rests is not called shaky for its noise."""


@dataclass(frozen=True, slots=True)
class StageFindings:
    """One stage beside the one before it."""

    stage: str
    rate_hz: float
    velocity_rad_s: tuple[float, float, float]
    """RMS over all channels: below 3 Hz, 3 to 15 Hz, above."""
    acceleration_rad_s2: tuple[float, float, float]
    jump: float
    """Jitter of the channel that jumps most, over that at the stage before; of the first over its motion."""
    channel: str
    """That channel."""
    jumps: bool


@dataclass(frozen=True, slots=True)
class JitterFindings:
    """All stages of one stretch of a recording."""

    stages: tuple[StageFindings, ...]
    from_s: float
    """Of the stretch that is judged, since the recording began."""
    until_s: float
    began_s: float = 0.0
    """When the recording began, on the signals' clock."""

    @property
    def first(self) -> StageFindings | None:
        """The first stage at which jitter jumps; None where none does."""
        return next((stage for stage in self.stages if stage.jumps), None)

    @property
    def words(self) -> str:
        """For people."""
        if self.first is None:
            return "no stage adds jitter"
        first = self.first
        if first is self.stages[0]:
            return f"jitter begins at {first.stage}: {first.channel} shakes {first.jump:.1f} × what it moves"
        before = self.stages[self.stages.index(first) - 1].stage
        what = f"{first.channel} shakes {first.jump:.1f} × what it does at {before}"
        return f"jitter begins at {first.stage}: {what}"


def judge(signals: Sequence[Signal], began_s: float = 0.0) -> JitterFindings:
    """Compare the stages in their order. Raises RecordingError where they share no 4 s without a gap."""
    from_s, until_s = stretch(signals)
    cut = [signal.within(from_s, until_s) for signal in signals]
    found = []
    for before, signal in [(None, cut[0]), *pairwise(cut)]:
        of_stage = bands(signal)
        jump, channel, jumps = _alone(of_stage) if before is None else _jump(before, signal)
        velocity, acceleration = of_stage.total
        found.append(
            StageFindings(signal.stage, signal.rate_hz, velocity, acceleration, jump, channel, jumps)
        )
    return JitterFindings(tuple(found), from_s - began_s, until_s - began_s, began_s)


def stretch(signals: Sequence[Signal]) -> tuple[float, float]:
    """The longest time that all stages share without a gap. Raises RecordingError."""
    if not signals:
        raise RecordingError("no stage of the way is in this recording; record by --tap or with states")
    edges = [(-np.inf, np.inf)]
    for signal in signals:
        breaks = np.flatnonzero(np.diff(signal.time_s) > LONGEST_GAP_S)
        begins = signal.time_s[np.concatenate([[0], breaks + 1])] if len(signal.time_s) else []
        ends = signal.time_s[np.concatenate([breaks, [-1]])] if len(signal.time_s) else []
        runs = list(zip(begins, ends, strict=True))
        edges = [
            (max(a, c), min(b, d)) for a, b in edges for c, d in runs if min(b, d) - max(a, c) >= LEAST_S
        ]
    if not edges:
        raise RecordingError(
            f"the stages ({', '.join(s.stage for s in signals)}) share no {LEAST_S:.0f} s without a gap in "
            "which the robot follows; record for longer"
        )
    from_s, until_s = max(edges, key=lambda edge: edge[1] - edge[0])
    return float(from_s), float(until_s)


def _alone(of_stage: Bands) -> tuple[float, str, bool]:
    """The first stage, by itself."""
    share = {
        name: of_stage.jitter(name) / np.hypot(of_stage.motion(name), FLOOR_RAD_S)
        for name in of_stage.velocity_rad_s
    }
    shaky = {n: s for n, s in share.items() if s > SHAKY_NODE and of_stage.jitter(n) > SHAKY_NODE_RAD_S}
    most = max(shaky or share, key=share.__getitem__)
    return float(share[most]), most, bool(shaky)


def _jump(before: Signal, signal: Signal) -> tuple[float, str, bool]:
    """How much more the stage shakes than the one before it, at the worst channel that both have.

    Both keep the time that lies within both: a spline does not reach beyond its ends.
    """
    from_s, until_s = (
        max(before.time_s[0], signal.time_s[0]),
        min(before.time_s[-1], signal.time_s[-1]),
    )
    before, signal = before.within(from_s, until_s), signal.within(from_s, until_s)
    if before.rate_hz > 1.5 * signal.rate_hz:
        inside = (signal.time_s >= before.time_s[0]) & (signal.time_s <= before.time_s[-1])
        before = before.at(signal.time_s[inside])
    if not set(before.channels) & set(signal.channels):
        if before.between is None or signal.between is None:
            raise RecordingError(f"{before.stage} and {signal.stage} have no joint or segment in common")
        before, signal = before.between, signal.between
    earlier, later = bands(before), bands(signal)
    ratios = {
        name: np.hypot(later.jitter(name), FLOOR_RAD_S) / np.hypot(earlier.jitter(name), FLOOR_RAD_S)
        for name in later.velocity_rad_s
        if name in earlier.velocity_rad_s
    }
    most = max(ratios, key=ratios.__getitem__)
    return float(ratios[most]), most, bool(ratios[most] >= JUMP)
