"""Reports this process to systemd: ready, alive, its status, stopping (sd_notify(3)).

The protocol is one datagram a message. Written here, because the packages that offer it either block when
the manager does not read (`sdnotify`) or need a compiler and libsystemd's headers (`systemd-python`).
"""

from __future__ import annotations

import faulthandler
import logging
import os
import socket
import sys
from collections.abc import Callable, MutableMapping

from common.clock import NS_PER_MS

SOCKET, WATCHDOG, WATCHDOG_PID = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"
PINGS_A_PERIOD = 4
"""So many within the time after which the manager takes the loop for hung."""
STARTS_WITHIN_S = 30
"""Asked for with each word that the process still waits: the time to its next word, or to readiness."""
_RETRY_NS = 50 * NS_PER_MS
_NEVER_NS = 1 << 63
_MOST_TEXT = 256

log = logging.getLogger(__name__)


class Notifier:
    """Reports to the service manager; without one it does nothing. No call blocks or raises."""

    def __init__(self, send: Callable[[bytes], bool] | None = None, watchdog_ns: int = 0) -> None:
        """`send` delivers one message, False where it could not; `watchdog_ns`: 0 without a watchdog."""
        self._send = send
        self._every_ns = watchdog_ns // PINGS_A_PERIOD if watchdog_ns else _NEVER_NS
        self._next_ns = _NEVER_NS if send is None else 0
        self._ready = False
        self._last_status = ""
        self.unsent = 0
        """Messages that could not be delivered."""

    def beat(self, now_ns: int) -> None:
        """Called by the loop that is guarded, at the end of each of its ticks, and by nothing else.

        The first reports that the process is ready, those after it that the loop is alive. It costs one
        comparison but for a few times a second.
        """
        if now_ns < self._next_ns:
            return
        sent = self._send_message("WATCHDOG=1" if self._ready else "READY=1\nWATCHDOG=1")
        self._ready = self._ready or sent
        self._next_ns = now_ns + (self._every_ns if sent else min(_RETRY_NS, self._every_ns))

    def status(self, text: str) -> None:
        """What the process does, in words: `systemctl status` shows it."""
        line = _one_line(text)
        if line != self._last_status and self._send_message(f"STATUS={line}"):
            self._last_status = line

    def waits(self, text: str) -> None:
        """Not ready yet, for a reason outside this process; the manager's start time-out begins anew."""
        self._send_message(f"STATUS={_one_line(text)}\nEXTEND_TIMEOUT_USEC={STARTS_WITHIN_S * 1_000_000}")

    def stopping(self) -> None:
        """The process has begun to end; the loop need not beat any more."""
        self._next_ns = _NEVER_NS
        self._send_message("STOPPING=1")

    def _send_message(self, message: str) -> bool:
        if self._send is None:
            return False
        sent = self._send(message.encode("utf-8", "replace"))
        self.unsent += not sent
        return sent


def _one_line(text: str) -> str:
    """Printable characters on one line: a chosen name must not pass for a message to systemd."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:_MOST_TEXT]


def open_notifier(environment: MutableMapping[str, str] = os.environ) -> Notifier:
    """The notifier of the manager that started this process, if one did.

    Its variables are taken out of the environment: they are not for the children. Where a watchdog is set,
    a loop that hangs leaves its stack in the log when the manager ends it (SIGABRT).
    """
    address = environment.pop(SOCKET, "")
    watchdog_us, pid = environment.pop(WATCHDOG, ""), environment.pop(WATCHDOG_PID, "")
    if not address:
        return Notifier()
    if address[0] not in "/@":
        log.warning(
            "%s = %s: expected a path or an abstract socket; systemd gets no reports", SOCKET, address
        )
        return Notifier()
    ours = pid in ("", str(os.getpid()))
    watchdog_ns = 1000 * int(watchdog_us) if ours and watchdog_us.isdecimal() else 0
    if watchdog_ns and sys.__stderr__ is not None:
        faulthandler.enable(file=sys.__stderr__)
    return Notifier(_sender(address), watchdog_ns)


def _sender(address: str) -> Callable[[bytes], bool]:
    target = "\0" + address[1:] if address[0] == "@" else address

    def send(message: bytes) -> bool:
        try:
            # a socket each time: it is seldom, and there is none to be closed
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as wire:
                wire.setblocking(False)  # a manager that does not read must not hold up the loop
                wire.sendto(message, socket.MSG_NOSIGNAL, target)
        except OSError:
            return False
        return True

    return send
