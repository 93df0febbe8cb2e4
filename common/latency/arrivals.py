"""Which numbered messages arrived: lost on the way, out of order, come twice. Pure."""

from __future__ import annotations

from common.metrics.slave import ArrivalCounts

REMEMBERED = 256
"""A missing number may still come this many numbers later (20 s) and is then late, not lost."""
_FORGOTTEN_EVERY = 32
"""Numbers between two clearings of those that are too old: each goes through all that are missing."""


class Arrivals:
    """Counts since start, taken before the guard's gates, so that a refused message does not count as lost.

    A number that is missing when a newer one comes is lost, be it in the network or in this process,
    which keeps only the newest that waits (`link.command.overwritten` counts those). Where it comes after all
    it was late, and not lost.
    """

    def __init__(self) -> None:
        self.arrived = 0
        """All of them."""
        self.lost = 0
        self.late = 0
        """Came after a newer one."""
        self.repeated = 0
        """Came again."""
        self._lease: int | None = None
        self._newest = 0
        self._missing: set[int] = set()

    def note(self, lease: int, sequence: int) -> None:
        """Take one command of the current lease; the first of a lease begins its count."""
        self.arrived += 1
        if lease != self._lease:
            self._lease, self._newest = lease, sequence
            self._missing.clear()
        elif sequence > self._newest:
            self.lost += sequence - self._newest - 1
            if sequence != self._newest + 1:
                self._missing.update(range(max(self._newest + 1, sequence - REMEMBERED), sequence))
                self._forget(sequence)
            elif self._missing and sequence % _FORGOTTEN_EVERY == 0:
                self._forget(sequence)
            self._newest = sequence
        elif sequence in self._missing and sequence >= self._newest - REMEMBERED:
            self._missing.remove(sequence)
            self.lost -= 1
            self.late += 1
        else:
            self.repeated += 1

    def _forget(self, sequence: int) -> None:
        self._missing = {number for number in self._missing if number >= sequence - REMEMBERED}

    def metrics(self) -> ArrivalCounts:
        """The counts so far."""
        return ArrivalCounts(self.arrived, self.lost, self.late, self.repeated)
