"""One picture of a robot's camera as it travels: a fixed header, then the JPEG. Pure.

Not msgpack as the other messages: the slave's thread that sends it must hold the interpreter briefly.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from common.errors import CodecError

MAX_JPEG = 1 << 20
"""Bytes; a larger picture is neither sent nor accepted."""
_HEADER = struct.Struct("<4sB3xQQQHHI")
_MAGIC, _VERSION = b"TVID", 1
_BEGIN, _END = b"\xff\xd8", b"\xff\xd9"
_U63 = (1 << 63) - 1


@dataclass(frozen=True, slots=True)
class VideoFrame:
    """A picture, and when it was taken and sent. Times are ns of the slave's clock."""

    number: int
    """Grows from frame to frame, also when the slave has started anew; never 0."""
    captured_ns: int
    sent_ns: int
    width: int
    """Pixels, as is `height`."""
    height: int
    jpeg: bytes


def encode_frame(frame: VideoFrame) -> bytes:
    """The frame's bytes. CodecError where it is none that `decode_frame` would take."""
    try:
        header = _HEADER.pack(
            _MAGIC, _VERSION, frame.number, frame.captured_ns, frame.sent_ns,
            frame.width, frame.height, len(frame.jpeg),
        )  # fmt: skip
    except struct.error as error:
        raise CodecError(f"the frame cannot be encoded: {error}") from None
    _check(frame)
    return header + frame.jpeg


def decode_frame(payload: bytes) -> VideoFrame:
    """The frame. CodecError says what is wrong with it; of the JPEG only both ends are checked."""
    if len(payload) < _HEADER.size:
        raise CodecError(f"{len(payload)} bytes, expected at least a header of {_HEADER.size}")
    magic, version, number, captured_ns, sent_ns, width, height, length = _HEADER.unpack_from(payload)
    if magic != _MAGIC:
        raise CodecError("not a video frame")
    if version != _VERSION:
        raise CodecError(f"video version {version}, expected {_VERSION}")
    jpeg = payload[_HEADER.size :]
    if len(jpeg) != length:
        raise CodecError(f"{len(jpeg)} bytes of JPEG, the header says {length}")
    frame = VideoFrame(number, captured_ns, sent_ns, width, height, jpeg)
    _check(frame)
    return frame


def _check(frame: VideoFrame) -> None:
    if not 0 < frame.number <= _U63 or frame.captured_ns > _U63 or frame.sent_ns > _U63:
        raise CodecError("a number or a stamp is not a 63-bit count")
    if not (frame.width and frame.height):
        raise CodecError(f"a picture of {frame.width}×{frame.height}")
    if len(frame.jpeg) > MAX_JPEG:
        raise CodecError(f"{len(frame.jpeg)} bytes of JPEG, expected at most {MAX_JPEG}")
    if not (frame.jpeg.startswith(_BEGIN) and frame.jpeg.endswith(_END)):
        raise CodecError("not a whole JPEG")
