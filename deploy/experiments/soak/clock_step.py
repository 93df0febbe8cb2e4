"""Steps a process's clock: the process runs in a time namespace, where CLOCK_MONOTONIC is offset."""

from __future__ import annotations

import sys

from common.clock import NS_PER_S, monotonic_ns
from deploy.harness.spawn import finished

PROBE_S = 86_400


def through(step_s: int) -> tuple[str, ...]:
    """The command that runs another one with its monotonic clock so far ahead of the host's."""
    return ("unshare", "--time", "--monotonic", str(step_s), "--")


async def why_not() -> str:
    """The reason why this host cannot step a process's clock; empty where it can."""
    look = "import time; print(time.monotonic_ns())"
    try:
        status, out, err = await finished([*through(PROBE_S), sys.executable, "-c", look])
    except OSError as error:
        return f"a clock is stepped by `unshare --time`: {error.strerror}"
    if status != 0:
        lines = err.decode("utf-8", "replace").strip().splitlines()
        return f"`unshare --time` is refused: {lines[-1] if lines else status}"
    if int(out) - monotonic_ns() < PROBE_S * NS_PER_S // 2:
        return "`unshare --time` leaves the clock as it is: the kernel is older than 6.0"
    return ""
