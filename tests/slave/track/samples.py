"""One joint's samples at the rate of commands, and what a strategy makes of them."""

import numpy as np

from common.quaternion import Array
from slave.track import Tracker

MS = 1_000_000
PERIOD, TRANSIT = 80, 12
"""ms."""


def feed(tracker: Tracker, k: int, position: float, velocity: float, transit: int = TRANSIT) -> None:
    """Give it sample number `k`, which was under way for `transit` ms."""
    tracker.accept(PERIOD * k * MS, (PERIOD * k + transit) * MS, np.array([position]), np.array([velocity]))


def course(tracker: Tracker, at_ms: float) -> tuple[Array, Array]:
    """(1,) the target's position and velocity at a time."""
    target = tracker.target(round(at_ms * MS))
    assert target is not None
    return target.position_rad, target.velocity_rad_s
