"""The recorders of a session: one process a tap, so that none holds up another, or the person's keys."""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from common.errors import TandemError

END_S = 5.0


class SessionRecorders:
    """Starts them, and ends them in order."""

    def __init__(self, session: Path, taps: Sequence[Path]) -> None:
        """Raises TandemError where two taps would give one file."""
        self._session = session
        self._taps = {tap.stem: tap for tap in taps}
        if len(self._taps) < len(taps):
            raise TandemError("two --tap have the same name: their files would, too")
        self._running: dict[str, asyncio.subprocess.Process] = {}

    async def start(self) -> None:
        """Begin to record each tap into NAME.mcap."""
        for name, tap in self._taps.items():
            self._running[name] = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "deploy", "record", "--tap", str(tap), "--out",
                str(self._session / f"{name}.mcap"), "--session", str(self._session),
                stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE, start_new_session=True,
            )  # fmt: skip

    async def ended(self) -> str:
        """Wait until one ends by itself, which none should; its name."""
        if not self._running:
            await asyncio.Event().wait()
        waiting = {asyncio.create_task(one.wait()): name for name, one in self._running.items()}
        done, others = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        for task in others:
            task.cancel()
        return waiting[next(iter(done))]

    async def stop(self) -> dict[str, str]:
        """End all; what each said last, by name."""
        for process in self._running.values():
            with suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
        said = {}
        for name, process in self._running.items():
            try:
                out, error = await asyncio.wait_for(process.communicate(), END_S)
            except TimeoutError:
                process.kill()
                said[name] = "did not end in time"
                continue
            lines = (error if process.returncode else out).decode(errors="replace").strip().splitlines()
            said[name] = lines[-1] if lines else f"ended with status {process.returncode}"
        return said
