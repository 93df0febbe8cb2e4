"""Hands each stop to a process that outlives the console. The page gets its answer only after that."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from collections.abc import Sequence

from common.link.config import LinkConfig
from deploy.console import backup_process

END_S = 2.0

log = logging.getLogger(__name__)
_COMMAND = (sys.executable, "-m", backup_process.__name__)


class StopBackup:
    """The console's end of the pipe to the process. It never waits: a full pipe counts as a dead process."""

    def __init__(self, link: LinkConfig, operator: str, command: Sequence[str] = _COMMAND) -> None:
        self._where = {"where": {"link": link.model_dump(mode="json"), "operator": operator}}
        self._command = command
        self._open: dict[str, None] = {}
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> bool:
        """Begin the process, or begin it anew; whether it took all that it must know."""
        self._let_go(wait=False)
        try:
            # a session of its own: what ends the console by its terminal or its group does not end this
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
            )
        except OSError as error:
            log.error("stops have no backup, should this console die: %s", error)
            return False
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        return self._write(self._where) and all(self._write({"stop": robot}) for robot in self._open)

    def keep(self, robot: str) -> bool:
        """A stop is asked for: whether another process goes on with it, should this one die now."""
        self._open[robot] = None
        alive = self._process is not None and self._process.poll() is None
        return (alive and self._write({"stop": robot})) or self.start()

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
