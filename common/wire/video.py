"""One picture of a robot's camera as it travels: a fixed header, then a JPEG or H.264. Pure.

Not msgpack as the other messages: the slave's thread that sends it must hold the interpreter briefly.
Version 1 is a JPEG. Version 2 is H.264 (Annex B, no B-frames); its header also names the picture that this
one builds on, so that whoever missed that one knows that it cannot show this one.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from common.errors import CodecError

MAX_PICTURE = 1 << 20
"""Bytes; a larger picture is neither sent nor accepted."""
JPEG, H264 = "jpeg", "h264"
_HEADER = struct.Struct("<4sB3xQQQHHI")
_AFTER = struct.Struct("<Q")
_MAGIC, _VERSION_JPEG, _VERSION_H264 = b"TVID", 1, 2
_BEGIN, _END = b"\xff\xd8", b"\xff\xd9"
_START_CODES = (b"\0\0\0\1", b"\0\0\1")
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
    body: bytes
    codec: str = JPEG
    """`JPEG` or `H264`."""
    after: int = 0
    """Number of the picture without which this one cannot be decoded; 0: it stands alone."""


def encode_frame(frame: VideoFrame) -> bytes:
    """The frame's bytes. CodecError where it is none that `decode_frame` would take."""
    h264 = frame.codec == H264
    try:
        header = _HEADER.pack(
            _MAGIC, _VERSION_H264 if h264 else _VERSION_JPEG, frame.number, frame.captured_ns, frame.sent_ns,
            frame.width, frame.height, len(frame.body),
        )  # fmt: skip
        after = _AFTER.pack(frame.after) if h264 else b""
    except struct.error as error:
        raise CodecError(f"the frame cannot be encoded: {error}") from None
    _check(frame)
    return header + after + frame.body


def decode_frame(payload: bytes) -> VideoFrame:
    """The frame. CodecError says what is wrong with it; of the picture only its ends are checked."""
    if len(payload) < _HEADER.size:
        raise CodecError(f"{len(payload)} bytes, expected at least a header of {_HEADER.size}")
    magic, version, number, captured_ns, sent_ns, width, height, length = _HEADER.unpack_from(payload)
    if magic != _MAGIC:
        raise CodecError("not a video frame")
    begin, codec, after = _HEADER.size, JPEG, 0
    if version == _VERSION_H264:
        if len(payload) < begin + _AFTER.size:
            raise CodecError(f"{len(payload)} bytes, expected at least a header of {begin + _AFTER.size}")
        codec, (after,) = H264, _AFTER.unpack_from(payload, begin)
        begin += _AFTER.size
    elif version != _VERSION_JPEG:
        raise CodecError(f"video version {version}, expected {_VERSION_JPEG} or {_VERSION_H264}")
    body = payload[begin:]
    if len(body) != length:
        raise CodecError(f"{len(body)} bytes of picture, the header says {length}")
    frame = VideoFrame(number, captured_ns, sent_ns, width, height, body, codec, after)
    _check(frame)
    return frame


class FrameChain:
    """Which pictures of one camera can be shown: a picture of H.264 only where the one before it was."""

    def __init__(self) -> None:
        self._last = 0
        self.broken = 0
        """Pictures that could not be shown because one before them is missing."""
        self.wants_key = False
        """Whether only a picture that stands alone helps."""

    def take(self, frame: VideoFrame) -> bool:
        """Whether this picture can be shown."""
        if frame.after not in (0, self._last):
            self.broken += 1
            self.wants_key = True
            return False
        self._last, self.wants_key = frame.number, False
        return True

    def lose(self) -> None:
        """The newest picture could not be decoded after all: those that build on it cannot be either."""
        self._last, self.wants_key = 0, True


def _check(frame: VideoFrame) -> None:
    if not 0 < frame.number <= _U63 or frame.captured_ns > _U63 or frame.sent_ns > _U63:
        raise CodecError("a number or a stamp is not a 63-bit count")
    if frame.after and frame.codec == JPEG:
        raise CodecError("a JPEG builds on no other picture")
    if frame.after >= frame.number:
        raise CodecError(f"picture {frame.number} cannot build on picture {frame.after}, which is not older")
    if not (frame.width and frame.height):
        raise CodecError(f"a picture of {frame.width}×{frame.height}")
    if len(frame.body) > MAX_PICTURE:
        raise CodecError(f"{len(frame.body)} bytes of picture, expected at most {MAX_PICTURE}")
    if frame.codec == H264:
        if not frame.body.startswith(_START_CODES):
            raise CodecError("not H.264 with start codes (Annex B)")
    elif not (frame.body.startswith(_BEGIN) and frame.body.endswith(_END)):
        raise CodecError("not a whole JPEG")
