"""What drives put on a bus, against ISO 11898-1's frame bit by bit; what is refused, with what to do."""

from __future__ import annotations

import pytest

from common.can.config import BusConfig
from common.skeleton import load_skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig
from slave.servos.canopen.load import BUSIEST, bits_per_s, frame_bits, too_much

NURSING = load_skeleton("nursing")


@pytest.mark.parametrize("size", range(9))
def test_a_frame_lies_between_no_stuff_bits_and_the_most(size: int) -> None:
    # start, 11 identifier, RTR, IDE, r0, 4 length, data, 15 CRC | delimiter, ACK 2, end 7, gap 3
    stuffed = 1 + 11 + 1 + 1 + 1 + 4 + 8 * size + 15
    bare = stuffed + 1 + 2 + 7 + 3
    assert bare < frame_bits(size) <= bare + (stuffed - 1) // 4


def one_bus(sync_hz: int, **options: str | int | float | bool) -> CanopenConfig:
    bus = BusConfig(name="all", interface="socketcan", channel="can0", fd=False, options=options)
    drives = {name: DriveConfig(id=i, bus="all") for i, name in enumerate(NURSING.joint_names, 1)}
    return CanopenConfig(buses=[bus], drives=drives, sync_hz=sync_hz, heartbeat_ms=20)


def test_25_drives_at_200_hz_are_more_than_1_mbit_s() -> None:
    count, bits = one_bus(200).load(NURSING)["all"]
    assert count == 25
    assert 1.16e6 < bits < 1.20e6
    (mistake,) = one_bus(200).mistakes_for(NURSING, EncoderConfig())
    assert mistake.key == "servos.canopen.sync_hz"
    for words in ("25 drives at 200 Hz are 1.19 Mbit/s on a bus of 1 Mbit/s", "at most 125", "more buses"):
        assert words in mistake.expected


def test_what_the_bus_carries_is_not_refused() -> None:
    assert one_bus(125).mistakes_for(NURSING, EncoderConfig()) == []
    assert CanopenConfig(sync_hz=200, heartbeat_ms=20).mistakes_for(NURSING, EncoderConfig()) == []


def test_a_slower_bus_carries_less() -> None:
    (mistake,) = one_bus(50, bitrate=250_000).mistakes_for(NURSING, EncoderConfig())
    assert "on a bus of 0.25 Mbit/s" in mistake.expected
    assert "at most 25" in mistake.expected
    assert "or up to 1 Mbit/s" in mistake.expected
    assert one_bus(25, bitrate=250_000).mistakes_for(NURSING, EncoderConfig()) == []


def test_the_boundary() -> None:
    bits = bits_per_s(10, 100, 40, 100)
    assert too_much(10, 100, bits, round(bits / BUSIEST) + 1) == ""
    assert too_much(10, 100, bits, round(bits / BUSIEST) - 1) != ""
