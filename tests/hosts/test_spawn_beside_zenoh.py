"""Processes are started while Zenoh's threads call into Python: with uvloop's own start this hung for ever.

Its copy of the process waited, before it became the other program, for a lock that such a thread held.
"""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import uvloop

from common.link import open_link
from common.link.config import LinkConfig
from common.wire.topics import STATE
from deploy.harness.spawn import Spawned

pytestmark = pytest.mark.live

STARTS = 150
FLOOD = """
import asyncio, sys
import uvloop
from common.link.config import LinkConfig
from common.link import open_link
from common.wire.topics import STATE

async def main():
    async with open_link(LinkConfig(connect=[sys.argv[1]]), "robot-1") as link:
        put = link.publish(STATE)
        while True:
            for _ in range(20):
                put(bytes(50))
            await asyncio.sleep(0)

uvloop.run(main())
"""


def test_starts_beside_a_flood_of_messages_never_hang(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"

    async def story() -> None:
        heard, count = asyncio.Event(), 0

        def on_state(_: bytes, __: int) -> None:
            nonlocal count
            count += 1
            heard.set()

        async with asyncio.timeout(60), open_link(LinkConfig(listen=[endpoint]), "robot-1") as link:
            link.subscribe(STATE, on_state)
            await heard.wait()
            before = count
            with (tmp_path / "log").open("wb") as log:
                starts = 0
                while starts < STARTS or count == before:  # beside messages, or it shows nothing
                    assert await Spawned(["true"], log).wait() == 0
                    starts += 1

    flood = subprocess.Popen([sys.executable, "-c", FLOOD, endpoint])
    try:
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(story())
    finally:
        flood.kill()
        flood.wait()
