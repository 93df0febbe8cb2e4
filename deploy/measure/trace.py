"""What a run leaves behind to be judged: three series of joint angles, each with its own key or clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Command, Mask, RobotState, Truth

Ticks = NDArray[np.int64]
Nanoseconds = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TruthSeries:
    """The operator's true joint angles, one row a capture tick."""

    tick: Ticks
    """(T,)"""
    sampled_ns: Nanoseconds
    """(T,) the suit's clock; `motion` needs it to be the encoders' clock too (one host)."""
    position_rad: Array
    """(T, J)"""


@dataclass(frozen=True, slots=True)
class SolvedSeries:
    """What the master solved, one row a command."""

    tick: Ticks
    """(T,) the capture tick that decided the command."""
    position_rad: Array
    """(T, J)"""
    valid: Mask
    """(T, J) False where a joint's nodes were lost."""


@dataclass(frozen=True, slots=True)
class MovedSeries:
    """What the encoders read, one row a reading."""

    encoder_ns: Nanoseconds
    """(T,) the slave's clock."""
    position_rad: Array
    """(T, J)"""
    valid: Mask
    """(T, J) False where an encoder did not answer."""
    tracking: Mask
    """(T,) True while the guard was in `track`."""


class Trace:
    """Gathers the three series from the messages of a run. It grows with the run: about 50 kB a second."""

    def __init__(self, joint_names: Sequence[str]) -> None:
        self.joint_names = tuple(joint_names)
        self._truth: list[Truth] = []
        self._solved: list[Command] = []
        self._moved: list[RobotState] = []

    def add(self, message: Truth | Command | RobotState) -> None:
        """Keep one message, in any order of kinds."""
        if isinstance(message, Truth):
            self._truth.append(message)
        elif isinstance(message, Command):
            self._solved.append(message)
        else:
            self._moved.append(message)

    def truth(self) -> TruthSeries:
        """The operator's angles so far."""
        rows = self._truth
        return TruthSeries(
            tick=_integers([m.tick for m in rows]),
            sampled_ns=_integers([m.sampled_ns for m in rows]),
            position_rad=self._table([m.position_rad for m in rows]),
        )

    def solved(self) -> SolvedSeries:
        """The commands so far."""
        rows = self._solved
        return SolvedSeries(
            tick=_integers([m.tick for m in rows]),
            position_rad=self._table([m.position_rad for m in rows]),
            valid=self._table([m.valid for m in rows]).astype(np.bool_),
        )

    def moved(self) -> MovedSeries:
        """The encoder readings so far."""
        rows = self._moved
        return MovedSeries(
            encoder_ns=_integers([m.encoder_ns for m in rows]),
            position_rad=self._table([m.position_rad for m in rows]),
            valid=self._table([m.encoder_valid for m in rows]).astype(np.bool_),
            tracking=np.array([m.guard == "track" for m in rows], dtype=np.bool_),
        )

    def _table(self, rows: Sequence[Array | Mask]) -> Array:
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.joint_names))


def _integers(values: list[int]) -> NDArray[np.int64]:
    return np.array(values, dtype=np.int64)
