"""A process of a rig: start it, measure it, kill it, start it again, stop it; its log is kept."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import psutil

from common.config.load import FROM_FILE
from common.errors import TandemError
from common.metrics.tree import from_tree
from deploy.harness.spawn import Spawned

_Metrics = TypeVar("_Metrics")

STOP_S = 5.0
"""Grace between SIGTERM and SIGKILL: above the processes' own shutdown deadline."""


@dataclass(frozen=True, slots=True)
class Usage:
    """What a process uses now."""

    rss_mb: float
    fds: int
    threads: int
    cpu_s: float
    """User and system time since its start."""


def environment_of_a_run(folder: Path, environment: Mapping[str, str]) -> dict[str, str]:
    """The environment of a process of a run, whose robots remember their joints' angles in the run's folder.

    In the user's own folder they would tell a real robot of the same name where it stood, and one another.
    """
    kept = {name: value for name, value in environment.items() if name != "STATE_DIRECTORY"}
    return kept | {"XDG_STATE_HOME": str(folder / "state")}


class Child:
    """One `tandem ROLE FILE` process. Its log and its metrics file lie in the run's folder."""

    def __init__(
        self,
        role: str,
        folder: Path,
        tandem: Sequence[str] = (sys.executable, "-m", "deploy"),
        name: str | None = None,
    ) -> None:
        """`name`: of one among several with the same role.

        Changes of its file never stand in its command line: `ps` would name the transport of a blinded trial.
        """
        self.role = role
        self.name = name or role
        self._tandem = tandem
        self.changes = folder / f"{self.name}.changes"
        """Of its file, for this run."""
        self.log = folder / f"{self.name}.log"
        self.metrics_file = folder / f"{self.name}.metrics.json"
        self._environment = environment_of_a_run(folder, os.environ)
        self._process: Spawned | None = None
        self._usage: psutil.Process | None = None
        self._cpu_from = (0.0, 0.0)
        self._cpu_to = (0.0, 0.0)
        self.rss_mb = 0.0
        self.lifetime = 0
        """How often it has been started."""

    async def start(
        self, config: Path, overrides: Sequence[str], through: Sequence[str] = (), options: Sequence[str] = ()
    ) -> None:
        """Start it; its output goes to the log. `through`: a command that becomes it, such as `unshare`.

        `options`: of its command line, besides.
        """
        arguments = [str(config), "--metrics", str(self.metrics_file), *options]
        if overrides:
            self.changes.write_text("\n".join(overrides) + "\n", "utf-8")
            arguments += ["--set", f"{FROM_FILE}{self.changes}"]
        await self.run(arguments, through)

    async def run(self, arguments: Sequence[str], through: Sequence[str] = ()) -> None:
        """Start `tandem ROLE` with these arguments; with `--debug` where this process has it."""
        self.lifetime += 1
        with self.log.open("ab") as log:
            debug = ["--debug"] if logging.getLogger().isEnabledFor(logging.DEBUG) else []
            self._process = Spawned(
                [*through, *self._tandem, self.role, *arguments, *debug], log, self._environment
            )
        self._usage = psutil.Process(self._process.pid)

    @property
    def running(self) -> bool:
        """Whether it has been started and has not ended."""
        return self._process is not None and self._process.returncode is None

    @property
    def usage(self) -> Usage | None:
        """What it uses now; None where it does not run."""
        return usage(self._usage) if self._usage is not None and self.running else None

    def check(self) -> None:
        """Raise TandemError with the end of the process's log if it has ended."""
        process = self._process
        if process is not None and process.returncode is not None:
            raise TandemError(f"the {self.name} ended with status {process.returncode}: {self.last_lines()}")

    def measure(self, first: bool = False) -> None:
        """Take a sample of CPU time and memory; `first` begins the period that `cpu_percent` covers."""
        used = self.usage
        if used is None:  # it has ended: `check` raises
            return
        self.rss_mb = used.rss_mb
        self._cpu_to = (asyncio.get_running_loop().time(), used.cpu_s)
        if first:
            self._cpu_from = self._cpu_to

    @property
    def cpu_percent(self) -> float:
        """Percent of one core over the measured period."""
        wall = self._cpu_to[0] - self._cpu_from[0]
        return 100.0 * (self._cpu_to[1] - self._cpu_from[1]) / wall if wall > 0 else 0.0

    async def kill(self) -> None:
        """End it without a warning, as a crash would."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()

    def send(self, number: signal.Signals) -> None:
        """Send it a signal."""
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(number)

    async def stop(self, by: signal.Signals = signal.SIGTERM) -> int | None:
        """Ask it to stop, kill it if it does not, and return its exit status."""
        process = self._process
        if process is None:
            return None
        if process.returncode is None:
            process.send_signal(by)
            try:
                await asyncio.wait_for(process.wait(), STOP_S)
            except TimeoutError:
                await self.kill()
        return process.returncode

    def metrics(self, kind: type[_Metrics]) -> _Metrics | None:
        """What the process counted, written when it stopped; None if it could not.

        Raises CodecError where the file holds something else.
        """
        try:
            tree = json.loads(self.metrics_file.read_text("utf-8"))
        except (OSError, ValueError):
            return None
        return from_tree(kind, tree)

    def log_text(self) -> str:
        """Everything it has logged so far."""
        return self.log.read_text("utf-8", errors="replace")

    def last_lines(self) -> str:
        """The end of its log."""
        lines = self.log_text().strip().splitlines()
        return " | ".join(lines[-3:]) or "its log is empty"


def usage(process: psutil.Process) -> Usage | None:
    """What a process uses now; None where it has just ended."""
    try:
        with process.oneshot():
            times = process.cpu_times()
            return Usage(
                process.memory_info().rss / 1e6,
                process.num_fds(),
                process.num_threads(),
                times.user + times.system,
            )
    except psutil.Error:
        return None
