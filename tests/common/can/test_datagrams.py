"""What is read without python-can is what python-can would have read."""

from __future__ import annotations

import asyncio
import socket

import can
import msgpack
import pytest
from can.interfaces.udp_multicast.utils import pack_message, unpack_message
from hypothesis import given
from hypothesis import strategies as st

from common.can.datagrams import DatagramFrames, Likeness, data_frame
from common.can.socket_reader import SocketReader

NODE = can.Message(
    arbitration_id=0x6A5, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(24)
)
ODD = st.one_of(
    st.none(), st.booleans(), st.integers(-1, 0x900), st.floats(), st.binary(max_size=70), st.text(max_size=3)
)
FIELDS = sorted(msgpack.unpackb(pack_message(NODE)))


@given(
    st.integers(0, 0x7FF),
    st.binary(max_size=64),
    st.dictionaries(st.sampled_from([*FIELDS, "more"]), ODD),
    st.booleans(),
)
def test_a_frame_is_taken_only_where_python_can_reads_the_same(
    frame_id: int, data: bytes, odd: dict[str, object], fd: bool
) -> None:
    plain = {"arbitration_id": frame_id, "data": data, "dlc": len(data), "is_fd": fd, "bitrate_switch": False}
    fields = msgpack.unpackb(pack_message(NODE)) | plain | odd
    datagram: bytes = msgpack.packb(fields)
    taken = data_frame(datagram)
    if taken is not None:
        message = unpack_message(datagram, replace={"timestamp": 0.0}, check=True)
        assert taken == (message.arbitration_id, message.data, message.is_fd)
        assert not any((message.is_extended_id, message.is_remote_frame, message.is_error_frame))
    elif not odd:
        with pytest.raises(ValueError, match=r"data|dlc|DLC"):
            unpack_message(datagram, replace={"timestamp": 0.0}, check=True)


@given(
    st.integers(0x100, 0x7FF),
    st.integers(0, 0x7FF),
    st.binary(max_size=64),
    st.floats(allow_nan=False),
    st.lists(st.tuples(st.integers(0, 250), st.integers(1, 255)), max_size=2),
)
def test_a_frame_like_one_before_is_read_as_it_would_be_unpacked(
    before: int, frame_id: int, data: bytes, stamp: float, flipped: list[tuple[int, int]]
) -> None:
    def packed(number: int, at: float, content: bytes) -> bytes:
        message = can.Message(
            timestamp=at, arbitration_id=number, is_extended_id=False, is_fd=True, data=content
        )
        return pack_message(message)

    like = Likeness(packed(before, 0.0, bytes(len(data))), bytes(len(data)), True)
    datagram = packed(frame_id, stamp, data)
    if not flipped and frame_id >= 0x100:
        assert like.frame(datagram) == (frame_id, data, True)
    changed = bytearray(datagram)
    for place, bits in flipped:
        changed[place % len(changed)] ^= bits
    taken = like.frame(bytes(changed).ljust(len(packed(before, 0.0, data)), b"\0"))
    if taken is not None:
        assert taken == data_frame(bytes(changed))


def test_an_identifier_of_more_than_11_bits_is_like_nothing() -> None:
    sound = pack_message(NODE)
    like = Likeness(sound, bytes(NODE.data), True)
    assert like.frame(sound) == (0x6A5, bytes(NODE.data), True)
    assert like.frame(sound.replace(b"\xcd\x06\xa5", b"\xcd\x08\x00")) is None


def test_what_is_laid_out_otherwise_is_like_nothing() -> None:
    fields = msgpack.unpackb(pack_message(NODE))
    turned = msgpack.packb(dict(reversed(fields.items())))
    assert data_frame(turned) == (NODE.arbitration_id, NODE.data, True)
    with pytest.raises(ValueError, match=r"not found|order"):
        Likeness(turned, bytes(NODE.data), True)


@given(st.binary(max_size=40))
def test_any_bytes_are_no_frame_or_one(datagram: bytes) -> None:
    assert data_frame(datagram) is None


def test_a_bus_of_classic_can_hears_no_fd_frame_and_one_that_is_stopped_nothing() -> None:
    async def test() -> None:
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        heard: list[tuple[int, bytes, int]] = []
        others: list[can.Message] = []
        with near, far:
            loop = asyncio.get_running_loop()
            frames = DatagramFrames(False, heard.extend, others.append, lambda _: True)
            reader = SocketReader(near.fileno(), loop, frames.take, lambda _: True)
            classic = can.Message(arbitration_id=0x105, is_extended_id=False, data=b"12")
            extended = can.Message(arbitration_id=0x105, is_extended_id=True, data=b"12")
            for message in (NODE, classic, extended, classic):
                far.send(pack_message(message))
            reader.read()
            assert [(frame_id, data) for frame_id, data, _ in heard] == [(0x105, b"12")] * 2
            assert [(message.is_extended_id, message.data) for message in others] == [(True, b"12")]
            far.send(pack_message(classic))
            reader.stop()
            reader.read()
            assert len(heard) == 2

    asyncio.run(test())
