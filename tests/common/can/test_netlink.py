"""The kernel's message about a CAN interface."""

from __future__ import annotations

import struct

import pytest

from common.can.controller import Controller
from common.can.netlink import KernelReport, ask_kernel, read_report


def attribute(kind: int, data: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(data), kind) + data + bytes(-len(data) % 4)


def newlink(state: int, restart_ms: int = 0, kind: int = 16) -> bytes:
    """As the kernel builds it: name, then linkinfo with the kind and the controller's data."""
    bittiming = struct.pack("=8I", 1_000_000, 750, 50, 7, 7, 5, 1, 1)
    told = attribute(1, bittiming) + attribute(4, struct.pack("=I", state))
    told += attribute(6, struct.pack("=I", restart_ms))
    info = attribute(1, b"can\0") + attribute(2, told)
    body = struct.pack("=BxHiII", 0, 280, 3, 0, 0) + attribute(3, b"can0\0") + attribute(18, info)
    return struct.pack("=IHHII", 16 + len(body), kind, 0, 1, 0) + body


@pytest.mark.parametrize(("number", "state"), list(enumerate(Controller)))
def test_the_kernel_s_message_is_read(number: int, state: Controller) -> None:
    assert read_report(newlink(number, 100)) == KernelReport(state, 1_000_000, 100)


def test_messages_that_tell_nothing() -> None:
    assert read_report(newlink(0, kind=2)) is None
    assert read_report(newlink(9)) == KernelReport(None, 1_000_000, 0)
    whole = newlink(3)
    for end in range(len(whole)):
        read_report(whole[:end])  # never raises
    assert ask_kernel("lo") is None
    assert ask_kernel("no-such-can") is None
