from __future__ import annotations

from common.can.config import BusConfig
from common.wire.messages import Truth
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import Outgoing
from deploy.sim.suit.peer import SuitPeer
from deploy.sim.suit.suit import build_suit
from master.suit.nodes import NodeConfig
from master.suit.protocol import SuitProtocol

NOW_NS = 5_000_000_000


class Wire:
    """A peer with a node on each of two buses, and what it did, in order."""

    def __init__(self, protocol: SuitProtocol) -> None:
        config = SuitConfig(
            buses=[BusConfig(name=b, interface="virtual", channel=b) for b in ("body", "glove")],
            nodes={"chest": NodeConfig(id=1, bus="body"), "left_hand": NodeConfig(id=2, bus="glove")},
        )
        self.events: list[str] = []
        self.truths: list[Truth] = []
        self.protocol = protocol
        self.peer = SuitPeer(build_suit(config, protocol), protocol, self._sent, self._on_truth)

    def _sent(self, outgoing: Outgoing) -> None:
        tick = int.from_bytes(outgoing.frame.data[18:22], "little")
        self.events.append(f"{outgoing.bus} {tick}")

    def _on_truth(self, truth: Truth) -> None:
        self.events.append(f"truth {truth.tick}")
        self.truths.append(truth)

    def sync(self, bus: str, tick: int, now_ns: int = NOW_NS) -> None:
        frame = self.protocol.sync(tick)
        self.peer.on_frame(bus, frame.id, frame.data, now_ns)


def test_each_bus_answers_its_own_sync_and_all_sample_on_the_first(protocol: SuitProtocol) -> None:
    wire = Wire(protocol)
    wire.sync("body", 1, NOW_NS)
    wire.sync("glove", 1, NOW_NS + 40_000)
    wire.sync("glove", 2, NOW_NS + 5_000_000)
    wire.sync("body", 2, NOW_NS + 5_040_000)
    assert wire.events == ["body 1", "truth 1", "glove 1", "glove 2", "truth 2", "body 2"]
    assert [t.sampled_ns for t in wire.truths] == [NOW_NS, NOW_NS + 5_000_000]
    counters = wire.peer.counters
    assert (counters.syncs, counters.ticks, counters.frames) == (4, 2, 4)


def test_a_bus_whose_sync_was_lost_sends_nothing_old_later(protocol: SuitProtocol) -> None:
    wire = Wire(protocol)
    wire.sync("body", 1)
    wire.sync("body", 2)
    wire.sync("glove", 2)
    assert wire.events == ["body 1", "truth 1", "body 2", "truth 2", "glove 2"]


def test_a_tick_asked_for_again_is_sampled_anew(protocol: SuitProtocol) -> None:
    """A master that has started again may begin with the tick at which the last one died."""
    wire = Wire(protocol)
    wire.sync("body", 0, NOW_NS)
    wire.sync("body", 0, NOW_NS + 7)
    assert wire.events == ["body 0", "truth 0"] * 2
    assert [t.sampled_ns for t in wire.truths] == [NOW_NS, NOW_NS + 7]


def test_a_malformed_sync_is_counted_and_not_answered(protocol: SuitProtocol) -> None:
    wire = Wire(protocol)
    for data in (b"", b"\0\0\0", b"\0\0\0\0\0"):
        wire.peer.on_frame("body", protocol.sync_id, data, NOW_NS)
    assert wire.events == []
    assert wire.peer.counters.malformed_syncs == 3
    assert wire.peer.counters.syncs == 0


def test_other_identifiers_are_ignored(protocol: SuitProtocol) -> None:
    wire = Wire(protocol)
    for frame_id in (0x000, 0x07F, 0x081, 0x101, 0x7FF):
        wire.peer.on_frame("body", frame_id, b"\0\0\0\0", NOW_NS)
    assert wire.events == []
    assert wire.peer.counters.malformed_syncs == 0


def test_without_anyone_to_tell_the_truth_is_kept(protocol: SuitProtocol) -> None:
    wire = Wire(protocol)
    config = SuitConfig(
        buses=[BusConfig(name="body", interface="virtual", channel="body")],
        nodes={"chest": NodeConfig(id=1, bus="body")},
    )
    sent: list[Outgoing] = []
    peer = SuitPeer(build_suit(config, protocol), protocol, sent.append)
    frame = wire.protocol.sync(3)
    peer.on_frame("body", frame.id, frame.data, NOW_NS)
    assert len(sent) == 1
