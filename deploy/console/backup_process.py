"""The process that goes on asking for stops once the console has died. It waits at its standard input.

It reads lines of JSON: first where the robots are, then the stops that are asked for and those that are done
with. When the input ends, it asks for each stop that is left, until the robot acknowledges it or the time is
up. It loads the link only then, so that waiting costs little memory.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from typing import TextIO

WITHIN_S = 60.0
READY = b"ready\n"
"""What it says first: it was found, loaded and begun."""


def stops_left(lines: TextIO) -> tuple[dict[str, object], list[str]]:
    """Where the robots are, and those whose stops nobody is done with, when the input has ended.

    A last line that was cut off by the sender's death is left out: its stop was not answered for.
    """
    where: dict[str, object] = {}
    open_stops: dict[str, None] = {}
    for line in lines:
        try:
            said = json.loads(line)
        except ValueError:
            continue
        where |= said.get("where", {})
        if "stop" in said:
            open_stops[said["stop"]] = None
        if "done" in said:
            open_stops.pop(said["done"], None)
    return where, list(open_stops)


def ask_on(where: dict[str, object], robots: list[str], within_s: float = WITHIN_S) -> None:
    """Ask each of these robots to stop. Raises TandemError where there is no link."""
    import asyncio
    from pathlib import Path

    from common.config.load import check_config
    from common.link.config import LinkConfig
    from deploy.client.destination import Destination
    from deploy.client.stop import stop_robots

    told = where["link"]
    assert isinstance(told, dict)
    link = check_config(Path("console"), told, LinkConfig)
    there = Destination(link, tuple(robots), str(where["operator"]))

    def report(answer: object) -> None:
        sys.stderr.write(f"after the console's end: {answer}\n")

    asyncio.run(stop_robots(there, False, report, within_s))


def main() -> None:
    """Say that this process runs, and wait for the console's end."""
    with suppress(OSError):  # the console has died already
        os.write(sys.stdout.fileno(), READY)
    where, robots = stops_left(sys.stdin)
    if robots:
        ask_on(where, robots)


if __name__ == "__main__":
    main()
