"""How far hands went after the last command before an outage, against what the robot had foretold. Pure."""

from __future__ import annotations

import itertools
import statistics
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
STOPS_S = 0.6
"""By then at the latest it was seen to brake, and the states until then must have come."""
GAP_S = 0.1
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


@dataclass(frozen=True, slots=True)
class BlindFigures:
    """Over some outages; None where there was none, or no way that was long enough."""

    outages: int
    excess_cm: float | None
    """Measured less foretold, at worst: above 0 the robot promised too little."""
    share: float | None
    """Measured over foretold, median."""
    farthest_cm: float | None


def blind_figures(found: Sequence[BlindOutage]) -> BlindFigures:
    """The worst, the usual and the farthest."""
    shares = [one.share for one in found if one.share is not None]
    return BlindFigures(
        len({one.accepted_ns for one in found}),
        max((100.0 * (one.measured_m - one.foretold_m) for one in found), default=None),
        statistics.median(shares) if shares else None,
        max((100.0 * one.measured_m for one in found), default=None),
    )


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
    heard = np.flatnonzero((at_ns >= at_ns[first]) & (at_ns <= accepted_ns + to_ns(STOPS_S)))
    if at_ns[-1] < accepted_ns + to_ns(STOPS_S) or np.diff(at_ns[heard]).max(initial=0) > to_ns(GAP_S):
        return []  # not seen whole
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
