"""Whether a node's readings come later than its neighbours': a clock or a queue of its own.

Two neighbours' joint centre moves but once (`neighbours.py`), so their accelerations fit best at the same
instant. One is moved against the other sample by sample; a parabola through the best three finds the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from master.calibrate.evidence import CrossCheck, at_most, not_judged
from master.calibrate.joint_residuals import Moving
from master.calibrate.neighbours import centre_misfit
from master.calibrate.oriented import rows_moving

_MOST_S = 1.0
_MOST_ROWS = 600
_FEWEST_ROWS = 60
WORST_LAG_S = 0.025
"""A real person's joints are found within 0.018 s, simulated ones within 0.008 s."""
_SHARP = 1.2
"""Two samples beside the best, the misfit is to be so many times larger: else the motion does not tell."""
_COMPARED = "its readings' time against its neighbours'"


@dataclass(frozen=True, slots=True)
class Lag:
    """By how much a joint's child comes later than its parent."""

    seconds: float
    gain: float
    """How many times better both fit with it taken off."""


def joint_lag(parent: Moving, child: Moving, spacing_s: float) -> Lag | None:
    """None where the motion does not tell."""
    most = round(_MOST_S / spacing_s)
    if len(rows_moving(parent, child)) < _FEWEST_ROWS or len(parent.r) < 4 * most:
        return None
    squared = np.array([_misfit(parent, child, k) ** 2 for k in range(-most, most + 1)])
    best = int(np.argmin(squared))
    if not 2 <= best <= 2 * most - 2:
        return None
    before, there, after = squared[best - 1 : best + 2].tolist()
    if min(squared[best - 2], squared[best + 2]) < _SHARP**2 * there:
        return None
    part = 0.5 * (before - after) / (before - 2.0 * there + after)
    return Lag((best - most + part) * spacing_s, math.sqrt(squared[most] / there))


def check_lags(
    names: Sequence[str], links: Sequence[tuple[int, int]], lags: Sequence[Lag | None]
) -> dict[str, tuple[CrossCheck, float]]:
    """Of every node the evidence, and the logarithm of what taking its lag off gains in all its joints.

    A joint that lags blames the end that has fewer joints in order; of two alike the child.
    """
    late: dict[int, list[float]] = {i: [] for i in range(len(names))}
    good, judged = dict.fromkeys(late, 0), dict.fromkeys(late, 0)
    for link, lag in zip(links, lags, strict=True):
        if lag is not None:
            for end in link:
                judged[end] += 1
                good[end] += abs(lag.seconds) <= WORST_LAG_S
    gains = dict.fromkeys(late, 0.0)
    for (parent, child), lag in zip(links, lags, strict=True):
        if lag is None or abs(lag.seconds) <= WORST_LAG_S:
            continue
        share = {end: good[end] / judged[end] for end in (parent, child)}
        blamed = child if share[child] < share[parent] or _alone(share, judged, parent, child) else parent
        late[blamed].append(lag.seconds if blamed == child else -lag.seconds)
        gains[blamed] += math.log(lag.gain)
    return {
        names[i]: (_evidence(float(np.median(late[i])) if late[i] else 0.0, judged[i]), gains[i])
        for i in range(len(names))
    }


def _alone(share: dict[int, float], judged: dict[int, int], parent: int, child: int) -> bool:
    """Both ends are equally bad: the one with more joints that say so is to blame, of two alike the child."""
    return share[child] == share[parent] and judged[child] >= judged[parent]


def _evidence(seconds: float, judged: int) -> CrossCheck:
    if not judged:
        return not_judged(_COMPARED, "no joint of it moved enough")
    later = "later" if seconds > 0.0 else "earlier"
    return at_most(
        _COMPARED,
        abs(seconds),
        WORST_LAG_S,
        "s",
        advice=f"its readings come {1e3 * abs(seconds):.0f} ms {later} than its neighbours'; look at its "
        "clock, its filter's delay or its bus, and record again",
    )


def _misfit(parent: Moving, child: Moving, later: int) -> float:
    length = len(parent.r)
    one = _cut(parent, max(0, -later), length - max(0, later))
    two = _cut(child, max(0, later), length - max(0, -later))
    rows = rows_moving(one, two)
    rows = rows[:: max(1, len(rows) // _MOST_ROWS)]
    return max(1e-9, centre_misfit(one.some(rows), two.some(rows))) if len(rows) else math.inf


def _cut(unit: Moving, begin: int, end: int) -> Moving:
    part = slice(begin, end)
    return replace(unit, r=unit.r[part], rate=unit.rate[part], acc=unit.acc[part], lever=unit.lever[part])
