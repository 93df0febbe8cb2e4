"""`python -m deploy.sim.taped MASTER_FILE SLAVE_TAP`: the node as a process on the suit's bus.

Beside a running simulated robot whose file has `[tap] socket`; `tandem prove --lead` then has a node to hear.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import can
import typer

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.can.without_echo import open_without_longer_than
from common.clock import NS_PER_MS
from common.config.load import load_config
from common.process.realtime import enter_real_time
from common.process.runtime import run as run_until_stopped
from common.process.runtime import until_stopped
from common.tap.reader import TapReader
from deploy.sim.suit.peer import NewestSync
from deploy.sim.taped.node import TapedNode
from master.config import MasterConfig
from master.suit.protocol import SuitProtocol
from slave.tap import TICK, decode_tick

NODE = 100


def main(
    master: Annotated[Path, typer.Argument(help="The master's file: its bus, profile and DBC.")],
    tap: Annotated[Path, typer.Argument(help="The slave's [tap] socket.")],
    overrides: Annotated[list[str] | None, typer.Option("--set", help="Replace a key of the file.")] = None,
    hand: Annotated[str, typer.Option(help="The segment that the node is taped to.")] = "right_hand",
    node: Annotated[int, typer.Option(help="Its number.")] = NODE,
    late_ms: Annotated[int, typer.Option(help="A fault: readings that are so much older.", max=200)] = 0,
) -> None:
    """Answer every SYNC until Ctrl-C."""
    config = load_config(master, MasterConfig, overrides or ())
    protocol = SuitProtocol.load(config.capture.dbc)
    bus_config = config.capture.buses[0]
    taped = TapedNode(config.skeleton, hand, protocol, node, fd=bus_config.fd, late_ns=late_ms * NS_PER_MS)

    def opener(bus: BusConfig) -> can.BusABC:
        return open_without_longer_than(bus, protocol.sync(0))

    async def follow() -> None:
        with TapReader(tap) as reader:
            while True:
                message = await reader.read()
                if message.topic == TICK:
                    taped.on_tick(decode_tick(message.payload))

    async def work(stop: asyncio.Event) -> None:
        enter_real_time(config.process.realtime_priority)  # as the suit: a node does not answer late

        def on_sync(_: str, frame_id: int, data: bytes, now_ns: int) -> None:
            for frame in taped.answer(protocol.parse_sync(data), now_ns):
                bus.send(frame)

        newest = NewestSync(protocol.sync_id, on_sync, asyncio.get_running_loop().call_soon)
        bus = CanBus(bus_config, newest.on_frame, opener=opener)
        bus.open()
        try:
            await until_stopped(stop, follow())
        finally:
            await bus.close()

    run_until_stopped(work)


if __name__ == "__main__":
    typer.run(main)
