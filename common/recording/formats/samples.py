"""What a reader takes and gives: each unit's samples with the stamps that its file has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from common.quaternion import Array

ACC, GYR, MAG, QUAT, POSITION, MOVEMENT = "acc", "gyr", "mag", "quat", "position", "movement"
WIDTHS = {ACC: 3, GYR: 3, MAG: 3, QUAT: 4, POSITION: 3, MOVEMENT: 1}
"""Numbers of one sample of each quantity."""
TIME = "time"


@dataclass(frozen=True, slots=True)
class SensorSeries:
    """One quantity of one unit, sample by sample."""

    values: Array
    """(T, width): m/s², rad/s, µT, wxyz, m; NaN where a number is missing."""
    time_s: Array | None = None
    """(T,) stamps, s, NaN where one is missing; None where the samples are even at the unit's rate."""
    stamps: str = "time"
    """What the file calls its stamps."""


@dataclass(frozen=True, slots=True)
class UnitSamples:
    """One unit's samples, by quantity (ACC, GYR, …)."""

    name: str
    series: Mapping[str, SensorSeries]
    rate_hz: float | None = None
    """Of series without stamps."""
    counts: bool = False
    """True: raw counts of a converter, of which the unit is not known."""
    assumed: frozenset[str] = frozenset()
    """Quantities of which the file tells no unit, taken as SI."""


@dataclass(frozen=True, slots=True)
class ReadFile:
    """What is in one file, and what was assumed, converted or dropped, for a person."""

    units: tuple[UnitSamples, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What a person says about a file; it goes before what the file says and what is guessed."""

    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Columns by quantity, or `NODE.quantity`, in the order of its axes."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Unit by quantity, such as acc: g."""
    rate_hz: float | None = None
    """Of a file without times."""
