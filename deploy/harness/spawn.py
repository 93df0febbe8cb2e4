"""Starts processes from a loop beside which Zenoh's threads run.

The loop's own `create_subprocess_exec` may hang: under uvloop the forked copy runs Python's after-fork work
before it becomes the other program, and waits for ever for a lock that another thread held during the fork.
Beside a flood of messages this happened within 100 starts. `subprocess` uses vfork and exec alone.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from typing import IO


class Spawned:
    """A process that was started, and how it ended."""

    def __init__(
        self, argv: Sequence[str], output: IO[bytes], environment: Mapping[str, str] | None = None
    ) -> None:
        """Start it without an input; its output goes to a file. Raises OSError.

        `environment`: all of it; None: this process's.
        """
        self._process = subprocess.Popen(
            argv, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=environment
        )
        self.pid = self._process.pid

    @property
    def returncode(self) -> int | None:
        """How it ended; None while it runs."""
        return self._process.poll()

    def kill(self) -> None:
        """End it without a warning."""
        self._process.kill()

    def send_signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    async def wait(self) -> int:
        """Until it has ended; its status."""
        if self._process.poll() is None:
            await _gone(self.pid)
        return self._process.wait()


async def finished(argv: Sequence[str]) -> tuple[int, bytes, bytes]:
    """Run a short command to its end: status, output, errors. Raises OSError where it does not exist."""

    def run() -> subprocess.CompletedProcess[bytes]:
        return subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, check=False)

    done = await asyncio.to_thread(run)
    return done.returncode, done.stdout, done.stderr


async def _gone(pid: int) -> None:
    """Wait until a child has ended, without a thread; it is not reaped."""
    loop = asyncio.get_running_loop()
    descriptor = os.pidfd_open(pid)
    ended: asyncio.Future[None] = loop.create_future()
    loop.add_reader(descriptor, _settle, ended)
    try:
        await ended
    finally:
        loop.remove_reader(descriptor)
        os.close(descriptor)


def _settle(ended: asyncio.Future[None]) -> None:
    if not ended.done():
        ended.set_result(None)
