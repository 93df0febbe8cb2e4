"""Nodes of different starts and rates on one grid, as a suit's recording needs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.node import NodeRecording

_SAME_RATE = 1e-3
_SAME_PLACE = 0.05
"""Rows that are off by no more than this share of a period are the grid's own, and not interpolated."""
_LONGEST_BRIDGED = 3
Values = Callable[[NodeRecording], Array | None]


@dataclass(frozen=True, slots=True)
class CommonGrid:
    """The rows that all nodes share."""

    nodes: Mapping[str, NodeRecording]
    rate_hz: float
    start_s: float
    count: int
    notes: tuple[str, ...]

    @property
    def time_s(self) -> Array:
        """(T,) from the grid's start."""
        return np.arange(self.count) / self.rate_hz

    def values(self, name: str, of: Values) -> Array | None:
        """A node's values (T, width) on the grid, NaN where it has none; None where it never has any."""
        node = self.nodes[name]
        found = of(node)
        if found is None:
            return None
        place = (self.start_s - node.start_s) * node.rate_hz
        rows = place + np.arange(self.count) * (node.rate_hz / self.rate_hz)
        whole = np.rint(rows).astype(np.intp)
        out = np.full((self.count, found.shape[1]), np.nan)
        if float(np.abs(rows - whole).max()) <= _SAME_PLACE:
            there = (whole >= 0) & (whole < len(found))
            out[there] = found[whole[there]]
            return out
        before = np.clip(np.floor(rows).astype(np.intp), 0, len(found) - 2)
        share = (rows - before)[:, None]
        mixed = (1.0 - share) * found[before] + share * found[before + 1]
        inside = (rows >= 0.0) & (rows <= len(found) - 1)
        out[inside] = mixed[inside]
        return out


def together(nodes: Mapping[str, NodeRecording], rate_hz: float | None = None) -> CommonGrid:
    """The grid over the time that all nodes share, at `rate_hz` or the lowest rate of theirs.

    Raises RecordingError where they share less than a second.
    """
    if not nodes:
        raise RecordingError("no node is left: nothing to write")
    slowest = min(nodes.values(), key=lambda node: node.rate_hz)
    rate = rate_hz or slowest.rate_hz
    start = max(node.start_s for node in nodes.values())
    end = min(node.start_s + (len(node.gyr_rad_s) - 1) / node.rate_hz for node in nodes.values())
    count = int(np.floor((end - start) * rate + 1e-6)) + 1
    if end - start < 1.0 and len(nodes) > 1:
        raise RecordingError(
            f"the nodes share {max(0.0, end - start):.2f} s of time only: "
            + ", ".join(f"{n.name} from {n.start_s:.3f} s for {n.duration_s:.1f} s" for n in nodes.values())
            + "; import those that were recorded together"
        )
    return CommonGrid(nodes, rate, start, count, tuple(_notes(nodes, rate, start)))


def _notes(nodes: Mapping[str, NodeRecording], rate_hz: float, start_s: float) -> Sequence[str]:
    out = []
    for name, node in nodes.items():
        if abs(node.rate_hz / rate_hz - 1.0) > _SAME_RATE:
            out.append(f"{name}: {node.rate_hz:.4g} Hz, interpolated at {rate_hz:.4g} Hz")
        if start_s - node.start_s > 1.0 / rate_hz:
            out.append(f"{name}: its first {start_s - node.start_s:.2f} s are left out, others begin later")
    return out


def bridged(values: Array, longest: int = _LONGEST_BRIDGED) -> Array:
    """Values (T, width) with gaps of up to `longest` rows drawn straight; longer ones stay NaN."""
    there = np.isfinite(values).all(axis=1)
    at = np.flatnonzero(there)
    if there.all() or len(at) < 2:
        return values
    rows = np.arange(len(values))
    out = np.stack([np.interp(rows, at, column[at]) for column in values.T], axis=-1)
    before = np.maximum.accumulate(np.where(there, rows, -len(values)))
    after = np.minimum.accumulate(np.where(there, rows, 2 * len(values))[::-1])[::-1]
    out[after - before > longest + 1] = np.nan
    return out
