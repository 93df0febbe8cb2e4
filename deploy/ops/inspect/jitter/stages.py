"""All stages that some recordings hold together, in the order in which a motion passes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common.clock import NS_PER_S, to_ns
from common.recording import RecordingStream
from common.skeleton import Skeleton
from deploy.ops.inspect.jitter.bands import Signal
from deploy.ops.inspect.jitter.judge import JitterFindings, judge
from deploy.ops.inspect.jitter.operator_side import operator_stages
from deploy.ops.inspect.jitter.robot_side import robot_stages
from deploy.recorded.files import head_of
from master.journal.context import CONFIG

ORDER = ("nodes", "fused", "solved", "received", "tracked", "limited", "encoders")
LEAD_S = 1.0
"""Before the robot is first heard to follow."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Which part of the recording is looked at, in seconds since it began."""

    from_s: float
    seconds: float


def jitter_of(
    files: Sequence[Path], skeleton: Skeleton, part: Stretch
) -> tuple[JitterFindings, list[Signal]]:
    """Judge some recordings of the same time: of a master, a slave or the link. Raises RecordingError."""
    began_wall_ns = min(_first(path)[0] for path in files)
    from_ns = began_wall_ns + to_ns(part.from_s)
    until_ns = from_ns + to_ns(part.seconds)
    found: dict[str, Signal] = {}
    # a slave's own file has more of the robot than what its master heard of it: it comes last and stands
    for path in sorted(files, key=lambda path: CONFIG not in head_of(path)):
        if CONFIG in head_of(path):
            wall_ns, monotonic_ns = _first(path)
            shift_ns = wall_ns - monotonic_ns
            found |= {
                signal.stage: signal
                for signal in operator_stages([path], from_ns - shift_ns, until_ns - shift_ns, shift_ns)
            }
        found |= robot_stages([path], skeleton, from_ns, until_ns)
    signals = [found[stage] for stage in ORDER if stage in found]
    return judge(signals, began_wall_ns / NS_PER_S), signals


def _first(path: Path) -> tuple[int, int]:
    """Time of day and monotonic clock of a file's first message."""
    return next(((entry.wall_ns, entry.monotonic_ns) for entry in RecordingStream(path)), (0, 0))
