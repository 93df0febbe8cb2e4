"""Nodes that answer with wrong readings: what inertial units give when they, or the bus to them, have failed.

| kind | what it plays |
|---|---|
| `frozen` | an I²C bus that hangs: the controller goes on sending what it read last |
| `zero` | a unit without power, asleep, or after a reset by itself (MPU-6050: PWR_MGMT_1 sleeps it) |
| `ones` | a bus that nothing drives: pulled up, it reads 0xFFFF, which is −1 |
| `stuck` | one axis that stands, the others live |
| `dead_gyro` | a gyro whose drive has stopped: its bias and its noise, whatever the node does |
| `saturated` | the end of the range, on one axis or, without `axis`, on all of a sensor |
| `flipped_gyro` | all signs of the gyro, or that of one axis, wrong |
| `swapped_gyro` | its x and y exchanged |
| `rescaled` | the unit started anew with another range: accelerometer and gyro by `factor` |
| `self_test` | the self-test left on: a constant force on each axis of both (some 0.5 g and 30 °/s) |
| `biased_gyro` | a gyro that reads `offset` °/s more on each axis: a shock, cold, or never calibrated |
| `magnetised` | a magnetometer with iron stuck to it: `offset` µT more on each axis, turning with it |
| `frozen_mag`, `overflow_mag` | the magnetometer alone: one reading for ever; −4096 on one axis (HMC5883L) |
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from common.quaternion import Array
from deploy.sim.suit.imperfections import Counts
from deploy.sim.suit.span import TimeSpan
from master.suit.protocol import MAG_OVERFLOW, NodeStatus

WrongReadingKind = Literal[
    "frozen", "zero", "ones", "stuck", "dead_gyro", "saturated", "flipped_gyro", "swapped_gyro", "rescaled",
    "self_test", "biased_gyro", "magnetised", "frozen_mag", "overflow_mag",
]  # fmt: skip
_ACC, _GYR, _MAG = slice(0, 3), slice(3, 6), slice(6, 9)
_SELF_TEST_M_S2, _SELF_TEST_RAD_S = 5.0, math.radians(30.0)


class WrongReading(TimeSpan):
    """`[[faults.wrong_reading]]`: a node whose answers are sound frames with wrong content."""

    node: str
    """Its segment."""
    kind: WrongReadingKind
    axis: int | None = Field(default=None, ge=0, le=8)
    """Accelerometer 0–2, gyro 3–5, magnetometer 6–8, for the kinds that concern one axis."""
    factor: float = Field(default=2.0, gt=0.0, le=16.0)
    """For `rescaled`."""
    offset: float = Field(default=20.0, ge=-1000.0, le=1000.0)
    """For `biased_gyro` °/s, for `magnetised` µT."""


class WrongReadings:
    """Wrong readings: what such nodes last read, and what they send instead of the present readings."""

    def __init__(self, names: tuple[str, ...], scale: Array, seed: int) -> None:
        self._row = {name: row for row, name in enumerate(names)}
        self._scale = scale
        self._random = np.random.default_rng([seed, 3])
        self._began: dict[WrongReading, Counts] = {}

    def apply(
        self, wrong: list[WrongReading], counts: Counts, status: NDArray[np.int64], t_s: float
    ) -> tuple[Counts, NDArray[np.int64]]:
        """Counts (N, 9) and status (N,) as they are sent; those given are not changed."""
        active = [each for each in wrong if each.includes(t_s) and each.node in self._row]
        self._began = {each: held for each, held in self._began.items() if each in active}
        if not active:
            return counts, status
        counts, status = counts.copy(), status.copy()
        for each in active:
            row = self._row[each.node]
            held = self._began.setdefault(each, counts[row].copy())
            counts[row] = self._reported(each, counts[row], held)
            if each.kind == "saturated":
                status[row] |= int(NodeStatus.SATURATED)
        return counts, status

    def _reported(self, wrong: WrongReading, now: Counts, held: Counts) -> Counts:
        out = now.copy()
        if wrong.kind == "frozen":
            out[:] = held
        elif wrong.kind in ("zero", "ones"):
            out[:] = 0 if wrong.kind == "zero" else -1
        elif wrong.kind == "stuck":
            out[_one(wrong, 4)] = held[_one(wrong, 4)]
        elif wrong.kind == "dead_gyro":
            out[_GYR] = np.rint(self._random.normal(0.0, 0.8, 3))
        elif wrong.kind == "saturated":
            out[slice(0, 6) if wrong.axis is None else wrong.axis] = 32767
        elif wrong.kind == "flipped_gyro":
            turned = _GYR if wrong.axis is None else slice(wrong.axis, wrong.axis + 1)
            out[turned] = np.clip(-out[turned].astype(np.int32), -32767, 32767)
        elif wrong.kind == "swapped_gyro":
            out[_GYR] = now[[4, 3, 5]]
        elif wrong.kind == "rescaled":
            out[:6] = np.clip(np.rint(now[:6] * wrong.factor), -32767, 32767)
        elif wrong.kind == "self_test":
            force = np.repeat([_SELF_TEST_M_S2, _SELF_TEST_RAD_S], 3) / self._scale[:6]
            out[:6] = np.clip(np.rint(now[:6] + force), -32767, 32767)
        elif wrong.kind == "biased_gyro":
            out[_GYR] = _more(now[_GYR], math.radians(wrong.offset) / self._scale[_GYR])
        elif wrong.kind == "magnetised":
            out[_MAG] = _more(now[_MAG], wrong.offset / self._scale[_MAG])
        elif wrong.kind == "frozen_mag":
            out[_MAG] = held[_MAG]
        else:
            out[_one(wrong, 6)] = MAG_OVERFLOW
        return out


def _more(counts: Counts, offset: Array) -> Array:
    """Counts with an offset, as far as the range goes."""
    return np.clip(np.rint(counts + offset), -32767, 32767)


def _one(wrong: WrongReading, default: int) -> int:
    return default if wrong.axis is None else wrong.axis
