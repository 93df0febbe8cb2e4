"""A node on a bus at the robot, polled by nobody else: what is recorded is by the SYNCs that it answered."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.config.load import load_config
from common.errors import ConfigError, TandemError
from deploy.experiments.prove.poll import FrameTape, PollConfig, poll
from deploy.experiments.prove.recorded import NodeRates
from deploy.recorded.files import entries_of, head_of
from master.journal.calls import FRAMES
from master.suit.number import number_of
from master.suit.protocol import SuitProtocol

PROTOCOL = SuitProtocol.load()
TAPED = 100


def test_each_answer_counts_from_its_own_sync() -> None:
    rates = NodeRates(PROTOCOL, TAPED)
    tape = FrameTape(lambda payload, _: rates.take(payload))
    for tick in range(70):  # numbers are left out after 64
        tape.tick(tick, 5_000_000 * tick)
        for frame in PROTOCOL.encode_sample(TAPED, np.full(9, tick, np.int16), number_of(tick), 0, True):
            tape.frame("hand", frame.id, frame.data, 5_000_000 * tick + 900_000)
    tape.flush()
    assert list(rates.speed().at_ns) == [5_000_000 * tick for tick in range(70)]


async def polled(out: Path, numbers: list[int], seconds: int, fd: bool = True) -> None:
    """Poll for so long beside nodes of those numbers."""
    bus = BusConfig(name="hand", interface="virtual", channel=f"hand {out}", fd=fd)

    def on_sync(_: str, frame_id: int, data: bytes, __: int) -> None:
        assert frame_id == PROTOCOL.sync_id
        for number in numbers:
            for frame in PROTOCOL.encode_sample(
                number, np.ones(9, np.int16), PROTOCOL.parse_sync(data), 0, fd
            ):
                nodes.send(frame)

    nodes = CanBus(bus, on_sync)
    nodes.open()
    stop = asyncio.Event()
    told: list[int] = []

    def show(answers: int) -> None:
        told.append(answers)
        if len(told) >= seconds:
            stop.set()

    try:
        await poll(PollConfig(bus=bus), TAPED, out, stop, show)
    finally:
        await nodes.close()


@pytest.mark.parametrize("fd", [True, False])
def test_a_lone_node_is_polled_and_recorded(tmp_path: Path, fd: bool) -> None:
    out = tmp_path / "there.mcap"
    asyncio.run(polled(out, [7, TAPED], 2, fd))
    assert head_of(out)["role"] == "poll"
    rates = NodeRates(PROTOCOL, TAPED)
    for topic, payload in entries_of([out], 0):
        assert topic == FRAMES
        rates.take(payload)
    at_ns = rates.speed().at_ns
    assert len(at_ns) > 1
    assert (np.diff(at_ns) > 0).all()
    # had the SYNCs not the numbers that a master's have, no answer would be known after 1.3 s
    assert at_ns[-1] - at_ns[0] > 1_500_000_000


def test_a_node_that_never_answers_is_named(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="--node 100: it answered no SYNC on bus hand"):
        asyncio.run(polled(tmp_path / "there.mcap", [7], 1))


def test_a_file_without_a_bus_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "poll.toml"
    file.write_text("rate_hz = 200\n")
    with pytest.raises(ConfigError, match=r"bus = \(not set\)"):
        load_config(file, PollConfig)
