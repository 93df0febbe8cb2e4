"""The registry of orientation filters, and a bank in which each node has the filter that it names.

To add a filter, add its section to `FILTERS`; nothing else changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from common.config.section import make_section
from common.errors import ConfigMistake
from common.quaternion import Array
from common.wire.messages import Mask
from master.orientation.ekf import EkfConfig
from master.orientation.filter import FilterSection, OrientationFilter
from master.orientation.fused import FUSED, FusedConfig, GivenOrientation
from master.orientation.mahony import MahonyConfig
from master.orientation.vqf import VqfConfig
from master.suit.doubt import NodeDoubt

Number = TypeVar("Number", bound=np.generic)

FILTERS: dict[str, type[FilterSection]] = {"vqf": VqfConfig, "mahony": MahonyConfig, "ekf": EkfConfig}
"""By name: `filter = "vqf"` selects a filter, `[estimation.vqf]` holds its parameters."""


def filter_mistakes(key: str, name: str) -> list[ConfigMistake]:
    """A mistake at `key` if no filter has that name."""
    return [] if name in FILTERS else [ConfigMistake(key, name, f"one of {', '.join(FILTERS)}")]


def read_sections(tables: Mapping[str, object], context: object = None) -> dict[str, FilterSection]:
    """The section of every filter, from `tables` or with defaults. Raises pydantic.ValidationError."""
    sections = make_section("FilterSections", {name: (kind, kind()) for name, kind in FILTERS.items()})
    return dict(sections.model_validate(tables, context=context))


class FilterBank:
    """N nodes, each filtered by the filter it names; itself an `OrientationFilter`."""

    def __init__(self, names: Sequence[str], sections: Mapping[str, FilterSection], rate_hz: float) -> None:
        """`names` holds one filter's name for each node, `sections` the parameters of each filter."""
        self._count = len(names)
        self._parts: list[tuple[NDArray[np.intp] | slice, OrientationFilter]] = []
        for name in dict.fromkeys(names):
            rows = np.flatnonzero([n == name for n in names])
            section = FusedConfig() if name == FUSED else sections[name]
            filter_ = section.make(rate_hz, len(rows))
            # a slice where all share one filter: nothing is then copied
            self._parts.append((slice(None) if len(rows) == self._count else rows, filter_))

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """One tick's readings, (N, 3) each."""
        for rows, part in self._parts:
            part.update(gyr_rad_s[rows], acc_m_s2[rows], mag_ut[rows], dt_s)

    def give(self, q_world_from_sensor: Array) -> None:
        """Orientations (N, 4) of this tick that units have fused themselves; NaN for the others."""
        for rows, part in self._parts:
            if isinstance(part, GivenOrientation):
                part.give(q_world_from_sensor[rows])

    def _gathered(self, read: Callable[[OrientationFilter], NDArray[Number]]) -> NDArray[Number]:
        """What every filter says of its nodes, (N, ...)."""
        parts = [(rows, read(part)) for rows, part in self._parts]
        out = np.empty((self._count, *parts[0][1].shape[1:]), parts[0][1].dtype)
        for rows, values in parts:
            out[rows] = values
        return out

    def q_world_from_sensor(self) -> Array:
        """Orientations (N, 4)."""
        return self._gathered(lambda part: part.q_world_from_sensor())

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (N, 4) without the magnetometers."""
        return self._gathered(lambda part: part.q_inertial_from_sensor())

    def bias_rad_s(self) -> Array:
        """Gyro biases (N, 3)."""
        return self._gathered(lambda part: part.bias_rad_s())

    def undecided(self) -> Mask:
        """(N,) nodes whose rate may be a bias that is not learnt yet."""
        return self._gathered(lambda part: part.undecided())

    def doubts(self) -> dict[int, NodeDoubt]:
        """Doubted nodes by their number among all N."""
        out = {}
        for rows, part in self._parts:
            places = np.arange(self._count)[rows].tolist()
            out.update({places[node]: doubt for node, doubt in part.doubts().items()})
        return out

    @property
    def spoilt(self) -> Mask | None:
        """(N,), or None where no node had an unusable reading."""
        out = None
        for rows, part in self._parts:
            spoilt = part.spoilt
            if spoilt is not None:
                out = np.zeros(self._count, dtype=np.bool_) if out is None else out
                out[rows] = spoilt
        return out

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(N,) ticks with an unusable reading."""
        return self._gathered(lambda part: part.skipped)

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (N,)."""
        for rows, part in self._parts:
            part.restart(nodes[rows])
