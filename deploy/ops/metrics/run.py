"""Hears robots' statistics and serves them, in a process of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from common.errors import TandemError
from common.link import open_link
from common.link.config import LinkConfig
from common.process.runtime import until_stopped
from common.wire.topics import STATISTICS
from deploy.ops.metrics.collector import StatisticsCollector


@dataclass(frozen=True, slots=True)
class MetricsOptions:
    """What the command line chose."""

    link: LinkConfig
    robots: tuple[str, ...]
    host: str
    port: int
    recordings: Path | None = None


async def serve_metrics(options: MetricsOptions, stop: asyncio.Event, ready: Callable[[int], None]) -> None:
    """Serve until `stop` is set; `ready` is told the port. Raises LinkError, TandemError.

    Raises ModuleNotFoundError without the extra `metrics`.
    """
    from prometheus_client import CollectorRegistry, start_http_server

    collector = StatisticsCollector(options.recordings, robots=options.robots)
    registry = CollectorRegistry(auto_describe=False)
    registry.register(collector)
    async with AsyncExitStack() as links:
        for robot in options.robots:
            link = await links.enter_async_context(open_link(options.link, robot))
            link.subscribe(STATISTICS, partial(collector.take, robot))
        try:
            server, thread = start_http_server(options.port, options.host, registry)
        except OSError as error:
            raise TandemError(
                f"{options.host}:{options.port}: cannot listen there ({error.strerror}); "
                "choose another --listen"
            ) from None
        ready(server.server_port)
        try:
            await until_stopped(stop, _for_ever())
        finally:
            await asyncio.to_thread(server.shutdown)
            server.server_close()
            thread.join()


async def _for_ever() -> None:
    await asyncio.Event().wait()


def address(listen: str) -> tuple[str, int]:
    """Host and port of HOST:PORT. Raises TandemError."""
    host, _, port = listen.rpartition(":")
    if not host or not port.isdigit() or not 0 <= int(port) < 65536:
        raise TandemError(f"--listen {listen}: expected HOST:PORT, such as 127.0.0.1:9464")
    return host.strip("[]"), int(port)


def checked_robots(robots: Sequence[str]) -> tuple[str, ...]:
    """Each once. Raises TandemError where none is named."""
    if not robots:
        raise TandemError("metrics: name the robots by --robot")
    return tuple(dict.fromkeys(robots))
