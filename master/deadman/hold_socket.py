"""The socket at which the master hears the beats of a deadman that is held on a page; never blocks."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from common.clock import Clock, monotonic_ns, to_s
from common.inputs.device import InputError
from common.process.stale_socket import remove_stale
from master.deadman.held_elsewhere import HeldElsewhere

_MOST = 64
"""Datagrams taken at a time: a flood must not keep the loop."""
_LONGEST = 256
_ROUNDING_S = 0.001

log = logging.getLogger(__name__)


class HoldSocket:
    """Reads beats into a `HeldElsewhere`, and tells when it may have changed, by a beat or by silence."""

    def __init__(self, path: Path, held: HeldElsewhere, clock: Clock = monotonic_ns) -> None:
        self.path = path
        self.held = held
        self._clock = clock
        self._socket: socket.socket | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._on_change: Callable[[], None] = lambda: None

    def open(self, on_change: Callable[[], None]) -> None:
        """Begin to listen, in the running loop. Raises InputError."""
        remove_stale(self.path, socket.SOCK_DGRAM, "[operator.deadman] socket", InputError)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            before = os.umask(0o117)  # 0660: the owner and its group
            try:
                listener.bind(str(self.path))
            finally:
                os.umask(before)
        except OSError as error:
            listener.close()
            raise InputError(
                f"{self.path}: [operator.deadman] cannot listen there ({error.strerror or error})"
            ) from None
        self._socket, self._on_change = listener, on_change
        asyncio.get_running_loop().add_reader(listener, self._read)

    def poll(self) -> None:
        """Take what has come by now. Before each use."""
        if self._socket is None:
            return
        for _ in range(_MOST):
            try:
                data = self._socket.recv(_LONGEST)
            except BlockingIOError:
                return
            except OSError as error:
                log.warning("%s: the deadman's socket has failed (%s)", self.path, error.strerror)
                return
            self.held.datagram(data, self._clock())

    def close(self) -> None:
        """End, and remove the socket. Safe to call twice."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._socket is None:
            return
        asyncio.get_running_loop().remove_reader(self._socket)
        self._socket.close()
        self._socket = None
        with suppress(OSError):
            self.path.unlink()

    def _read(self) -> None:
        self.poll()
        self._on_change()
        if self._timer is None:
            self._watch()

    def _watch(self) -> None:
        """Look again when it would end by silence: no robot waits for the next posture to hear of it."""
        self._timer = None
        left_ns = self.held.left_ns(self._clock())
        if left_ns is None or self._socket is None:
            return
        if left_ns < 0:
            self._on_change()
            return
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(to_s(left_ns) + _ROUNDING_S, self._watch)
