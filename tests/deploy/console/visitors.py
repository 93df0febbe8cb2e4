"""Browsers in a process of their own, as visitors of a console: `python -m tests.deploy.console.visitors`.

Arguments: the console's address, how many, and how they behave: `keep up` acknowledges all, `garbage` sends
what is no message and comes again at once.
"""

from __future__ import annotations

import asyncio
import json
import sys
from contextlib import suppress

import aiohttp


async def keep_up(http: aiohttp.ClientSession, url: str) -> None:
    """Acknowledge every message until the console ends."""
    async with http.ws_connect(f"{url}/ws", headers={"Origin": url}, max_msg_size=0) as socket:
        print("sees", flush=True)  # noqa: T201
        async for message in socket:
            if message.type is aiohttp.WSMsgType.BINARY:
                length = int.from_bytes(message.data[:4], "little")
                header = json.loads(message.data[4 : 4 + length])
            else:
                header = json.loads(message.data)
            if "n" in header:
                await socket.send_str(json.dumps({"kind": "ack", "n": header["n"]}))


async def garbage(http: aiohttp.ClientSession, url: str) -> None:
    """Send garbage in messages as long as they may be, again and again, some 100 times a second."""
    print("sees", flush=True)  # noqa: T201
    while True:
        with suppress(aiohttp.ClientError, ConnectionError):
            async with http.ws_connect(f"{url}/ws", headers={"Origin": url}) as socket:
                for _ in range(10):
                    await socket.send_str("x" * 4000)
                    await asyncio.sleep(0.01)
        await asyncio.sleep(0.01)


async def visit(url: str, count: int, behaviour: str) -> None:
    """Until this process is ended."""
    one = {"keep up": keep_up, "garbage": garbage}[behaviour]
    async with aiohttp.ClientSession() as http:
        await asyncio.gather(*(one(http, url) for _ in range(count)))


if __name__ == "__main__":
    asyncio.run(visit(sys.argv[1], int(sys.argv[2]), sys.argv[3]))
