"""One tick of the suit: ask by SYNC, gather the answers, judge them. Open this file first.

    open_window ─▶ SYNC on every bus … on_frame, on_frame, … ─▶ close_window ─▶ Sweep

A frame with a wrong checksum, tick or length, or of an unknown identifier, never changes a value; it is
counted. Frames are only put aside as they arrive, and decoded together when the window closes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.can.frame import CanFrame
from common.metrics.bus import BusCounters
from common.quaternion import Array
from common.wire.messages import Mask
from master.suit.clash import Clashes
from master.suit.doubt import NodeDoubt
from master.suit.health import BusHealth, NodeCounters, NodeHealth
from master.suit.intake import AnswerSlot, Intake
from master.suit.layout import Raw
from master.suit.nodes import NodeConfig
from master.suit.number import number_of
from master.suit.presence import NodePresence
from master.suit.protocol import READINGS, SuitProtocol, si_readings
from master.suit.silence import BusSigns
from master.suit.sweep import Sweep

_IDS = 0x800
"""Identifiers of 11 bits."""
_FRAMES_PER_PART = 16
"""Room in a window for each frame that is expected; a bus with more than that babbles."""


class Poll:
    """The suit's nodes as the master knows them. Pure: frames and times come in, sweeps go out."""

    def __init__(
        self, nodes: Sequence[NodeConfig], protocol: SuitProtocol, lost_after: int, fd: Mapping[str, bool]
    ) -> None:
        """`nodes` in skeleton order; `lost_after` in ticks; `fd` says of each bus whether it is CAN FD.

        Raises ConfigError where two frames of a bus would have one identifier.
        """
        count = len(nodes)
        self.identifiers = protocol.identifiers(nodes, fd)
        """What each identifier of each bus is, by bus and identifier."""
        self._fd = dict(fd)
        self._protocol = protocol
        self._counters = NodeCounters(count)
        self._presence = NodePresence(count, lost_after)
        self._counters.times_lost = self._presence.times_lost
        self._bus_of_node = [node.bus for node in nodes]
        self.bus_health: dict[str, BusHealth] = {bus: BusHealth() for bus in fd}
        self._bus_names = list(fd)
        self._names = [f"{node.bus} {node.id}" for node in nodes]
        self._all: Mask = np.ones(count, dtype=np.bool_)
        self._without_mag: Mask = np.array([not node.magnetometer for node in nodes])
        self._some_without_mag = bool(self._without_mag.any())
        self._scale = protocol.fd.scale
        self._values = np.zeros((count, len(READINGS)))
        """Last good readings in SI. Replaced, never written to: sweeps hold views of it."""
        self._values[:, 6:] = np.nan

        self._first_key = {bus: place * _IDS for place, bus in enumerate(fd)}
        places = [AnswerSlot(i, node.id, self._first_key[node.bus]) for i, node in enumerate(nodes)]
        self._intakes: list[Intake] = []
        self._intake_of_bus: dict[str, Intake] = {}
        for kind in sorted(set(fd.values())):
            buses = [bus for bus in fd if fd[bus] == kind]
            here = [place for place, node in zip(places, nodes, strict=True) if node.bus in buses]
            intake = Intake(protocol.answer_format(kind), here)
            self._intake_of_bus.update(dict.fromkeys(buses, intake))
            if here:
                self._intakes.append(intake)
        self._slots = {
            key: (intake, slot) for intake in self._intakes for slot, key in enumerate(intake.keys)
        }
        self._capacity = _FRAMES_PER_PART * max(1, len(self._slots))
        self.clashes = Clashes(np.array([self._bus_names.index(node.bus) for node in nodes], np.intp))
        self._foreign: dict[str, int] = {}
        self.saturated: Mask = np.zeros(count, np.bool_)
        """(N,) nodes that reported a clipped reading in the last window."""

        self._tick = 0
        self._number = 0
        self._sampled_ns = 0
        self._complete_ns: int | None = None
        self._frames: list[tuple[int, bytes]] = []
        self._waiting: set[int] = set()
        self._awaited: Mask | None = None
        self._awaited_keys: set[int] = set()
        self._set_tests()

    def open_window(self, tick: int, now_ns: int) -> CanFrame:
        """Begin a tick, at the time at which SYNC is sent; returns the SYNC for every bus."""
        self._tick = tick
        self._number = number_of(tick)
        self._sampled_ns = now_ns
        self._complete_ns = None
        awaited = self._presence.awaited
        if awaited is not self._awaited:
            self._awaited = awaited
            self._awaited_keys = {
                key
                for intake in self._intakes
                for slot, key in enumerate(intake.keys)
                if awaited[intake.rows[slot // intake.parts]]
            }
        self._waiting = self._awaited_keys.copy()
        self._set_tests()
        return self._protocol.sync(self._number)

    def _set_tests(self) -> None:
        self._tests = {
            bus: (self._first_key[bus], *intake.tick_test(self._number))
            for bus, intake in self._intake_of_bus.items()
        }

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Put one frame aside. True once every awaited node has answered this tick.

        Looks at one byte of the tick, so that a late answer to the last tick does not end the wait; all else
        is checked when the window closes. With every node lost it is never True: the window stays open for
        them all to come back.
        """
        first_key, byte, mask, value = self._tests[bus]
        key = first_key + frame_id if frame_id < _IDS else first_key
        if len(self._frames) >= self._capacity:
            self.bus_health[bus].overflow += 1
            return self._complete_ns is not None
        self._frames.append((key, data))
        waiting = self._waiting
        if key in waiting and len(data) > byte and data[byte] & mask == value:
            waiting.remove(key)
            if not waiting:
                self._complete_ns = now_ns
        return self._complete_ns is not None

    def on_frames(self, bus: str, frames: Sequence[tuple[int, bytes, int]]) -> None:
        """Put frames aside that end no wait: identifier, data, arrival in ns."""
        for frame_id, data, at_ns in frames:
            self.on_frame(bus, frame_id, data, at_ns)

    def close_window(self, now_ns: int) -> Sweep:
        """End the tick: decode what came, update values and health. Right when nothing came, too."""
        frames, self._frames = self._frames, []
        fresh = heard = self._all
        if self._take_whole(frames):
            self.clashes.close(None, None, None)
        else:
            self._sort(frames)
            fresh, heard = self._take()
        presence, counters = self._presence, self._counters
        presence.close(fresh, heard)
        counters.fresh += fresh
        if fresh is not self._all:
            counters.lost += presence.lost
            counters.late += ~(fresh | presence.lost)
        values = self._values
        return Sweep(
            tick=self._tick,
            sampled_ns=self._sampled_ns,
            frames_in_ns=now_ns if self._complete_ns is None else self._complete_ns,
            acc_m_s2=values[:, 0:3],
            gyr_rad_s=values[:, 3:6],
            mag_ut=values[:, 6:9],
            fresh=fresh,
            lost=presence.lost,
        )

    def bus_down(self, bus: str) -> None:
        """Take the nodes of a failed bus as lost at once; they come back by answering."""
        first_key = self._first_key[bus]
        self._frames = [frame for frame in self._frames if not first_key <= frame[0] < first_key + _IDS]
        self._presence.lose(np.array([name == bus for name in self._bus_of_node]))

    @property
    def heard(self) -> bool:
        """Whether anything has come since the last window."""
        return bool(self._frames)

    fused: Mask | None = None
    """No node gives its orientation itself."""

    @property
    def waits(self) -> bool:
        """Whether an open window waits for answers."""
        return bool(self._slots)

    @property
    def doubted(self) -> Mask:
        """(N,) nodes whose answers clash."""
        return self.clashes.doubted

    def doubts(self) -> dict[int, NodeDoubt]:
        """What is wrong with which node's answers, by its index."""
        return self.clashes.doubts()

    def figures(self) -> dict[int, dict[str, int]]:
        """Those of free-running nodes: there is none."""
        return {}

    @property
    def buses_with_nodes(self) -> frozenset[str]:
        """Names of the buses on which nodes hang."""
        return frozenset(self._bus_of_node)

    sync_buses = buses_with_nodes

    def signs(self, bus: str, up: bool, counters: BusCounters) -> BusSigns:
        """What shows why no node on a bus answers, together with the bus's own counters."""
        here = np.array([name == bus for name in self._bus_of_node])
        nodes = self._counters
        return BusSigns(
            up=up,
            fd=self._fd[bus],
            sync_id=self._protocol.sync_id,
            received=counters.received,
            fresh=int(nodes.fresh[here].sum()),
            unknown_id=self.bus_health[bus].unknown_id,
            bad_length=int(nodes.bad_length[here].sum()),
            bad_checksum=int(nodes.bad_checksum[here].sum()),
            bad_tick=int(nodes.bad_tick[here].sum()),
            error_frames=counters.error_frames,
            send_errors=counters.send_errors,
        )

    @property
    def health(self) -> list[NodeHealth]:
        """The counters of each node, in node order."""
        return [self._counters.node(index) for index in range(len(self._values))]

    def summary(self) -> dict[str, object]:
        """Totals over nodes and buses, and the nodes that are lost now, as plain values."""
        lost = [self._names[index] for index in np.flatnonzero(self._presence.lost)]
        return {
            **self._counters.totals(),
            "unknown_id": sum(bus.unknown_id for bus in self.bus_health.values()),
            "overflow": sum(bus.overflow for bus in self.bus_health.values()),
            "foreign_sync": sum(bus.foreign_sync for bus in self.bus_health.values()),
            "lost_now": lost,
        }

    def _take_whole(self, frames: list[tuple[int, bytes]]) -> bool:
        """The usual window: each expected frame came once and is sound. False, and no effect, if not so."""
        if len(frames) != len(self._slots):
            return False
        by_key = dict(frames)
        if by_key.keys() != self._slots.keys():
            return False
        wholes = [intake.take_whole(by_key, self._number) for intake in self._intakes]
        values = np.empty_like(self._values)
        for intake, raw in zip(self._intakes, wholes, strict=True):
            if raw is None:
                return False
            values[intake.rows] = self._si(raw, intake.rows)
        self._values = values
        if self.saturated.any():
            self.saturated = np.zeros(len(values), np.bool_)
        return True

    def _sort(self, frames: list[tuple[int, bytes]]) -> None:
        """Hand each frame to the intake of its format; count those of no node and those of wrong length."""
        for key, data in frames:
            place = self._slots.get(key)
            if place is None and key % _IDS == self._protocol.sync_id:
                bus = self._bus_names[key // _IDS]
                self.bus_health[bus].foreign_sync += 1
                self._foreign[bus] = self._foreign.get(bus, 0) + 1
                continue
            if place is None:
                self.bus_health[self._bus_names[key // _IDS]].unknown_id += 1
                continue
            intake, slot = place
            if len(data) == intake.length:
                intake.add(slot, data)
            else:
                self._counters.bad_length[intake.rows[slot // intake.parts]] += 1

    def _take(self) -> tuple[Mask, Mask]:
        """Judge the sorted frames, node by node; returns which nodes are fresh and which were heard."""
        fresh = np.zeros(len(self._values), dtype=np.bool_)
        heard = np.zeros(len(self._values), dtype=np.bool_)
        differing, twice = np.zeros_like(fresh), np.zeros_like(fresh)
        self.saturated = np.zeros_like(fresh)
        values = self._values.copy()
        for intake in self._intakes:
            answers = intake.take(self._number, self._counters)
            differing[intake.rows], twice[intake.rows] = answers.differing, answers.twice
            self.saturated[intake.rows] = answers.saturated
            fresh[intake.rows] = answers.usable
            heard[intake.rows] = answers.heard
            values[intake.rows[answers.usable]] = self._si(answers.raw, intake.rows)[answers.usable]
        self._values = values
        foreign = np.array([self._foreign.get(bus, 0) for bus in self._bus_names]) if self._foreign else None
        self._foreign = {}
        self.clashes.close(differing, twice, foreign)
        return fresh, heard

    @property
    def readings(self) -> Array:
        """(N, 9) of the last window, in SI units, as the sweep has them. Not to be written to."""
        return self._values

    def _si(self, raw: Raw, rows: NDArray[np.intp]) -> Array:
        return si_readings(raw, self._scale, self._without_mag[rows] if self._some_without_mag else None)
