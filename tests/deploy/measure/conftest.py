from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from common.quaternion import Array
from deploy.measure import MovedSeries, SolvedSeries, TruthSeries

NAMES = ("left_shoulder_pitch", "left_elbow_pitch", "right_shoulder_pitch", "neck_yaw")
TICK_NS = 5_000_000


def reach_rad(time_s: Array) -> Array:
    """(T,) minimum-jerk reaches of 60° out and back, 1 s each, with 0.5 s of rest after each."""
    phase = np.mod(time_s, 3.0)

    def blend(u: Array) -> Array:
        u = np.clip(u, 0.0, 1.0)
        curve: Array = u**3 * (10 - 15 * u + 6 * u * u)
        return curve

    angle: Array = np.radians(60.0) * (blend(phase) - blend(phase - 1.5))
    return angle


def posture(time_s: Array) -> Array:
    """(T, 4) three joints that reach by different amounts, and one that stays."""
    reach = reach_rad(time_s)
    return np.column_stack([reach, 0.5 * reach, -0.8 * reach, np.zeros_like(reach)])


class Run:
    """A synthetic run of known truth; each series can be disturbed."""

    names = NAMES

    def __init__(self, seconds: float = 20.0) -> None:
        self.ticks: NDArray[np.int64] = np.arange(round(seconds * 200), dtype=np.int64)
        self.at = posture

    def truth(self) -> TruthSeries:
        return TruthSeries(self.ticks, self.ticks * TICK_NS, self.at(0.005 * self.ticks.astype(np.float64)))

    def solved(self, error_rad: float = 0.0, late_s: float = 0.0) -> SolvedSeries:
        ticks = self.ticks[::16]
        position = self.at(0.005 * ticks.astype(np.float64) - late_s) + error_rad
        return SolvedSeries(ticks, position, np.ones(position.shape, np.bool_))

    def moved(
        self, late_s: float = 0.0, change: Callable[[Array], Array] = lambda position: position
    ) -> MovedSeries:
        # odd instants, so that nothing falls on a tick
        at_ns = np.arange(700_001, int(self.ticks[-1]) * TICK_NS, 20_000_000, dtype=np.int64)
        position = change(self.at(1e-9 * at_ns.astype(np.float64) - late_s))
        everywhere = np.ones(position.shape, np.bool_)
        return MovedSeries(at_ns, position, everywhere, everywhere[:, 0])


@pytest.fixture
def run() -> Run:
    return Run()
