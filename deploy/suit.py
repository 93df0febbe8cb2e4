"""The simulated suit's process: answers on CAN, and tells the true joint angles to those who judge."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import AsyncExitStack

from common.codec import encode
from common.launch import WriteFigures
from common.link import open_link
from common.messages import Truth
from common.topics import TRUTH
from master.suit.simulated.app import run as answer
from master.suit.simulated.config import SuitConfig

log = logging.getLogger("tandem.suit")


async def run(config: SuitConfig, stop: asyncio.Event, write_figures: WriteFigures) -> None:
    """Answer until `stop` is set. Without a link the truth is told to nobody."""
    async with AsyncExitStack() as stack:
        tell: Callable[[Truth], None] | None = None
        if config.link.connect or config.link.listen:
            link = await stack.enter_async_context(open_link(config.link, config.robot))
            put = link.publish(TRUTH)
            tell = lambda truth: put(encode(truth))  # noqa: E731
        buses = ", ".join(f"{bus.name} ({bus.interface} {bus.channel})" for bus in config.buses)
        log.info("answers every SYNC for %d nodes on %s", len(config.nodes), buses)
        write_figures(await answer(config, stop, tell))
