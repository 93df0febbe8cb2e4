"""What the slave and its camera's process say to each other over two pipes. Pure.

The slave asks for one picture at a time, with the newest joint angles; the process answers with it, or with
words. So nothing ever queues, and a picture is never older than its making.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from common.errors import CodecError
from common.quaternion import Array
from common.wire.video import MAX_PICTURE

REQUEST = struct.Struct("<QIIB")
REPLY = struct.Struct("<BQHHI")
MOST_JOINTS = 1024


class ReplyKind(IntEnum):
    """Kinds of reply."""

    READY = 1
    """Open, and waiting to be asked."""
    PICTURE = 2
    """A picture that stands alone."""
    TROUBLE = 3
    """The camera failed, with the reason as text; another try may succeed."""
    NEVER = 4
    """This machine cannot open a camera, with the reason as text; another try cannot succeed."""
    NEXT_PICTURE = 5
    """A picture of H.264 that builds on the one before it."""


@dataclass(frozen=True, slots=True)
class PictureRequest:
    """A request for one picture."""

    read_ns: int
    """When the angles were read."""
    most_bytes: int
    position_rad: Array
    """(J,)"""
    alone: bool = False
    """Whether the picture must stand alone; a JPEG always does."""


@dataclass(frozen=True, slots=True)
class PictureReply:
    """A picture, or a text."""

    answer: ReplyKind
    captured_ns: int = 0
    width: int = 0
    height: int = 0
    body: bytes = b""
    """JPEG or H.264, or UTF-8."""

    @property
    def words(self) -> str:
        """The text of a reply that is not a picture."""
        return self.body.decode("utf-8", "replace")


def pack_request(request: PictureRequest) -> bytes:
    """The request's bytes."""
    angles = np.ascontiguousarray(request.position_rad, "<f8").tobytes()
    return (
        REQUEST.pack(request.read_ns, request.most_bytes, len(request.position_rad), request.alone) + angles
    )


def pack_reply(reply: PictureReply) -> bytes:
    """The reply's bytes."""
    head = (reply.answer, reply.captured_ns, reply.width, reply.height, len(reply.body))
    return REPLY.pack(*head) + reply.body


def request_of(head: bytes) -> tuple[int, int, int, bool]:
    """`read_ns`, `most_bytes`, how many bytes of angles follow, and `alone`. Raises CodecError."""
    read_ns, most_bytes, joints, alone = REQUEST.unpack(head)
    if joints > MOST_JOINTS:
        raise CodecError(f"{joints} joints")
    return read_ns, most_bytes, 8 * joints, bool(alone)


def reply_of(head: bytes) -> tuple[PictureReply, int]:
    """A reply without its body, and how many bytes of it follow. Raises CodecError."""
    answer, captured_ns, width, height, length = REPLY.unpack(head)
    if length > MAX_PICTURE:
        raise CodecError(f"{length} bytes from the camera's process")
    try:
        return PictureReply(ReplyKind(answer), captured_ns, width, height), length
    except ValueError:
        raise CodecError(f"an answer of kind {answer} from the camera's process") from None
