"""`python -m deploy.ops.network.probe`: one end of a measurement, run within a host.

Sends numbered, stamped packets at a steady rate and notes those of the other end. The hosts are on one
machine, so one clock stamps both ends: the one-way times are exact, whatever the two sides may know.
"""

from __future__ import annotations

import json
import select
import socket
import struct
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass

from common.clock import NS_PER_S, to_ns, to_s, wall_ns
from common.metrics.tree import to_tree
from common.process.realtime import enter_real_time

PORT = 7450
STAMP = struct.Struct("!Iq")
"""Number and time of sending, of the clock by which the kernel stamps arrivals."""
IP_UDP_BYTES = 28
PRIORITY = 40
"""Below the forwarder: a probe that hurries must not hold up what it measures."""
_SO_TIMESTAMPNS, _SO_RCVBUFFORCE = 35, 33
_TIMESPEC = struct.Struct("qq")
_BUFFER = 8_000_000


@dataclass(frozen=True, slots=True)
class ProbePlan:
    """What one end does."""

    here: str
    """Address to send from, as `there` to send to."""
    there: str
    rate_hz: float
    packets: int
    """How many to send."""
    size: int
    """The size of the IP packet, bytes."""
    listen_s: float
    """How long to listen, from the start."""

    def arguments(self) -> list[str]:
        """For the command line."""
        return [json.dumps(asdict(self))]


@dataclass(frozen=True, slots=True)
class ProbeResult:
    """What one end did and saw."""

    sent: int
    arrivals: list[tuple[int, int, int]]
    """Number, time of sending and time of arrival, ns."""


def open_end(plan: ProbePlan) -> socket.socket:
    """The socket: it hears from now on, and the kernel stamps what it hears."""
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with suppress(OSError):  # beyond the host's limit for everybody, where permitted
        end.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER)
    end.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
    end.bind((plan.here, PORT))
    end.setblocking(False)
    return end


def run(plan: ProbePlan, end: socket.socket, start_ns: int) -> ProbeResult:
    """Send and listen as planned."""
    padding = bytes(plan.size - IP_UDP_BYTES - STAMP.size)
    period_ns = NS_PER_S / plan.rate_hz
    arrivals: list[tuple[int, int, int]] = []
    refused, number = 0, 0
    until_ns = start_ns + to_ns(plan.listen_s)
    while (now_ns := wall_ns()) < until_ns:
        next_ns = start_ns + round(number * period_ns)
        if number < plan.packets and now_ns >= next_ns:
            try:
                end.sendto(STAMP.pack(number, wall_ns()) + padding, (plan.there, PORT))
            except OSError:  # the queue of the interface is full
                refused += 1
            number += 1
            continue
        wait_ns = (next_ns if number < plan.packets else until_ns) - now_ns
        if select.select([end], [], [], to_s(max(wait_ns, 0)))[0]:
            arrivals.extend(_arrived(end))
    return ProbeResult(number - refused, arrivals)


def _arrived(end: socket.socket) -> list[tuple[int, int, int]]:
    """Stamped by the kernel: it is not late when this process is."""
    payload, extra, _, _ = end.recvmsg(2048, socket.CMSG_SPACE(_TIMESPEC.size))
    if len(payload) < STAMP.size:
        return []
    number, sent_ns = STAMP.unpack_from(payload)
    seconds, nanoseconds = _TIMESPEC.unpack(extra[0][2])
    return [(number, sent_ns, seconds * NS_PER_S + nanoseconds)]


def main() -> None:
    """Argument: the plan as JSON. Says `ready`, reads when to start (ns), prints what was seen as JSON."""
    plan = ProbePlan(**json.loads(sys.argv[1]))
    enter_real_time(PRIORITY)
    end = open_end(plan)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    start = sys.stdin.readline()
    if start:  # else the parent has given up
        json.dump(to_tree(run(plan, end, int(start))), sys.stdout)


if __name__ == "__main__":
    main()
