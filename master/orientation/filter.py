"""The one interface of the orientation filters, and a bank in which each node has the filter it asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask
from master.suit.doubt import NodeDoubt

FilterName = Literal["vqf", "mahony", "ekf"]
"""What a TOML calls the filters; `filters.py` makes them."""


class OrientationFilter(Protocol):
    """Estimates the orientations of n nodes at once from their calibrated readings, one tick at a time."""

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """Take one tick's readings, (n, 3) each, sensor frame. A NaN row of `mag_ut` has no magnetometer.

        `dt_s` is the time since the update before, None for the nominal period. A node's first readings
        after its start set its orientation at once.
        """

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4), world east-north-up; heading arbitrary without a magnetometer."""

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (n, 4) without the magnetometer: upright by gravity, heading by the gyro alone.

        They differ from `q_world_from_sensor` by a turn about the vertical, whose angle drifts slowly.
        """

    def bias_rad_s(self) -> Array:
        """What the filter takes for the gyros' bias, (n, 3): the true rate is the reading minus this."""

    def undecided(self) -> Mask:
        """(n,) whose steady rate may be a bias that is not learnt, so that it says nothing of a motion."""

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes that the filter does not, or not wholly, believe, by their number."""

    @property
    def spoilt(self) -> Mask | None:
        """(n,) who had a reading that was none in the last update; None for nobody."""

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(n,) ticks with a reading that was none (NaN, infinite, absurd), which was left out."""

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""

    def snapshot(self) -> object:
        """The whole state, to be given to `restore`; later updates do not change it."""

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot that a filter of the same kind and size took."""


MakeFilter = Callable[[int], OrientationFilter]
"""Makes a filter for that many nodes."""


class FilterBank:
    """N nodes, each filtered by the filter it names; itself an `OrientationFilter`."""

    def __init__(self, names: Sequence[str], make: Mapping[str, MakeFilter]) -> None:
        self._count = len(names)
        self._parts: list[tuple[NDArray[np.intp] | slice, OrientationFilter]] = []
        for name in dict.fromkeys(names):
            rows = np.flatnonzero([n == name for n in names])
            # a slice where all share one filter: nothing is then copied
            self._parts.append((slice(None) if len(rows) == self._count else rows, make[name](len(rows))))

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """One tick's readings, (N, 3) each."""
        for rows, part in self._parts:
            part.update(gyr_rad_s[rows], acc_m_s2[rows], mag_ut[rows], dt_s)

    def q_world_from_sensor(self) -> Array:
        """Orientations (N, 4)."""
        out = np.empty((self._count, 4))
        for rows, part in self._parts:
            out[rows] = part.q_world_from_sensor()
        return out

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (N, 4) without the magnetometers."""
        out = np.empty((self._count, 4))
        for rows, part in self._parts:
            out[rows] = part.q_inertial_from_sensor()
        return out

    def bias_rad_s(self) -> Array:
        """Gyro biases (N, 3)."""
        out = np.empty((self._count, 3))
        for rows, part in self._parts:
            out[rows] = part.bias_rad_s()
        return out

    def undecided(self) -> Mask:
        """(N,) whose rate may be a bias that is not learnt."""
        out = np.zeros(self._count, dtype=np.bool_)
        for rows, part in self._parts:
            out[rows] = part.undecided()
        return out

    def doubts(self) -> dict[int, NodeDoubt]:
        """Doubted nodes by their number among all N."""
        out = {}
        for rows, part in self._parts:
            places = np.arange(self._count)[rows].tolist()
            out.update({places[node]: doubt for node, doubt in part.doubts().items()})
        return out

    @property
    def spoilt(self) -> Mask | None:
        """(N,), or None for nobody."""
        out = None
        for rows, part in self._parts:
            spoilt = part.spoilt
            if spoilt is not None:
                out = np.zeros(self._count, dtype=np.bool_) if out is None else out
                out[rows] = spoilt
        return out

    @property
    def skipped(self) -> NDArray[np.int64]:
        """(N,)."""
        out = np.zeros(self._count, dtype=np.int64)
        for rows, part in self._parts:
            out[rows] = part.skipped
        return out

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (N,)."""
        for rows, part in self._parts:
            part.restart(nodes[rows])

    def snapshot(self) -> object:
        """The state of every part."""
        return [part.snapshot() for _, part in self._parts]

    def restore(self, snapshot: object) -> None:
        """Go on from a snapshot of this bank."""
        if not isinstance(snapshot, list) or len(snapshot) != len(self._parts):
            raise TypeError("not a snapshot of this bank")
        for (_, part), state in zip(self._parts, snapshot, strict=True):
            part.restore(state)
