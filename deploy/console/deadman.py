"""Passes on what a page holds to the master on this host, one datagram a beat; never waits."""

from __future__ import annotations

import logging
import socket
from pathlib import Path

from common.clock import monotonic_ns
from common.inputs.heartbeat import DeadmanBeat, encode_beat
from common.log.throttle import LogThrottle

log = logging.getLogger(__name__)


class DeadmanRelay:
    """The sender's end of `[operator.deadman] socket`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failed = 0
        """Beats that the master could not take: it is not there, or its queue is full."""
        self._number = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._throttle = LogThrottle()

    def beat(self, down: bool) -> None:
        """Tell the master whether the page holds. A beat that is lost makes the robot hold, no more."""
        self._number += 1
        now_ns = monotonic_ns()
        try:
            self._socket.sendto(encode_beat(DeadmanBeat(down, self._number, now_ns)), str(self.path))
        except OSError as error:
            self.failed += 1
            if self._throttle.passes(now_ns):
                log.warning("%s: the master does not hear the deadman (%s)", self.path, error.strerror)

    def close(self) -> None:
        """No more beats."""
        self._socket.close()
