"""What a step of the guided calibration takes and gives: windows of readings, and each node's progress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.calibrate.live.hints import HINTS

WINDOW_S = 0.25
"""Readings are judged over windows this long."""
STILL_GYR_RAD_S = 0.03
"""Standard deviation within a window, of one axis: noise is a tenth of it, a hand's tremor more."""
STILL_ACC_M_S2 = 0.2


@dataclass(frozen=True, slots=True)
class NodeProgress:
    """One node in the step that is on."""

    share: float
    """0 to 1: of what is wanted."""
    hint: str
    """A name of `HINTS`."""
    places: Mapping[str, str] = field(default_factory=dict)
    """The figures in it."""

    @property
    def text(self) -> str:
        """The hint in English."""
        return HINTS[self.hint].format(**self.places)


@dataclass(frozen=True, slots=True)
class ReadingsWindow:
    """A stretch of readings, summed up: N nodes."""

    seconds: float
    answered: Mask
    """(N,) at least half of the time."""
    mean: Array
    """(N, 9)."""
    deviation: Array
    """(N, 9)."""

    @property
    def still(self) -> Mask:
        """(N,)."""
        calm = (self.deviation[:, 3:6] < STILL_GYR_RAD_S).all(axis=1)
        out: Mask = calm & (self.deviation[:, 0:3] < STILL_ACC_M_S2).all(axis=1) & self.answered
        return out


def summed_up(readings: Array, rate_hz: float) -> ReadingsWindow:
    """A window of readings (K, N, 9), NaN where a node did not answer."""
    there = np.isfinite(readings[:, :, 3])
    share = there.mean(axis=0)
    answered = share >= 0.5
    known = np.where(there[:, :, None], readings, 0.0)
    count = np.maximum(there.sum(axis=0), 1)[:, None]
    mean = known.sum(axis=0) / count
    square = np.where(there[:, :, None], (readings - mean) ** 2, 0.0).sum(axis=0) / count
    return ReadingsWindow(len(readings) / rate_hz, answered, mean, np.sqrt(square))


class Step(Protocol):
    """One thing the person is asked to do."""

    title: str
    todo: str

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
