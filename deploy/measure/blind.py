"""How far hands went after the last command before an outage, against what the robot had foretold. Pure."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import to_ns
from common.skeleton import Skeleton
from common.wire.messages import RobotState
from slave.model.ends import LimbEnds, limb_ends

MOVING = ("align", "track")
STANDS_S = 1.5
"""After the last command every joint stands, the servos' settling included."""
LEAST_M = 0.02
"""A share of a way that was foretold shorter says nothing."""
_NO_COMMAND = "no command"
"""The guard's words for this loss begin so."""


@dataclass(frozen=True, slots=True)
class BlindOutage:
    """One hand in one outage."""

    accepted_ns: int
    """Slave's clock: the last command."""
    hand: str
    foretold_m: float
    measured_m: float
    """At the encoders."""

    @property
    def share(self) -> float | None:
        """Measured over foretold; None where that is too short to tell."""
        return self.measured_m / self.foretold_m if self.foretold_m >= LEAST_M else None


def blind_outages(states: Sequence[RobotState], skeleton: Skeleton) -> list[BlindOutage]:
    """Of every hold for want of commands in a robot's states, in their order."""
    ends = limb_ends(skeleton)
    found = []
    for before, after in itertools.pairwise(states):
        lost = before.guard in MOVING and after.guard == "hold" and after.reason.startswith(_NO_COMMAND)
        if lost and before.echo is not None and before.blind_m:
            found += _outage(states, before, ends)
    return found


def _outage(states: Sequence[RobotState], last: RobotState, ends: LimbEnds) -> list[BlindOutage]:
    assert last.echo is not None
    accepted_ns = last.echo.accepted_ns
    at_ns = np.array([state.encoder_ns for state in states])
    first = max(int(np.searchsorted(at_ns, accepted_ns)) - 1, 0)
    begin_ns, next_ns = at_ns[first], at_ns[min(first + 1, len(at_ns) - 1)]
    share = 0.0 if next_ns <= begin_ns else (accepted_ns - begin_ns) / (next_ns - begin_ns)
    begin = states[first].position_rad
    begin = begin + min(max(share, 0.0), 1.0) * (states[first + 1].position_rad - begin)
    begin_m = ends.at(begin)
    way_m = np.zeros(len(ends.names))
    held = False
    for state in states[first + 1 :]:
        held |= state.guard not in MOVING
        if state.encoder_ns > accepted_ns + to_ns(STANDS_S) or (held and state.guard in MOVING):
            break
        way_m = np.maximum(way_m, np.linalg.norm(ends.at(state.position_rad) - begin_m, axis=1))
    hands = zip(ends.names, last.blind_m, way_m.tolist(), strict=True)
    return [BlindOutage(accepted_ns, *hand) for hand in hands]
