"""A TCP link of limited rate and some length, with the deep queue that real ones have: a proxy of threads."""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass

from common.clock import monotonic_ns, to_ns, to_s

PACKET = 1448
"""Bytes of payload in one Ethernet frame."""


@dataclass(frozen=True, slots=True)
class SlowLinkOptions:
    """What kind of link."""

    bytes_per_s: float = 125_000.0
    """In each direction; or in both together where `shared`."""
    delay_s: float = 0.02
    """Of the way itself, in each direction."""
    shared: bool = False
    """One medium, such as a radio channel, that carries one packet at a time, whichever way it goes."""


class SlowLink:
    """Listens on `port` and carries what comes to `target_port` of this host and back, packet by packet.

    What cannot be sent yet waits in the sender's own socket buffer, hundreds of kB deep, in order.
    """

    def __init__(self, target_port: int, options: SlowLinkOptions) -> None:
        self._target_port = target_port
        self._options = options
        self._server = _socket()
        self._server.bind(("127.0.0.1", 0))
        self._server.listen()
        self.port: int = self._server.getsockname()[1]
        self._media = [_Medium(options.bytes_per_s) for _ in range(2)]
        if options.shared:
            self._media[1] = self._media[0]
        self._sockets: list[socket.socket] = []
        self._closed = False

    def __enter__(self) -> SlowLink:
        """Let connections in."""
        threading.Thread(target=self._accept, name="slow-link", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Cut it."""
        self._closed = True
        for end in (self._server, *self._sockets):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _accept(self) -> None:
        while not self._closed:
            try:
                here, _ = self._server.accept()
                there = _socket()
                there.connect(("127.0.0.1", self._target_port))
            except OSError:
                return
            for end in (here, there):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets.append(end)
            for medium, source, sink in zip(self._media, (here, there), (there, here), strict=True):
                way = _OneDirection(medium, source, sink, to_ns(self._options.delay_s))
                for name, work in (("send", way.send), ("travel", way.travel)):
                    threading.Thread(target=work, name=f"slow-{name}", daemon=True).start()


class _Medium:
    """Carries one packet at a time."""

    def __init__(self, bytes_per_s: float) -> None:
        self._bytes_per_s = bytes_per_s
        self._turn = threading.Lock()
        self._free_ns = 0

    def carry(self, size: int) -> None:
        """Wait until a packet that is here now is through."""
        with self._turn:
            self._free_ns = max(self._free_ns, monotonic_ns()) + round(1e9 * size / self._bytes_per_s)
            _sleep_until(self._free_ns)


class _OneDirection:
    """One direction of one connection."""

    def __init__(self, medium: _Medium, source: socket.socket, sink: socket.socket, delay_ns: int) -> None:
        self._medium, self._source, self._sink, self._delay_ns = medium, source, sink, delay_ns
        self._travelling: deque[tuple[int, bytes]] = deque()
        self._some = threading.Semaphore(0)

    def send(self) -> None:
        """From the sender through the medium."""
        with suppress(OSError):
            while packet := self._source.recv(PACKET):
                self._medium.carry(len(packet))
                self._put(packet)
        self._put(b"")

    def travel(self) -> None:
        """Along the way to the receiver."""
        with suppress(OSError):
            while True:
                self._some.acquire()
                due_ns, packet = self._travelling.popleft()
                _sleep_until(due_ns)
                if not packet:
                    self._sink.shutdown(socket.SHUT_WR)
                    return
                self._sink.sendall(packet)

    def _put(self, packet: bytes) -> None:
        self._travelling.append((monotonic_ns() + self._delay_ns, packet))
        self._some.release()


def _socket() -> socket.socket:
    """As over Ethernet: a segment of loopback's 64 kB would wait for a window that never opens so far."""
    made = socket.socket()
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, PACKET)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 * PACKET)
    return made


def _sleep_until(due_ns: int) -> None:
    left_ns = due_ns - monotonic_ns()
    if left_ns > 0:
        time.sleep(to_s(left_ns))
