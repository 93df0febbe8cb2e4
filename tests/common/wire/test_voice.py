from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.voice import MAX_OPUS, VoicePacket, decode_voice, encode_voice

TALK = VoicePacket(7, 3, muted=False, body=b"opus")


@given(st.integers(1, 2**64 - 1), st.integers(0, 2**32 - 1), st.binary(max_size=MAX_OPUS))
def test_a_packet_comes_back_as_it_went(stream: int, sequence: int, body: bytes) -> None:
    packet = VoicePacket(stream, sequence, muted=False, body=body)
    assert decode_voice(encode_voice(packet)) == packet
    muted = VoicePacket(stream, sequence, muted=True)
    assert decode_voice(encode_voice(muted)) == muted


@given(st.binary(max_size=100))
def test_garbage_is_refused_and_nothing_else_is_raised(payload: bytes) -> None:
    with pytest.raises(CodecError):
        decode_voice(payload)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (replace(TALK, stream=0), "out of range"),
        (replace(TALK, body=bytes(MAX_OPUS + 1)), "at most"),
        (replace(TALK, muted=True), "says something"),
    ],
)
def test_what_is_no_packet_is_not_sent(wrong: VoicePacket, said: str) -> None:
    with pytest.raises(CodecError, match=said):
        encode_voice(wrong)


def test_a_packet_cut_short_is_refused() -> None:
    with pytest.raises(CodecError, match="3 bytes of Opus, the header says 4"):
        decode_voice(encode_voice(TALK)[:-1])
