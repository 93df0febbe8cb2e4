"""Frames of python-can's udp_multicast, read from its socket without python-can.

python-can takes 12 µs a frame: select, recvmsg with a time stamp, a checked Message. Here a plain data
frame takes a quarter of that. A sender's datagrams of one length differ in three places only: time stamp,
identifier and data. So the first is unpacked, and of those that follow all other bytes are compared with it.
Whatever else a datagram holds is left to python-can, which knows what it is.
"""

from __future__ import annotations

from contextlib import suppress

import can
import msgpack
from can.interfaces.udp_multicast import UdpMulticastBus
from can.interfaces.udp_multicast.utils import unpack_message

from common.can.reader import OnError, OnMessage
from common.can.socket_reader import OnFrames
from common.clock import monotonic_ns

_FIELDS = 11
"""That python-can packs of a Message."""
_STANDARD_IDS = 0x800
_HEAD = b"\x8b\xa9timestamp\xcb"
"""Of a map of 11, the first of them a float of 8 bytes."""
_STAMP_BYTES = 8
_BEFORE_ID = b"\xaearbitration_id\xcd"
"""An unsigned number of two bytes; one below 256 is packed in fewer."""
_BEFORE_DATA = b"\xa4data\xc4"
"""Bytes; their count follows in one byte."""

_MOST_LENGTHS = 200
"""A stranger on the bus must not fill the memory."""


def sends_datagrams(bus: can.BusABC) -> bool:
    """Whether a bus can be read so."""
    return isinstance(bus, UdpMulticastBus)


def data_frame(datagram: bytes) -> tuple[int, bytes, bool] | None:
    """Identifier, data and whether it is CAN FD, of a sound data frame of 11 bits; None for all else."""
    try:
        fields = msgpack.unpackb(datagram)
        frame_id, data, fd = fields["arbitration_id"], fields["data"], fields["is_fd"]
        if (
            type(frame_id) is int
            and 0 <= frame_id < _STANDARD_IDS
            and type(data) is bytes
            and fields["dlc"] == len(data) <= (64 if fd else 8)
            and fields["is_extended_id"] is fields["is_remote_frame"] is fields["is_error_frame"] is False
            and (fd is True or fd is fields["bitrate_switch"] is fields["error_state_indicator"] is False)
            and len(fields) == _FIELDS
        ):
            return frame_id, data, fd
    except Exception:  # msgpack raises its own family; python-can says what is wrong
        pass
    return None


class Likeness:
    """Frames that are like one that was unpacked, but for time stamp, identifier and data."""

    def __init__(self, sound: bytes, data: bytes, fd: bool) -> None:
        """`sound`: a datagram in which `data_frame` found this. Raises ValueError: otherwise laid out."""
        self._id_at = sound.index(_BEFORE_ID) + len(_BEFORE_ID)
        self._data_at = sound.index(_BEFORE_DATA, self._id_at) + len(_BEFORE_DATA) + 1
        self._after = self._data_at + len(data)
        self._fd = fd
        self._parts = self._split(sound)
        if not sound.startswith(_HEAD) or sound[self._data_at : self._after] != data:
            raise ValueError("not packed in the order that python-can has")

    def _split(self, datagram: bytes) -> tuple[bytes, bytes, bytes, bytes]:
        id_at = self._id_at
        return (
            datagram[: len(_HEAD)],
            datagram[len(_HEAD) + _STAMP_BYTES : id_at],
            datagram[id_at + 2 : self._data_at],
            datagram[self._after :],
        )

    def frame(self, datagram: bytes) -> tuple[int, bytes, bool] | None:
        """Identifier, data and whether it is CAN FD; None: it differs elsewhere too."""
        id_at = self._id_at
        frame_id = datagram[id_at] << 8 | datagram[id_at + 1]
        if frame_id >= _STANDARD_IDS or self._split(datagram) != self._parts:
            return None
        return frame_id, datagram[self._data_at : self._after], self._fd


class DatagramFrames:
    """Takes datagrams of one bus."""

    def __init__(self, fd: bool, on_frames: OnFrames, on_message: OnMessage, on_error: OnError) -> None:
        """`fd`: False drops frames of CAN FD, as python-can does."""
        self._fd = fd
        self._on_frames, self._on_message, self._on_failure = on_frames, on_message, on_error
        self._alike: dict[int, Likeness] = {}
        """By length of the datagram."""

    def take(self, datagram: bytes) -> None:
        """One datagram, whatever it holds."""
        alike = self._alike.get(len(datagram))
        frame = (alike and alike.frame(datagram)) or self._unpacked(datagram)
        if frame is None:
            self._take_other(datagram)
        elif self._fd or not frame[2]:
            self._on_frames([(frame[0], frame[1], monotonic_ns())])

    def _unpacked(self, datagram: bytes) -> tuple[int, bytes, bool] | None:
        frame = data_frame(datagram)
        if frame is not None and len(self._alike) < _MOST_LENGTHS:
            with suppress(ValueError):
                self._alike[len(datagram)] = Likeness(datagram, *frame[1:])
        return frame

    def _take_other(self, datagram: bytes) -> None:
        try:
            message = unpack_message(datagram, replace={"timestamp": 0.0}, check=True)
        except Exception as cause:  # whatever it raises, the datagram is no frame
            error = can.CanOperationError("could not unpack received message")
            error.__cause__ = cause
            self._on_failure(error)
            return
        if self._fd or not message.is_fd:
            self._on_message(message)
