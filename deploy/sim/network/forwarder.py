"""`python -m deploy.sim.network.forwarder`: carries packets between two TUN devices as a profile says.

Its parent opens the devices and hands them over, with a socket on which it asks (`emulation.py`); when that
closes, because the parent is done or dead, it ends.
"""

from __future__ import annotations

import gc
import json
import os
import select
import socket
import sys
from contextlib import suppress

from common.clock import monotonic_ns, to_s
from common.metrics.tree import from_tree, to_tree
from common.process.realtime import enter_real_time
from deploy.sim.network.emulation import TO_OPERATOR, TO_ROBOT, EmulatedLink, LinkRequest
from deploy.sim.network.profile import Profile

PRIORITY = 60
"""Above the two sides: a packet that waits for the processor is a delay that the profile does not know."""
BATCH = 32
"""Packets read from one device before the others are looked at."""
LONGEST = 65_536
REQUEST_BYTES = 1_000_000


def carry(link: EmulatedLink, operator: int, robot: int, control: socket.socket) -> None:
    """Until the control socket closes. `operator` and `robot` are TUN devices that do not block."""
    direction = {operator: TO_ROBOT, robot: TO_OPERATOR}
    end = {TO_ROBOT: robot, TO_OPERATOR: operator}
    while True:
        next_ns = link.next_ns
        wait_s = None if next_ns is None else max(to_s(next_ns - monotonic_ns()), 0.0)
        # select, not epoll: its timeout is in microseconds
        readable, _, _ = select.select([operator, robot, control.fileno()], [], [], wait_s)
        for device in readable:
            if device == control.fileno():
                request = control.recv(REQUEST_BYTES)
                if not request:
                    return
                counters = link.answer(from_tree(LinkRequest, json.loads(request)), monotonic_ns())
                control.send(json.dumps(to_tree(counters)).encode())
            else:
                _read(link, device, direction[device])
        for way, packet in link.due(monotonic_ns()):
            with suppress(OSError):  # the host has taken its interface down: lost, as it would be
                os.write(end[way], packet)


def _read(link: EmulatedLink, device: int, way: str) -> None:
    with suppress(BlockingIOError):
        for _ in range(BATCH):
            link.push(way, monotonic_ns(), os.read(device, LONGEST))


def main() -> None:
    """Arguments: the three file descriptors and a seed; the first request sets the profile."""
    operator, robot, control_fd, seed = map(int, sys.argv[1:])
    control = socket.socket(fileno=control_fd)
    enter_real_time(PRIORITY)
    gc.disable()  # nothing here makes cycles
    carry(EmulatedLink(Profile(), seed, monotonic_ns()), operator, robot, control)


if __name__ == "__main__":
    main()
