"""Hands each stop to a process that outlives the console. The page gets its answer only after that."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress

from common.clock import monotonic_ns, to_ns
from common.link.config import LinkConfig
from deploy.console import backup_process
from deploy.console.backup_process import READY

END_S = 2.0
BEGINS_S = 10.0
"""Within which the process must have said that it runs."""
LOOK_S, AGAIN_S = 1.0, 30.0
"""How often it is looked at, and between two beginnings of one that does not come up."""

log = logging.getLogger(__name__)
_COMMAND = (sys.executable, "-m", backup_process.__name__)


class StopBackup:
    """The console's end of the pipe to the process. It never waits: a full pipe counts as a dead process."""

    def __init__(self, link: LinkConfig, operator: str, command: Sequence[str] = _COMMAND) -> None:
        self._where = {"where": {"link": link.model_dump(mode="json"), "operator": operator}}
        self._command = command
        self._open: dict[str, None] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._began_ns = 0
        self._up = False
        self._said = ""

    def start(self) -> bool:
        """Begin the process, or begin it anew; whether it took all that it must know."""
        self._let_go(wait=False)
        self._began_ns, self._up = monotonic_ns(), False
        try:
            # a session of its own: what ends the console by its terminal or its group does not end this
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            log.error("stops have no backup, should this console die: %s", error)
            return False
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        os.set_blocking(self._process.stdout.fileno(), False)
        return self._write(self._where) and all(self._write({"stop": robot}) for robot in self._open)

    def keep(self, robot: str) -> bool:
        """A stop is asked for: whether another process goes on with it, should this one die now."""
        self._open[robot] = None
        never_up = self._never_up(monotonic_ns())
        alive = self._process is not None and self._process.poll() is None
        if alive and self._write({"stop": robot}):
            return not never_up
        # what could not begin before will hardly begin now
        return self.start() and not never_up

    def look(self, now_ns: int) -> None:
        """Begin the process anew where it has died, and log it where it does not come up."""
        never_up = self._never_up(now_ns)
        dead = self._process is None or self._process.poll() is not None
        words = ""
        if never_up or dead:
            why = "it does not start" if never_up else "it has ended"
            words = f"stops have no backup, should this console die: {why}: {' '.join(self._command)}"
        if words and words != self._said:
            log.error("%s", words)
        self._said = words
        if dead and (not never_up or now_ns - self._began_ns > to_ns(AGAIN_S)):
            self.start()

    async def watch(self) -> None:
        """Look until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            self.look(monotonic_ns())

    def _never_up(self, now_ns: int) -> bool:
        """Whether the process has died, or let the time pass, before it said that it runs."""
        process = self._process
        if process is None:
            return not self._up
        if not self._up and process.stdout is not None:
            with suppress(BlockingIOError):
                self._up = os.read(process.stdout.fileno(), len(READY)) == READY
        late = process.poll() is not None or now_ns - self._began_ns > to_ns(BEGINS_S)
        return not self._up and late

    def done(self, robot: str) -> None:
        """The robot has acknowledged, or is no longer asked."""
        self._open.pop(robot, None)
        if self._process is not None:
            self._write({"done": robot})

    def close(self) -> None:
        """End in order. A stop that is still under way is the other process's from now on."""
        self._let_go(wait=not self._open)

    def _let_go(self, wait: bool) -> None:
        """End its input. `wait`: it has nothing to do, and ends at once; else it is nobody's child here."""
        process, self._process = self._process, None
        if process is None or process.stdin is None:
            return
        process.stdin.close()
        if process.stdout is not None:
            process.stdout.close()
        if wait:
            process.wait(END_S)
        elif process.poll() is None:
            process.returncode = 0  # nobody here waits for it: it outlives this process

    def _write(self, message: object) -> bool:
        assert self._process is not None
        assert self._process.stdin is not None
        line = json.dumps(message).encode() + b"\n"
        try:
            return os.write(self._process.stdin.fileno(), line) == len(line)
        except OSError:
            return False
