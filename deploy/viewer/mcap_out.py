"""An MCAP file whose channels have schemas, so that viewers open it with no set-up."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from mcap.writer import Writer

from common.recording.recorder import create
from deploy.report.output import writing
from deploy.viewer.protobuf import schema_of

if TYPE_CHECKING:
    from google.protobuf.message import Message

STRING_SCHEMA = b"string data"
"""`std_msgs/msg/String` as MCAP's `ros2msg` wants it: the text of its definition."""


class ViewerFile:
    """Writes messages of named topics; a context manager. Raises TandemError where the disk refuses."""

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        self._path = path
        self._stream = create(path)
        self._writer = Writer(self._stream)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self.counts: dict[str, int] = {}
        with writing(path):
            self._writer.start(library="tandem")
            self._writer.add_metadata("derived", dict(metadata))

    def put(self, topic: str, message: Message, at_ns: int) -> None:
        """One protobuf message, at a time of day."""
        channel = self._channels.get(topic)
        if channel is None:
            name, data = schema_of(message)
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(name, "protobuf", data)
            channel = self._channels[topic] = self._writer.register_channel(
                topic, "protobuf", self._schemas[name]
            )
        self._add(topic, channel, at_ns, message.SerializeToString())

    def put_string(self, topic: str, text: str, at_ns: int) -> None:
        """A ROS 2 string, which is how viewers take a robot description."""
        channel = self._channels.get(topic)
        if channel is None:
            schema = self._writer.register_schema("std_msgs/msg/String", "ros2msg", STRING_SCHEMA)
            channel = self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        self._add(topic, channel, at_ns, cdr_string(text))

    def _add(self, topic: str, channel: int, at_ns: int, data: bytes) -> None:
        count = self.counts[topic] = self.counts.get(topic, 0) + 1
        with writing(self._path):
            self._writer.add_message(channel, at_ns, data, at_ns, count)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with writing(self._path):
            self._writer.finish()
            self._stream.close()


def cdr_string(text: str) -> bytes:
    """A `std_msgs/msg/String` in CDR, little endian: header, length with its closing zero, bytes."""
    data = text.encode() + b"\0"
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data)) + data
