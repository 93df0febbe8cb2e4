"""Hears one robot and puts what it hears into LSL, in a process of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from common.link import open_link
from common.link.config import LinkConfig
from common.process.runtime import until_stopped
from common.skeleton import Skeleton
from common.wire.topics import COMMAND, STATE
from deploy.ops.lsl.outlets import LslPublisher

PROGRESS_S = 0.5


async def publish_lsl(
    link: LinkConfig, robot: str, skeleton: Skeleton, stop: asyncio.Event, report: Callable[[str], None]
) -> dict[str, int]:
    """Until `stop` is set; how many samples went into each stream. Raises LinkError, ModuleNotFoundError."""
    publisher = LslPublisher(robot, skeleton)
    async with open_link(link, robot) as session:
        session.subscribe(STATE, publisher.state)
        session.subscribe_keys(COMMAND, lambda _, payload, arrived_ns: publisher.command(payload, arrived_ns))
        await until_stopped(stop, _tell(publisher, report))
    return publisher.sent


async def _tell(publisher: LslPublisher, report: Callable[[str], None]) -> None:
    while True:
        report(", ".join(f"{name} {count}" for name, count in publisher.sent.items()))
        await asyncio.sleep(PROGRESS_S)
