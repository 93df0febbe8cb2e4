from __future__ import annotations

import socket

import can
import pytest

from common.can.config import BusConfig
from common.can.frame import CanFrame
from common.can.interface import open_bus
from common.can.without_echo import open_without_function_code, open_without_longer_than


def group(channel: str, port: int) -> BusConfig:
    options: dict[str, str | int | float | bool] = {"port": port, "hop_limit": 0}
    return BusConfig(name="drives", interface="udp_multicast", channel=channel, fd=False, options=options)


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        number: int = free.getsockname()[1]
        return number


def heard(bus: can.BusABC) -> list[int]:
    """Identifiers of all that has come; loopback delivers before `send` returns."""
    ids = []
    while (message := bus.recv(0)) is not None:
        ids.append(message.arbitration_id)
    return ids


@pytest.mark.parametrize("code", [0x180, 0x200])
def test_one_function_code_is_not_heard_and_all_others_are(port: int, code: int) -> None:
    config = group("239.74.163.41", port)
    bus, other = open_without_function_code(config, code), open_bus(config)
    try:
        ids = [
            0x000,
            0x05,
            0x7F,
            0x80,
            0xFF,
            *range(0x100, 0x800, 0x13),
            0x17F,
            0x180,
            0x1FF,
            0x200,
            0x27F,
            0x280,
        ]
        for frame_id in ids:
            for data in (b"", b"\xcd\x02\x01\x01\x81\x02\x02\x02"):
                bus.send(can.Message(arbitration_id=frame_id, is_extended_id=False, data=data))
        assert heard(bus) == [i for i in ids if not code <= i < code + 0x80 for _ in range(2)]
        assert heard(other) == [i for i in ids for _ in range(2)]
    finally:
        bus.shutdown()
        other.shutdown()


def test_frames_longer_than_the_longest_are_not_heard(port: int) -> None:
    config, sync = group("239.74.163.41", port), CanFrame(0x080, bytes(4), fd=False)
    bus, other = open_without_longer_than(config, sync), open_bus(config)
    try:
        for frame_id, length in ((0x080, 4), (0x105, 5), (0x106, 8), (0x081, 0)):
            bus.send(can.Message(arbitration_id=frame_id, is_extended_id=False, data=bytes(length)))
        assert heard(bus) == [0x080, 0x081]
        assert heard(other) == [0x080, 0x105, 0x106, 0x081]
    finally:
        bus.shutdown()
        other.shutdown()


def test_two_groups_at_one_port_do_not_hear_each_other(port: int) -> None:
    left, right = (open_bus(group(f"239.74.163.{n}", port)) for n in (42, 43))
    try:
        left.send(can.Message(arbitration_id=0x181, is_extended_id=False))
        right.send(can.Message(arbitration_id=0x182, is_extended_id=False))
        assert heard(left) == [0x181]
        assert heard(right) == [0x182]
    finally:
        left.shutdown()
        right.shutdown()


def test_other_interfaces_are_left_alone() -> None:
    config = BusConfig(name="drives", interface="virtual", channel="echo", fd=False)
    bus, other = open_without_function_code(config, 0x200), open_bus(config)
    try:
        other.send(can.Message(arbitration_id=0x201, is_extended_id=False))
        assert heard(bus) == [0x201]
    finally:
        bus.shutdown()
        other.shutdown()
