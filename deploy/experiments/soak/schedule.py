"""The plan of a soak's faults: each kind in turn, in random order, at random distances. Pure; seeded."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

SETTLE_S = 10.0
"""No fault comes before this, so that undisturbed operation is seen first."""
TAIL_S = 12.0
"""No fault comes in the last seconds, so that the last recovery is seen."""
SPREAD = 0.25
"""Distances vary by this share."""
CALM_FROM_S = 20.0 * 60.0
"""A soak at least this long ends with a calm part."""
CALM_SHARE = 0.4
"""Share of a long soak, at its end, in which no process is ended: only long lives show slow growth."""
SHORTEST_S, LONGEST_S, TIMES_EACH = 20.0, 120.0, 2
"""Without `--every`: each kind comes twice, but faults are no closer and no farther apart than this."""


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """One fault to come."""

    at_s: float
    """Since the robot first followed."""
    fault: str


def distance_s(duration_s: float, kinds: int) -> float:
    """Mean time between faults, without `--every`."""
    return min(LONGEST_S, max(SHORTEST_S, duration_s / max(1, TIMES_EACH * kinds)))


def calm_from_s(duration_s: float) -> float:
    """When the calm part begins, in which no process is ended; the end where the soak is too short for it."""
    return duration_s * (1.0 - CALM_SHARE) if duration_s >= CALM_FROM_S else duration_s


def schedule(
    duration_s: float, kinds: Sequence[str], enders: Sequence[str], every_s: float, seed: int
) -> list[PlannedFault]:
    """Faults in the order of time: rounds of all kinds, shuffled each time anew.

    `enders`: the kinds that end a process; they do not come in the calm part. Same arguments, same plan.
    """
    draw = random.Random(seed)
    calm_s = calm_from_s(duration_s)
    planned: list[PlannedFault] = []
    waiting: list[str] = []
    at_s = SETTLE_S
    while True:
        allowed = [kind for kind in kinds if at_s < calm_s or kind not in enders]
        waiting = [kind for kind in waiting if kind in allowed]
        if not waiting:
            waiting = draw.sample(allowed, len(allowed))
        if not waiting or at_s > duration_s - TAIL_S:
            return planned
        planned.append(PlannedFault(round(at_s, 3), waiting.pop()))
        at_s += every_s * draw.uniform(1.0 - SPREAD, 1.0 + SPREAD)
