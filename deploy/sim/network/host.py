"""One of the two hosts, as its users see it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EmulatedHost:
    """A network namespace of this machine."""

    name: str
    namespace: str
    address: str
    """On the emulated link."""
    management: str
    """On a clean veth to the caller's namespace: for observers."""
    caller: str
    """The caller's own address on that veth."""

    def command(self, argv: Sequence[str]) -> list[str]:
        """`argv` as it runs within this host."""
        return [shutil.which("ip") or "ip", "netns", "exec", self.namespace, *argv]
