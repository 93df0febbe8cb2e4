"""A suit in which not every segment bears a node that answers SYNC. It stands where `Poll` stands else.

Nodes that answer SYNC are polled; nodes of other layouts run free; some segments may have none. All are
sampled at one instant of each tick. Where nodes run free this lies a little back, so that each node has a
sample after it: `FreeNodes` says how far, and the sweep bears that instant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.can.frame import CanFrame
from common.errors import ConfigError, ConfigMistake
from common.metrics.bus import BusCounters
from common.quaternion import Array
from common.wire.messages import Mask
from master.capture.free_running import FreeNodes
from master.capture.layout import MappedLayout
from master.capture.parts import ACC, GYR, MAG, TURN
from master.suit.doubt import NodeDoubt
from master.suit.health import BusHealth, NodeCounters, NodeHealth
from master.suit.nodes import NodeConfig
from master.suit.poll import Poll
from master.suit.presence import NodePresence
from master.suit.protocol import SuitProtocol
from master.suit.silence import BusSigns
from master.suit.sweep import Sweep


class MixedSuit:
    """N segments: `polled` nodes answer SYNC, `free` ones do not, the others have no node."""

    def __init__(
        self,
        nodes: Sequence[NodeConfig | None],
        protocol: SuitProtocol,
        layouts: Mapping[str, MappedLayout],
        lost_after: int,
        fd: Mapping[str, bool],
        delay_s: float | None = None,
    ) -> None:
        """`nodes` in skeleton order, with the layout of each; None: the segment has none.

        Raises ConfigError where two frames of a bus would have one identifier.
        """
        self._count = len(nodes)
        polled = {row: node for row, node in enumerate(nodes) if node is not None and node.layout is None}
        free = {row: node for row, node in enumerate(nodes) if node is not None and node.layout is not None}
        self._polled: NDArray[np.intp] = np.array(list(polled), np.intp)
        self._poll = Poll(list(polled.values()), protocol, lost_after, fd)
        self._no_sync = protocol.sync(0)
        self._fd = dict(fd)
        kinds = [layouts[str(node.layout)] for node in free.values()]
        self._free = FreeNodes(free, kinds, len(polled), delay_s) if free else None
        self._routes = {} if self._free is None else self._free.routes
        self._presence = NodePresence(len(free), lost_after)
        self._free_rows: NDArray[np.intp] = np.array(list(free), np.intp)
        self._free_bus = [node.bus for node in free.values()]
        self._bus_of_free = frozenset(self._free_bus)
        self.identifiers = self._all_identifiers()
        self._tick = 0
        self._tick_ns = 0
        self._values = np.zeros((self._count, 13))
        self._values[:, 6:] = np.nan
        self.kinds = [None if node is None or node.layout is None else layouts[node.layout] for node in nodes]
        """The layout of each segment's node; None: tandem's own, or no node."""
        self.fused: Mask = np.array([kind is not None and kind.fused for kind in self.kinds], np.bool_)
        """(N,) nodes that give their orientation."""
        self._some_fused = bool(self.fused.any())
        self._nothing: Mask = np.zeros(self._count, np.bool_)
        self._rows = np.concatenate([self._free_rows, self._polled])
        self._asks = bool(polled)
        self._all_free = list(free) == list(range(self._count))

    def _all_identifiers(self) -> dict[tuple[str, int], str]:
        """What each identifier of each bus is, by bus and identifier."""
        taken = dict(self._poll.identifiers)
        if self._free is None:
            return taken
        sends_sync = self._poll.buses_with_nodes
        for (bus, frame_id), what in self._free.identifiers.items():
            other = taken.get((bus, frame_id))
            if other is not None and bus in sends_sync:
                expected = f"identifiers that differ: {what} and {other} on bus {bus} have the same"
                raise ConfigError("the master's file", [ConfigMistake("nodes", f"{frame_id:#x}", expected)])
            taken[bus, frame_id] = what
        return taken

    @property
    def bus_health(self) -> dict[str, BusHealth]:
        """What arrived on each bus and belongs to no node."""
        return self._poll.bus_health

    @property
    def waits(self) -> bool:
        """Whether an open window waits for answers: free-running nodes do not answer."""
        return self._poll.waits

    @property
    def sync_buses(self) -> frozenset[str]:
        """Buses on which SYNC is sent: those with nodes that answer it."""
        return self._poll.buses_with_nodes

    @property
    def buses_with_nodes(self) -> frozenset[str]:
        """Names of the buses on which nodes hang."""
        return self._poll.buses_with_nodes | self._bus_of_free

    def open_window(self, tick: int, now_ns: int) -> CanFrame:
        """Begin a tick; returns the SYNC for `sync_buses`."""
        self._tick, self._tick_ns = tick, now_ns
        if self._free is not None:
            self._free.begin(now_ns)
        return self._poll.open_window(tick, now_ns) if self._asks else self._no_sync

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take one frame. True once every awaited node has answered this tick."""
        route = self._routes.get((bus, frame_id))
        if route is not None:
            if not route.frame(data, now_ns):
                self._poll.bus_health[bus].overflow += 1
            return False
        return self._poll.on_frame(bus, frame_id, data, now_ns)

    def on_frames(self, bus: str, frames: Sequence[tuple[int, bytes, int]]) -> None:
        """Take frames of a bus of which no frame is awaited: identifier, data, arrival in ns."""
        rest = frames if self._free is None else self._free.frames(bus, frames)
        for frame_id, data, at_ns in rest:
            self.on_frame(bus, frame_id, data, at_ns)

    def close_window(self, now_ns: int) -> Sweep:
        """End the tick: what all nodes read at its instant."""
        polled = self._poll.close_window(now_ns) if self._asks or self._poll.heard else None
        if self._free is not None:
            sampled_ns, rows, read, known = self._resample(self._free, polled, now_ns)
        else:
            sampled_ns, rows = self._tick_ns, self._polled
            read = self._values[rows]
            read[:, :9] = self._poll.readings
            known = np.zeros(len(rows), np.bool_) if polled is None else polled.fresh
        if self._all_free:
            values, fresh, lost = read, known, self._presence.lost
        else:
            values, fresh, lost = self._values.copy(), np.zeros_like(self._nothing), ~self._nothing
            values[rows], fresh[rows] = read, known
            lost[self._free_rows] = self._presence.lost
            if polled is not None:
                lost[self._polled] = polled.lost
        self._values = values
        return Sweep(
            tick=self._tick,
            sampled_ns=sampled_ns,
            frames_in_ns=now_ns if polled is None else polled.frames_in_ns,
            acc_m_s2=values[:, ACC],
            gyr_rad_s=values[:, GYR],
            mag_ut=values[:, MAG],
            fresh=fresh,
            lost=lost,
            q_world_from_sensor=values[:, TURN] if self._some_fused else None,
        )

    def _resample(
        self, free: FreeNodes, polled: Sweep | None, now_ns: int
    ) -> tuple[int, NDArray[np.intp], Array, Mask]:
        """The tick's instant, ns; rows of free-running and polled nodes, what they read, and which did."""
        if polled is not None:
            answered = np.flatnonzero(polled.fresh)
            if len(answered):
                free.put(answered, self._tick_ns, self._poll.readings[answered])
        sampled_ns, instant = free.at_tick(self._tick_ns, now_ns)
        known, read = instant.known, instant.values
        finite = np.isfinite(read[:, :6])
        if not finite.all():
            known = known & finite.all(axis=1)
        if not known.all():
            # where a node did not sample, its last readings stand
            read = np.where(known[:, None], read, self._values[self._rows])
        here = known[: len(self._free_rows)]
        self._presence.close(here, here)
        self._count_free(free.each_tick, here)
        return sampled_ns, self._rows, read, known

    def _count_free(self, counters: NodeCounters, fresh: Mask) -> None:
        counters.times_lost = self._presence.times_lost
        counters.fresh += fresh
        if not fresh.all():
            counters.lost += self._presence.lost
            counters.late += ~(fresh | self._presence.lost)

    @property
    def _free_counters(self) -> NodeCounters:
        return NodeCounters(0) if self._free is None else self._free.counters

    @property
    def readings(self) -> Array:
        """(N, 9) of the last window, in SI units. Not to be written to."""
        return self._values[:, :9]

    @property
    def saturated(self) -> Mask:
        """(N,) nodes that reported a clipped reading in the last window."""
        return self._of_polled(self._poll.saturated)

    @property
    def doubted(self) -> Mask:
        """(N,) nodes whose answers clash."""
        return self._of_polled(self._poll.doubted)

    def _of_polled(self, nodes: Mask) -> Mask:
        if not self._asks:
            return self._nothing
        out = np.zeros_like(self._nothing)
        out[self._polled] = nodes
        return out

    def doubts(self) -> dict[int, NodeDoubt]:
        """What is wrong with which node, by its row."""
        polled = {int(self._polled[place]): doubt for place, doubt in self._poll.doubts().items()}
        return polled if self._free is None else {**polled, **self._free.doubts()}

    def bus_down(self, bus: str) -> None:
        """Take the nodes of a failed bus as lost at once; they come back by answering."""
        self._poll.bus_down(bus)
        if self._free is not None:
            self._presence.lose(self._free.bus_down(bus))

    @property
    def health(self) -> list[NodeHealth]:
        """The counters of each node, in node order."""
        nothing = NodeCounters(1).node(0)
        out = [nothing] * self._count
        for place, row in enumerate(self._polled.tolist()):
            out[row] = self._poll.health[place]
        for place, row in enumerate(self._free_rows.tolist()):
            out[row] = self._free_counters.node(place)
        return out

    def figures(self) -> dict[int, dict[str, int]]:
        """Rate and age of the newest sample of free-running nodes, and how far back they are sampled."""
        if self._free is None:
            return {}
        rate_hz, age_s = np.nan_to_num(self._free.rate_hz), self._free.age_s
        return {
            row: {
                "rate_hz": round(rate_hz[place]),
                "age_us": round(1e6 * min(age_s[place], 1e3)),
                "delay_us": round(1e6 * self._free.delay_s),
                "jitter_us": round(1e6 * self._free.jitter_s[place]),
            }
            for place, row in enumerate(self._free_rows.tolist())
        }

    def signs(self, bus: str, up: bool, counters: BusCounters) -> BusSigns:
        """What shows why no node on a bus answers, together with the bus's own counters."""
        if bus in self._poll.buses_with_nodes or self._free is None:
            return self._poll.signs(bus, up, counters)
        here = np.array([name == bus for name in self._free_bus])
        free = self._free.counters
        return BusSigns(
            up=up, fd=self._fd[bus], sync_id=None, received=counters.received,
            fresh=int(free.fresh[here].sum()), unknown_id=self._poll.bus_health[bus].unknown_id,
            bad_length=int(free.bad_length[here].sum()), bad_checksum=0, bad_tick=0,
            error_frames=counters.error_frames, send_errors=counters.send_errors,
        )  # fmt: skip

    def summary(self) -> dict[str, object]:
        """Totals over nodes and buses, and the nodes that are lost now, as plain values."""
        out = self._poll.summary()
        free = self._free_counters.totals()
        names = [f"{bus} row {row}" for bus, row in zip(self._free_bus, self._free_rows, strict=True)]
        lost = [name for name, gone in zip(names, self._presence.lost, strict=True) if gone]
        merged: dict[str, object] = {
            name: int(str(out[name])) + count if name in out else count for name, count in free.items()
        }
        return {**out, **merged, "lost_now": [*_list(out["lost_now"]), *lost]}


def _list(value: object) -> list[object]:
    return list(value) if isinstance(value, list) else []
