"""The usual time between two samples, whatever comes out of turn."""

from __future__ import annotations

from collections import deque

_REMEMBERED = 5


class Spacing:
    """The median of the last five times between samples.

    A command out of turn (the master sends one as it names a node) splits one period into two unequal parts,
    and a lost command joins two periods. Neither changes the median; another rate does, after three commands.
    """

    def __init__(self) -> None:
        self._last_s: deque[float] = deque(maxlen=_REMEMBERED)

    def reset(self) -> None:
        """Forget the rate."""
        self._last_s.clear()

    def note(self, elapsed_s: float) -> None:
        """Take the time between a sample's capture and that of the sample before."""
        self._last_s.append(elapsed_s)

    @property
    def usual_s(self) -> float | None:
        """None before the first."""
        return sorted(self._last_s)[len(self._last_s) // 2] if self._last_s else None
