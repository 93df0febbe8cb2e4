"""By how much a SYNC's stamp may differ from when the drives read their angles. Pure.

Some drives read them when SYNC arrives, which is late where the host or the bus was. Others lock a cycle of
their own to SYNC by a slow phase-locked loop, and then read them on time though SYNC was late. No object says
which of both a drive does, so both are allowed for.
"""

from __future__ import annotations

_GAIN = 0.02
"""Of the loop that stands for the drives': it follows what stays, and leaves out what does not."""


class SyncStamps:
    """Give it each SYNC once it has been sent."""

    def __init__(self, period_ns: int, usual_ns: int) -> None:
        """`usual_ns`: what stamps are always wrong by at most, however punctual SYNC is."""
        self._period_ns, self._usual_ns = period_ns, usual_ns
        self._grid_ns: int | None = None
        self.error_ns = usual_ns
        """Of the newest SYNC's stamp, which is `before_ns`."""

    def sent(self, before_ns: int, after_ns: int) -> None:
        """It left between these two times of the slave's clock, on all buses."""
        if self._grid_ns is None:
            self._grid_ns = before_ns
        # a SYNC that was left out does not shift the others
        periods = round((before_ns - self._grid_ns) / self._period_ns)
        off_ns = before_ns - self._grid_ns - periods * self._period_ns
        self._grid_ns = before_ns - off_ns + round(_GAIN * off_ns)
        self.error_ns = self._usual_ns + abs(off_ns) + (after_ns - before_ns)
