"""How many commands a second the master sends: fixed by its file, or as the robots' lines allow. Pure.

The same joint angles go to every robot, so the slowest line decides, and one that has fallen silent counts
as slow. A robot that was never heard, or whose lease another holds, does not decide; without any robot it is
the usual rate.
"""

from __future__ import annotations

from collections.abc import Mapping

from common.clock import NS_PER_S
from master.capture.rate import AUTO, USUAL_HZ, CaptureRate

LOG_EVERY_NS = 10 * NS_PER_S


class CommandRate:
    """Which ticks decide, from now on."""

    def __init__(self, rate: CaptureRate) -> None:
        self._rate = rate
        self.decimation = rate.usual
        """One tick in so many decides."""
        self.words = f"{rate.hz(self.decimation):g} Hz, as the file says"
        """Which rate is in force and why, for people."""
        if rate.command_hz == AUTO:
            self.words = f"{USUAL_HZ:g} Hz: no robot asks for more"

    @property
    def negotiated(self) -> bool:
        """Whether the robots have a say."""
        return self._rate.command_hz == AUTO

    @property
    def hz(self) -> float:
        """Commands a second in force."""
        return self._rate.hz(self.decimation)

    def follow(self, wanted_ms: Mapping[str, int]) -> bool:
        """Take the period that each commanded robot asks for, 0 where it does not say; whether it changed."""
        if not self.negotiated:
            return False
        robot = max(wanted_ms, key=lambda name: wanted_ms[name] or round(1e3 / USUAL_HZ), default="")
        before, self.decimation = self.decimation, self._rate.decimation(wanted_ms.get(robot, 0))
        if before == self.decimation:
            return False
        slowest = f"as the line to {robot} allows" if wanted_ms else "no robot asks for more"
        self.words = f"{self.hz:g} Hz: {slowest}"
        return True


class RateLog:
    """What the log says of the changes: the first at once, and then a line each 10 s at most.

    A robot may ask for another rate in every state.
    """

    def __init__(self) -> None:
        self._changes = 0
        self._said_ns: int | None = None

    def line(self, changed: bool, words: str, now_ns: int) -> str | None:
        """The line that is due, or None; `words` say which rate is in force. Call it at every look."""
        self._changes += changed
        if not self._changes or (self._said_ns is not None and now_ns - self._said_ns < LOG_EVERY_NS):
            return None
        often = f" (changed {self._changes} times since the last line)" if self._changes > 1 else ""
        self._said_ns, self._changes = now_ns, 0
        return f"commands at {words}{often}"
