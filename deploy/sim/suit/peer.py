"""The suit as one peer on several buses: which frame is a SYNC, and what goes out on which bus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from common.wire.messages import Truth
from deploy.sim.suit.faults import Outgoing
from deploy.sim.suit.suit import SimulatedSuit
from master.suit.protocol import SuitProtocol

Send = Callable[[Outgoing], None]
PublishTruth = Callable[[Truth], None]
OnFrame = Callable[[str, int, bytes, int], None]


@dataclass(slots=True)
class PeerCounters:
    """What was heard and answered since the start."""

    syncs: int = 0
    """Well-formed ones, on any bus."""
    malformed_syncs: int = 0
    ticks: int = 0
    """Samples taken: one for all buses."""
    frames: int = 0
    """Handed to a bus."""


class SuitPeer:
    """Answers SYNCs. Frames with another identifier, its own echo among them, are ignored.

    The master sends a tick's SYNC on every bus. All nodes sample on the first to arrive; the nodes of a bus
    answer when their own bus has asked, so that a bus whose SYNC was lost stays silent.
    """

    def __init__(
        self,
        suit: SimulatedSuit,
        protocol: SuitProtocol,
        send: Send,
        publish_truth: PublishTruth | None = None,
    ) -> None:
        self.counters = PeerCounters()
        self._suit = suit
        self._protocol = protocol
        self._send = send
        self._publish_truth = publish_truth
        self._tick = -1
        self._waiting: dict[str, list[Outgoing]] = {}
        self._asked: set[str] = set()

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """A frame was heard on a bus."""
        if frame_id != self._protocol.sync_id:
            return
        try:
            tick = self._protocol.parse_sync(data)
        except ValueError:
            self.counters.malformed_syncs += 1
            return
        self.counters.syncs += 1
        truth = None
        # a tick asked for twice on one bus is a new one: the master has started again
        if tick != self._tick or bus in self._asked:
            truth = self._sample(tick, now_ns)
        self._asked.add(bus)
        frames = self._waiting.pop(bus, [])
        self.counters.frames += len(frames)
        for outgoing in frames:
            self._send(outgoing)
        # the answers are awaited, the truth is not
        if truth is not None and self._publish_truth is not None:
            self._publish_truth(truth)

    def _sample(self, tick: int, now_ns: int) -> Truth | None:
        answer = self._suit.on_sync(tick, now_ns)
        self.counters.ticks += 1
        self._tick = tick
        self._asked.clear()
        self._waiting.clear()
        for outgoing in answer.frames:
            self._waiting.setdefault(outgoing.bus, []).append(outgoing)
        return answer.truth


class NewestSync:
    """Hands on, for each bus, only the newest of the SYNCs that wait: a worn node answers no old ones.

    Without it a suit that was held up for some ticks would answer each of them too late, and stay late.
    """

    def __init__(self, sync_id: int, on_frame: OnFrame, soon: Callable[[Callable[[], None]], object]) -> None:
        """`soon` calls a function back once all frames that wait have been heard."""
        self._sync_id = sync_id
        self._on_frame = on_frame
        self._soon = soon
        self._newest: dict[str, tuple[bytes, int]] = {}
        self.stale = 0
        """SYNCs that a newer one replaced before they were answered."""

    def on_frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        """A frame was heard on a bus; only SYNCs matter."""
        if frame_id != self._sync_id:
            return
        if not self._newest:
            self._soon(self._hand_on)
        self.stale += bus in self._newest
        self._newest[bus] = (data, now_ns)

    def _hand_on(self) -> None:
        newest, self._newest = self._newest, {}
        for bus, (data, now_ns) in newest.items():
            self._on_frame(bus, self._sync_id, data, now_ns)
