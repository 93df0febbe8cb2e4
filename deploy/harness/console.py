"""A console beside a rig: a process of its own at the master's tap, and the addresses that it prints."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import Literal

from deploy.harness.child import Child
from deploy.harness.rig import Rig

CONSOLE = "console"
USUAL = 8080
STARTS_S = 30.0


class ConsoleChild:
    """`tandem console` of a rig whose master or slave has a tap (`tap.socket` among its overrides)."""

    def __init__(self, rig: Rig, side: Literal["master", "slave"] = "master") -> None:
        """`side`: at whose tap it stands."""
        self._side = side
        self.child = rig.children.setdefault(CONSOLE, Child(CONSOLE, rig.folder))
        self._rig = rig

    async def start(self, listen: str | None = "127.0.0.1:0", arguments: Sequence[str] = ()) -> None:
        """Start it, and wait until it serves. Raises TandemError where it does not.

        `listen` None: at its usual port if that is free, else at any.
        """
        listen = _usual_or_any() if listen is None else listen
        given = [f"--{self._side}", str(self._rig.file(self._side)), "--listen", listen, *arguments]
        for override in self._rig.overrides(self._side):
            given += ["--set", override]
        await self.child.run(given)
        await self._rig.until_logged(CONSOLE, "engineer: ", STARTS_S)

    @property
    def address(self) -> str:
        """Of the page, without a token."""
        return self._printed("console: ").partition(" ")[0]

    @property
    def operator_address(self) -> str:
        """With the newest token of an operator."""
        return self._printed("operator: ")

    @property
    def engineer_address(self) -> str:
        """With the newest token of an engineer."""
        return self._printed("engineer: ")

    def _printed(self, before: str) -> str:
        lines = [line for line in self.child.log_text().splitlines() if line.startswith(before)]
        return lines[-1].removeprefix(before).strip()


def _usual_or_any() -> str:
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind(("127.0.0.1", USUAL))
        except OSError:
            return "127.0.0.1:0"
    return f"127.0.0.1:{USUAL}"
