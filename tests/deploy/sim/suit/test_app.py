"""The suit on python-can's `virtual` bus: wiring only, the logic is tested without a loop."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.errors import BusError
from common.wire.messages import Truth
from deploy.sim.suit.app import run
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import FaultsConfig
from master.suit.protocol import SuitProtocol

GIVE_UP_S = 20.0


async def ask(config: SuitConfig, protocol: SuitProtocol, ticks: int) -> tuple[list[int], list[Truth], Any]:
    """Identifiers heard for some SYNCs, the truths told, and what the suit counted."""
    heard: list[int] = []
    truths: list[Truth] = []
    complete = asyncio.Event()
    stop = asyncio.Event()

    def on_frame(bus: str, frame_id: int, data: bytes, now_ns: int) -> None:
        heard.append(frame_id)
        if len(heard) % len(config.nodes) == 0:
            complete.set()

    master = CanBus(config.buses[0], on_frame)
    master.open()
    suit = asyncio.create_task(run(config, stop, truths.append))
    await asyncio.sleep(0)
    try:
        for tick in range(ticks):
            complete.clear()
            master.send(protocol.sync(tick))
            await asyncio.wait_for(complete.wait(), GIVE_UP_S)
        stop.set()
        return heard, truths, await asyncio.wait_for(suit, GIVE_UP_S)
    finally:
        suit.cancel()
        await master.close()


def test_it_answers_and_tells_the_truth_until_it_is_stopped(
    config: SuitConfig, protocol: SuitProtocol
) -> None:
    heard, truths, figures = asyncio.run(ask(config, protocol, ticks=3))
    assert heard == [0x100 + i for _ in range(3) for i in range(1, 37)]
    assert [truth.tick for truth in truths] == [0, 1, 2]
    assert (figures.syncs, figures.ticks, figures.frames) == (3, 3, 108)
    assert figures.buses["suit"].sent == 108


def test_a_delayed_answer_still_comes(config: SuitConfig, protocol: SuitProtocol) -> None:
    late = FaultsConfig.model_validate({"delay": [{"node": "chest", "delay_ms": 1.0}]})
    delayed = config.model_copy(update={"faults": late})
    heard, _, _ = asyncio.run(ask(delayed, protocol, ticks=1))
    assert heard == [*(0x100 + i for i in range(2, 37)), 0x101]


def test_a_bus_that_cannot_be_opened_is_an_error_and_leaves_none_open(config: SuitConfig) -> None:
    broken = BusConfig(name="broken", interface="nothing of the kind", channel="x")
    with pytest.raises(BusError, match="bus broken: cannot open"):
        asyncio.run(run(config.model_copy(update={"buses": [*config.buses, broken]}), asyncio.Event()))
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("can ")]
