"""One direction of an emulated link: when each packet arrives, or why it does not. Pure."""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from common.clock import NS_PER_MS
from deploy.sim.network.delay import DelayProcess
from deploy.sim.network.loss import Losses, gilbert_elliott
from deploy.sim.network.profile import Way

P = TypeVar("P")
LOSS, QUEUE, SIZE, OUTAGE = "loss", "queue", "size", "outage"
"""Why a packet is dropped: by chance, by a full queue, because it is too large, while nothing passes."""


@dataclass(slots=True)
class Counters:
    """Packets and their bytes, since the start. Taken + duplicated = delivered + dropped + under way."""

    packets: int = 0
    """Given to the link, as `bytes`."""
    bytes: int = 0
    delivered: int = 0
    delivered_bytes: int = 0
    duplicated: int = 0
    reordered: int = 0
    """Held back so that others could pass."""
    planned: int = 0
    """Packets whose delay the profile decided; 0 where the emulation does not report it."""
    planned_ns: int = 0
    """The sum of those delays, queueing included."""
    dropped: dict[str, int] = field(default_factory=lambda: dict.fromkeys((LOSS, QUEUE, SIZE, OUTAGE), 0))


class PacketScheduler(Generic[P]):
    """Takes packets, and returns each when it is due.

    A packet first waits for those before it (rate, queue), then travels (delay, jitter). Packets keep their
    order, except those held back for reordering, and their copies.
    """

    def __init__(self, way: Way, seed: int = 0, now_ns: int = 0) -> None:
        self.counters = Counters()
        self.cut = False
        """While true, nothing passes: packets that enter or would arrive are dropped."""
        self._rng = random.Random(seed)
        self._under_way: list[tuple[int, int, int, P]] = []
        self._number = 0
        self._free_ns = 0
        """When the last packet in the queue is through."""
        self._newest_ns = 0
        """When the last packet that keeps its order arrives."""
        self._seed = seed
        self.set(way, now_ns)

    def set(self, way: Way, now_ns: int) -> None:
        """Change the behaviour from now on; packets under way arrive as planned."""
        self._way = way
        self._set_ns = now_ns
        self._delay = DelayProcess(way.delay_ms, way.jitter_ms, self._seed)
        self._losses = Losses(gilbert_elliott(way), self._rng)
        self._ns_per_byte = 0.0 if way.rate_mbit is None else 8e3 / way.rate_mbit
        self._queue_bytes = way.queue_bytes

    def push(self, now_ns: int, packet: P, size: int) -> None:
        """Take a packet of `size` bytes. Called with times that do not go back."""
        counters, way = self.counters, self._way
        counters.packets += 1
        counters.bytes += size
        if self.cut:
            counters.dropped[OUTAGE] += 1
            return
        if way.largest_bytes is not None and size > way.largest_bytes:
            counters.dropped[SIZE] += 1
            return
        sent_ns = now_ns
        if self._ns_per_byte:
            waiting_ns = max(self._free_ns - now_ns, 0)
            if waiting_ns / self._ns_per_byte + size > self._queue_bytes:
                counters.dropped[QUEUE] += 1
                return
            self._free_ns = sent_ns = now_ns + waiting_ns + round(size * self._ns_per_byte)
        if self._losses.next():  # lost on the way: it has taken its time on the link
            counters.dropped[LOSS] += 1
            return
        self._travel(sent_ns, packet, size)
        counters.planned += 1
        counters.planned_ns += self._newest_ns - now_ns
        if way.duplicate_percent and self._rng.random() < way.duplicate_percent / 100.0:
            counters.duplicated += 1
            self._arrive(self._newest_ns, packet, size)

    def _travel(self, sent_ns: int, packet: P, size: int) -> None:
        way = self._way
        arrives_ns = max(sent_ns + self._delay.at(sent_ns - self._set_ns), self._newest_ns)
        self._newest_ns = arrives_ns
        if way.reorder_percent and self._rng.random() < way.reorder_percent / 100.0:
            self.counters.reordered += 1
            arrives_ns += round(way.reorder_ms * NS_PER_MS)
        self._arrive(arrives_ns, packet, size)

    def _arrive(self, at_ns: int, packet: P, size: int) -> None:
        self._number += 1
        heapq.heappush(self._under_way, (at_ns, self._number, size, packet))

    def due(self, now_ns: int) -> list[P]:
        """The packets that arrive by now, in their order."""
        arrived: list[P] = []
        while self._under_way and self._under_way[0][0] <= now_ns:
            _, _, size, packet = heapq.heappop(self._under_way)
            if self.cut:
                self.counters.dropped[OUTAGE] += 1
                continue
            self.counters.delivered += 1
            self.counters.delivered_bytes += size
            arrived.append(packet)
        return arrived

    @property
    def next_ns(self) -> int | None:
        """When the next packet arrives; None while none is under way."""
        return self._under_way[0][0] if self._under_way else None
