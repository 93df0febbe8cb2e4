"""When each drive was last heard: by its answers to SYNC, and by its heartbeat. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_MS
from common.wire.messages import Mask
from slave.servos.canopen.config import CanopenConfig

_NEVER_NS = -(1 << 62)


class DriveSilence:
    """Which of all J drives are silent."""

    def __init__(self, config: CanopenConfig, drives: int) -> None:
        self._dead_ns = config.drive_dead_ms * NS_PER_MS
        self._blind_ns = config.dead_ms * NS_PER_MS // 2
        self._answered_ns: NDArray[np.int64] = np.zeros(drives, np.int64)
        self._beat_ns: NDArray[np.int64] = np.zeros(drives, np.int64)
        self._known_ns: NDArray[np.int64] = np.full(drives, _NEVER_NS, np.int64)
        """(J,) the SYNC at which each last sent its state."""
        self._cycled_ns = 0

    def begin(self, drive: int, now_ns: int) -> None:
        """From now on this drive is expected to answer."""
        self._answered_ns[drive] = self._beat_ns[drive] = now_ns

    def heartbeat(self, drive: int, now_ns: int) -> None:
        """A drive's heartbeat has come."""
        self._beat_ns[drive] = now_ns

    def known_ns(self, drive: int) -> int:
        """The newest SYNC that this drive answered; 0: none."""
        return max(0, int(self._known_ns[drive]))

    def cycle(self, now_ns: int, fresh: Mask, synced_ns: int) -> None:
        """The drives that are `fresh` (J,) have answered the SYNC of `synced_ns`."""
        self._answered_ns[fresh] = now_ns
        self._known_ns[fresh] = synced_ns
        if now_ns - self._cycled_ns > self._dead_ns // 2:
            # this process stalled: no drive was silent
            self._answered_ns[:] = self._beat_ns[:] = now_ns
        self._cycled_ns = now_ns

    def silent(self, now_ns: int) -> Mask:
        """(J,) drives of which neither heartbeat nor answer came in time."""
        out: Mask = now_ns - np.minimum(self._answered_ns, self._beat_ns) > self._dead_ns
        return out

    def seen(self, now_ns: int) -> list[bool]:
        """Drives whose state is known well enough to send them a controlword.

        One that may have stopped by itself meanwhile must not be told "enable" unseen: that moves it.
        """
        seen: list[bool] = (now_ns - self._known_ns < self._blind_ns).tolist()
        return seen
