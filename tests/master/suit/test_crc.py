from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from master.suit.crc import BatchCrc, crc8, frame_crc


def bitwise(message: bytes) -> int:
    """CRC-8 SAE J1850 straight from its definition, a bit at a time."""
    register = 0xFF
    for byte in message:
        for bit in range(7, -1, -1):
            carry = (register >> 7) ^ (byte >> bit & 1)
            register = (register << 1 & 0xFF) ^ (0x1D if carry else 0)
    return register ^ 0xFF


def test_it_gives_the_published_check_value() -> None:
    assert crc8(b"123456789") == bitwise(b"123456789") == 0x4B


@given(st.binary(max_size=64))
def test_it_is_the_bitwise_definition(message: bytes) -> None:
    assert crc8(message) == bitwise(message)


@given(
    length=st.sampled_from([8, 24]),
    frame_id=st.integers(0, 0x7FF),
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 40),
)
def test_a_batch_is_judged_as_its_frames_one_by_one(
    length: int, frame_id: int, seed: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    frames = rng.integers(0, 256, (count, length), dtype=np.uint8)
    frames[::2, -1] = [frame_crc(frame_id, row[:-1].tobytes()) for row in frames[::2]]
    batch = BatchCrc(length)
    sound = batch.folded(frames) == batch.blank(frame_id)
    id_bytes = frame_id.to_bytes(2, "little")
    assert sound.tolist() == [bitwise(id_bytes + row[:-1].tobytes()) == row[-1] for row in frames]
    assert sound[::2].all()


@pytest.mark.parametrize("length", [8, 24])
def test_every_single_flipped_bit_is_found(length: int) -> None:
    covered = bytes(range(1, length))
    sound = covered + bytes([frame_crc(0x105, covered)])
    flipped = np.frombuffer(sound, dtype=np.uint8) ^ np.packbits(
        np.eye(8 * length, dtype=np.uint8), axis=1, bitorder="little"
    )
    batch = BatchCrc(length)
    assert not (batch.folded(flipped) == batch.blank(0x105)).any()


def test_a_frame_under_another_identifier_fails() -> None:
    batch = BatchCrc(8)
    blanks = [batch.blank(frame_id) for frame_id in range(0x200, 0x280)]
    assert len(set(blanks)) == len(blanks)
