"""The 7-byte frame: the paper's example, every angle there and back, and any rubbish between frames."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slave.attitude.frame import (
    LENGTH,
    FrameAngles,
    FrameParser,
    decode,
    encode,
    of_angles,
    radians,
)

PAPER = bytes.fromhex("FF 01 00 23 44 05 61")
turns = st.none() | st.integers(0, 3599)
frames = st.builds(FrameAngles, st.integers(0, 1800), turns, turns)
quick = settings(max_examples=100, derandomize=True, deadline=None)


def test_the_papers_frame() -> None:
    angles = FrameAngles(100, 2344, 561)
    assert encode(angles) == PAPER
    assert decode(PAPER) == angles
    degrees = [math.degrees(radians(x or 0)) for x in (angles.inclination, angles.azimuth, angles.tool_face)]
    assert degrees == pytest.approx([10.0, 234.4, 56.1])


@quick
@given(frames)
def test_there_and_back(angles: FrameAngles) -> None:
    frame = encode(angles)
    assert len(frame) == LENGTH
    assert frame.count(b"\xff") == 1
    assert decode(frame) == angles


@quick
@given(st.floats(0.0, math.pi), st.none() | st.floats(0.0, math.tau), st.none() | st.floats(0.0, math.tau))
def test_rounding_costs_half_a_tenth(
    inclination: float, azimuth: float | None, tool_face: float | None
) -> None:
    sent = decode(encode(of_angles(inclination, azimuth, tool_face)))
    assert sent is not None
    half = math.radians(0.05) + 1e-12
    assert abs(radians(sent.inclination) - inclination) <= half
    for was, now in ((azimuth, sent.azimuth), (tool_face, sent.tool_face)):
        assert (was is None) == (now is None)
        if was is not None and now is not None:
            assert abs((radians(now) - was + math.pi) % math.tau - math.pi) <= half


def test_a_turn_that_rounds_up_is_none() -> None:
    nearly = math.radians(359.96)
    assert of_angles(0.0, nearly, nearly) == FrameAngles(0, 0, 0)


@pytest.mark.parametrize(
    "frame",
    [
        "FF 18 01 00 00 00 00",  # an inclination of 180.1°
        "FF 01 00 36 01 00 00",  # an azimuth of 360.1°
        "FF 01 00 00 00 36 01",
        "FF 0A 00 00 00 00 00",  # no digit
        "FF 00 0F 00 00 00 00",
        "FF EE EE 00 00 00 00",  # an inclination is always known
        "FF 00 00 EE 00 00 00",
        "FF 00 00 00 00 EE E0",
        "FE 01 00 23 44 05 61",
        "FF 01 00 23 44 05",
        "FF 01 00 23 44 05 61 00",
        "",
    ],
)
def test_what_is_no_frame(frame: str) -> None:
    assert decode(bytes.fromhex(frame)) is None


@pytest.mark.parametrize("angles", [(1801, 0, 0), (-1, 0, 0), (0, 3600, 0), (0, 0, 3600), (0, -1, 0)])
def test_what_no_frame_can_say_is_not_sent(angles: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="tenths"):
        encode(FrameAngles(*angles))


@quick
@given(st.lists(st.binary(max_size=40), max_size=20))
def test_any_bytes_in_any_pieces_are_counted_and_never_raise(pieces: list[bytes]) -> None:
    parser, whole = FrameParser(), FrameParser()
    found = [angles for piece in pieces for angles in parser.feed(piece)]
    assert found == whole.feed(b"".join(pieces))
    assert (parser.frames, parser.refused, parser.garbage) == (whole.frames, whole.refused, whole.garbage)
    assert parser.frames == len(found)
    # a byte is in a frame, outside of all, or in one that was refused or is still open
    total = sum(map(len, pieces))
    assert LENGTH * parser.frames + parser.garbage + parser.refused <= total
    assert total <= LENGTH * (parser.frames + parser.refused + 1) + parser.garbage


@quick
@given(
    st.lists(
        st.tuples(st.binary(max_size=12).map(lambda b: b.replace(b"\xff", b"\x00")), frames), max_size=12
    )
)
def test_every_frame_after_rubbish_is_found(stream: list[tuple[bytes, FrameAngles]]) -> None:
    parser = FrameParser()
    found = parser.feed(b"".join(rubbish + encode(angles) for rubbish, angles in stream))
    assert found == [angles for _, angles in stream]
    assert parser.garbage == sum(len(rubbish) for rubbish, _ in stream)
    assert parser.refused == 0


@quick
@given(frames, st.integers(1, LENGTH - 1), frames)
def test_a_frame_that_is_cut_short_costs_only_itself(cut: FrameAngles, at: int, next_: FrameAngles) -> None:
    parser = FrameParser()
    assert parser.feed(encode(cut)[:at] + encode(next_)) == [next_]
    assert (parser.frames, parser.refused, parser.garbage) == (1, 1, 0)


@quick
@given(st.binary(max_size=60), frames)
def test_two_frames_after_anything_give_at_least_one(rubbish: bytes, angles: FrameAngles) -> None:
    # what ends like the start of a frame may swallow nothing: the next header begins anew
    parser = FrameParser()
    parser.feed(rubbish)
    assert parser.feed(encode(angles)) == [angles]
