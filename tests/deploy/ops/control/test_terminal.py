"""An act is carried through for every robot, whatever becomes of the terminal: `tandem` as a process."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import sys
from collections.abc import Awaitable, Callable
from contextlib import suppress

import pytest

from common.link import open_link
from common.link.config import LinkConfig
from common.wire.stop import StopAnswer, pack_stop_answer
from common.wire.topics import STOP

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]

LATE_S = 1.0


def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


async def estop(
    stdout: int, at: dict[str, str], after: Callable[[asyncio.subprocess.Process], Awaitable[None]]
) -> tuple[int, set[str], str]:
    """Both robots are named; the second can be reached only LATE_S after the first was stopped."""
    stopped: set[str] = set()
    first = asyncio.Event()

    def robot(name: str) -> Callable[[bytes, int], bytes]:
        def answer(_: bytes, __: int) -> bytes:
            stopped.add(name)
            first.set()
            return pack_stop_answer(StopAnswer(True, "estop", "stopped", 1 + len(name)))

        return answer

    async with open_link(LinkConfig(listen=[at["a"]]), "a") as a:
        a.answer(STOP, robot("a"))
        where = [word for each in at.values() for word in ("--connect", each)]
        tandem = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "deploy", "estop", *where, "--robot", "a", "--robot", "bb",
            stdout=stdout, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        try:
            async with asyncio.timeout(30):
                await first.wait()
                await asyncio.sleep(LATE_S)
                await after(tandem)
                async with open_link(LinkConfig(listen=[at["bb"]]), "bb") as b:
                    b.answer(STOP, robot("bb"))
                    _, said = await tandem.communicate()
        finally:
            with suppress(ProcessLookupError):
                tandem.kill()
    assert tandem.returncode is not None
    return tandem.returncode, stopped, said.decode()


async def nothing(_: asyncio.subprocess.Process) -> None: ...


async def hang_up(tandem: asyncio.subprocess.Process) -> None:
    tandem.send_signal(signal.SIGHUP)


@pytest.mark.parametrize("output", ["full", "closed pipe", "paused", "hangup"])
def test_an_estop_reaches_the_second_robot_and_its_status_says_so(output: str) -> None:
    reading, writing = os.pipe()
    out = writing
    if output == "full":
        out = os.open("/dev/full", os.O_WRONLY)
    elif output == "closed pipe":
        os.close(reading)
    elif output == "paused":
        os.set_blocking(writing, False)
        with suppress(BlockingIOError):
            while True:
                os.write(writing, bytes(4096))
        os.set_blocking(writing, True)
    at = {"a": endpoint(), "bb": endpoint()}
    status, stopped, said = asyncio.run(estop(out, at, hang_up if output == "hangup" else nothing))
    assert stopped == {"a", "bb"}, said
    assert status == 0, said
    assert "Traceback" not in said
