"""The simulated bus's own protocol 2.0, against the manual's examples, the adapter's library, and garbage."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from dynamixel_sdk import PacketHandler
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.slave.servos.dynamixel.simulated.bus import SimulatedBus
from tests.slave.servos.dynamixel.simulated.packets import (
    PING,
    READ,
    STATUS,
    Packet,
    Parser,
    crc16,
    frame,
    stuff,
    unstuff,
)
from tests.slave.servos.dynamixel.simulated.servo import SimulatedServo

few = settings(max_examples=150, derandomize=True, deadline=None)
# bytes that make headers likely
hostile = st.lists(st.sampled_from([0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x55, 0x0B]), max_size=60).map(bytes)
bodies = st.one_of(st.binary(max_size=40), hostile)
packets = st.builds(Packet, st.integers(0, 0xFE), st.sampled_from([PING, READ, STATUS]), bodies)


def test_the_manuals_examples() -> None:
    assert frame(1, PING) == bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E")
    assert frame(1, STATUS, bytes.fromhex("00 06 04 26")) == bytes.fromhex(
        "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D"
    )
    assert frame(1, READ, bytes.fromhex("84 00 04 00")) == bytes.fromhex(
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"
    )


@few
@given(st.binary(max_size=60))
def test_the_checksum_is_the_librarys(data: bytes) -> None:
    assert crc16(data) == PacketHandler(2.0).updateCRC(0, data, len(data))


@few
@given(bodies)
def test_stuffing_hides_every_header_and_comes_off_again(body: bytes) -> None:
    assert b"\xff\xff\xfd\x00" not in stuff(body)
    assert unstuff(stuff(body)) == body


def cut(data: bytes, at: list[int]) -> list[bytes]:
    ends = sorted({min(i, len(data)) for i in at} | {0, len(data)})
    return [data[a:b] for a, b in pairwise(ends)]


@few
@given(st.lists(packets, max_size=5), st.lists(st.integers(0, 300), max_size=8))
def test_packets_come_through_however_the_stream_is_cut(sent: list[Packet], at: list[int]) -> None:
    stream = b"".join(frame(p.servo, p.instruction, p.parameters) for p in sent)
    parser = Parser()
    assert [p for part in cut(stream, at) for p in parser.feed(part)] == sent
    assert parser.dropped == 0


@few
@given(hostile, packets, st.lists(st.integers(0, 200), max_size=5))
def test_a_packet_after_garbage_is_found_once_the_line_was_quiet(
    garbage: bytes, packet: Packet, at: list[int]
) -> None:
    parser = Parser()
    for part in cut(garbage, at):
        parser.feed(part)
    parser.quiet()
    assert parser.feed(frame(packet.servo, packet.instruction, packet.parameters)) == [packet]


@few
@given(packets, st.data())
def test_a_packet_with_a_wrong_bit_or_missing_end_is_never_taken(packet: Packet, data: st.DataObject) -> None:
    whole = frame(packet.servo, packet.instruction, packet.parameters)
    broken = bytearray(whole)
    bit = data.draw(st.integers(0, 8 * len(whole) - 1))
    broken[bit // 8] ^= 1 << bit % 8
    assert Parser().feed(bytes(broken)) == []
    assert Parser().feed(whole[: data.draw(st.integers(0, len(whole) - 1))]) == []


@few
@given(bodies, st.integers(0, 255), bodies)
def test_no_instruction_however_malformed_breaks_the_bus(
    before: bytes, instruction: int, body: bytes
) -> None:
    bus = SimulatedBus([SimulatedServo(1), SimulatedServo(2)])
    bus.feed(before, 0)
    bus.parser.quiet()
    for servo in (1, 7, 0xFE):
        answer = bus.feed(frame(servo, instruction, body), 1)
        # whatever it answers is itself whole
        parser = Parser()
        assert all(p.instruction == STATUS for p in parser.feed(answer))
        assert parser.dropped == 0


class Line:
    """What the library reads from; its time is up as soon as there is nothing more."""

    is_using = False

    def __init__(self, data: bytes) -> None:
        self.data = data

    def readPort(self, length: int) -> bytes:  # noqa: N802
        length = max(length, 0)
        out, self.data = self.data[:length], self.data[length:]
        return out

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return not self.data


@few
@given(st.integers(0, 252), bodies)
def test_the_library_reads_what_the_simulated_servos_answer(servo: int, body: bytes) -> None:
    line: Any = Line(frame(servo, STATUS, b"\x00" + body))
    packet, result = PacketHandler(2.0).rxPacket(line, False)
    assert result == 0
    assert packet[4] == servo
    assert bytes(packet[9 : 9 + len(body)]) == body
