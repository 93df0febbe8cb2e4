"""The suit's calibration as the page leads it: one at a time, in a process of its own, while the robot holds.

The process reads the master's tap and computes as `tandem calibrate live` does (`tandem calibrate led`).
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from common.config.console import CalibrationPageConfig
from common.errors import TandemError

WHATS = ("imu", "mag", "align")
END_S = 5.0
"""A process whose input has ended closes its recordings within this, or is killed."""
COMPUTE_S = 60.0
"""One that was computing by then may end that first."""
LONGEST = 1 << 20
"""Bytes of a line."""
_COMMAND = (sys.executable, "-m", "deploy", "calibrate", "led")

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class CalibrationPlace:
    """Where a suit can be calibrated."""

    master: Path
    """The master's file."""
    tap: Path
    config: CalibrationPageConfig
    overrides: Sequence[str] = ()
    """Of the master's file."""


class CalibrationDesk:
    """What the page asks, and what it is shown. `shown` is None before the first."""

    def __init__(self, place: CalibrationPlace | None = None, command: Sequence[str] = _COMMAND) -> None:
        self._place = place
        self._command = command
        self._process: asyncio.subprocess.Process | None = None
        self._begins = False
        self._reading: asyncio.Task[None] | None = None
        self._overdue: asyncio.TimerHandle | None = None
        self.shown: dict[str, object] | None = None
        self.on_shown: Callable[[], None] = lambda: None
        """Called when there is more to show."""

    @property
    def under_way(self) -> bool:
        """Whether a person is being led, or the result is being computed."""
        return self._begins or self._process is not None

    @property
    def why_not(self) -> str:
        """Why this console calibrates nothing; empty where it can."""
        if self._place is None:
            return (
                "no suit can be calibrated from here: it needs the master's file, [tap] socket and "
                "[console.calibration] folder on this host"
            )
        return ""

    async def act(self, body: Mapping[str, object], engaged: Iterable[str]) -> str:
        """Do what the page asks; words for the person. Raises TandemError.

        `engaged`: robots that follow an operator or move to their posture.
        """
        match body.get("do"):
            case "begin":
                return await self._begin(body.get("what"), list(engaged))
            case "word":
                return self._word()
            case "end":
                if not self.under_way:
                    raise TandemError("no calibration is under way")
                self.end("ended by a person; what was recorded stays")
                return "the calibration ends"
            case other:
                raise TandemError(f"do: expected begin, word or end, not {str(other)[:20]!r}")

    def watch(self, engaged: Iterable[str]) -> None:
        """A robot that was engaged meanwhile ends it: its operator wears a suit that is not in use."""
        robots = list(engaged)
        if robots and self.under_way:
            self.end(f"{', '.join(robots)} was engaged: a suit is calibrated only while the robot holds")

    def end(self, why: str) -> None:
        """Let the process close its recordings; what was computed until now stays."""
        process = self._process
        if process is not None and process.stdin is not None and not process.stdin.is_closing():
            self._show({"error": why})
            process.stdin.close()
            within_s = COMPUTE_S if (self.shown or {}).get("computing") else END_S
            self._overdue = asyncio.get_running_loop().call_later(within_s, self._kill, process)

    async def close(self) -> None:
        """The console ends."""
        self.end("the console ends")
        if self._reading is not None:
            await self._reading

    async def _begin(self, what: object, engaged: list[str]) -> str:
        place = self._place
        if place is None:
            raise TandemError(self.why_not)
        if self.under_way:
            raise TandemError("a calibration is under way already")
        if engaged:
            raise TandemError(f"{', '.join(engaged)} is engaged: disengage first, so that the robot holds")
        if not isinstance(what, list) or not what or any(each not in WHATS for each in what):
            raise TandemError(f"what: expected one or more of {', '.join(WHATS)}")
        self._begins = True
        try:
            pipe = asyncio.subprocess.PIPE
            self._process = process = await asyncio.create_subprocess_exec(
                *self._command, stdin=pipe, stdout=pipe, limit=LONGEST
            )
        except OSError as error:
            raise TandemError(f"the calibration cannot begin: {error.strerror}") from None
        finally:
            self._begins = False
        self.shown = {"under_way": True, "what": [each for each in WHATS if each in what]}
        config = place.config
        order = {
            "master": str(place.master),
            "tap": str(place.tap),
            "out": str(config.folder),
            "what": self.shown["what"],
            "overrides": list(place.overrides),
            "gravity_m_s2": config.gravity_m_s2,
            "hemisphere": config.hemisphere,
            "countdown_s": config.countdown_s,
        }
        self._say(order)
        self._reading = asyncio.create_task(self._read(process))
        self._show({})
        return "the calibration begins: robots stay disengaged until it is over"

    def _word(self) -> str:
        if not self.under_way:
            raise TandemError("no calibration is under way")
        self._say({"do": "word"})
        return "understood"

    def _say(self, message: Mapping[str, object]) -> None:
        process = self._process
        if process is not None and process.stdin is not None and not process.stdin.is_closing():
            process.stdin.write(json.dumps(message).encode() + b"\n")

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdout is not None
        try:
            while line := await process.stdout.readline():
                with suppress(ValueError):
                    self._show(json.loads(line))
            await asyncio.wait_for(process.wait(), END_S)
        except TimeoutError:
            self._kill(process)
        finally:
            if self._overdue is not None:
                self._overdue.cancel()
                self._overdue = None
            if process.returncode is None:
                process.kill()
                await process.wait()
            self._process = None
            shown = self.shown or {}
            if "outcome" not in shown and "error" not in shown:
                log.error("the calibration's process ended with status %s", process.returncode)
                self._show({"error": "the calibration failed: see the console's log"})
            self._show({"under_way": False})

    @staticmethod
    def _kill(process: asyncio.subprocess.Process) -> None:
        if process.returncode is None:
            log.error("the calibration's process did not end; it is killed")
            process.kill()

    def _show(self, change: Mapping[str, object]) -> None:
        shown = {**(self.shown or {}), **change}
        if "error" in (self.shown or {}) and "error" in change:
            shown["error"] = (self.shown or {})["error"]  # the first one is why
        self.shown = shown
        self.on_shown()
