"""Messages in Foxglove's protobuf schemas, and two of tandem's own (extra `viewer`).

A channel's schema is the set of file descriptors of its message, as MCAP's registry asks for protobuf.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from common.clock import NS_PER_S
from common.quaternion import Array
from common.wire.video import H264, VideoFrame
from deploy.viewer.frames import FrameEdge

if TYPE_CHECKING:
    from google.protobuf.message import Message
    from google.protobuf.timestamp_pb2 import Timestamp

GUARD_FIELDS = {"state": "string", "reason": "string", "operator": "string", "moving": "bool"}
LATENCY_FIELDS = {"one_way_ms": "double", "bound_ms": "double", "robot_ms": "double"}
"""Of a command, put to received; half-width of its bound; received to written by the robot itself."""


def stamp(at_ns: int) -> Timestamp:
    """Ns since 1970."""
    from google.protobuf.timestamp_pb2 import Timestamp

    return Timestamp(seconds=at_ns // NS_PER_S, nanos=at_ns % NS_PER_S)


def frame_transforms(placed: Sequence[tuple[FrameEdge, Array, Array]], root: str, at_ns: int) -> Message:
    """All frames of a robot. `root` is the frame above the world, which viewers need to draw anything."""
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

    message = FrameTransforms()
    at = stamp(at_ns)
    top = message.transforms.add(timestamp=at, parent_frame_id=root, child_frame_id="world")
    top.rotation.w = 1.0
    for edge, translation_m, q in placed:
        one = message.transforms.add(timestamp=at, parent_frame_id=edge.parent, child_frame_id=edge.child)
        one.translation.x, one.translation.y, one.translation.z = translation_m.tolist()
        one.rotation.w, one.rotation.x, one.rotation.y, one.rotation.z = q.tolist()
    return message


def joint_states(
    names: Sequence[str], position_rad: Array, at_ns: int, effort_nm: Array | None = None
) -> Message:
    """Joints (J,) rad and N m; a joint without a number is left out."""
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

    message = JointStates(timestamp=stamp(at_ns))
    efforts = [float("nan")] * len(names) if effort_nm is None else effort_nm.tolist()
    for name, position, effort in zip(names, position_rad.tolist(), efforts, strict=True):
        if np.isfinite(position):
            one = message.joints.add(name=name, position=position)
            if np.isfinite(effort):
                one.effort = effort
    return message


def picture(taken: VideoFrame, frame: str, at_ns: int) -> Message:
    """A JPEG; or H.264 as the schema asks: Annex B, no B-frames, parameters with each that stands alone."""
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

    make = CompressedVideo if taken.codec == H264 else CompressedImage
    message: Message = make(timestamp=stamp(at_ns), frame_id=frame, data=taken.body, format=taken.codec)
    return message


def camera_calibration(width: int, height: int, fovy_rad: float, frame: str, at_ns: int) -> Message:
    """A camera without distortion, whose picture is `fovy_rad` high."""
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration

    focal = 0.5 * height / float(np.tan(0.5 * fovy_rad))
    k = [focal, 0.0, 0.5 * width, 0.0, focal, 0.5 * height, 0.0, 0.0, 1.0]
    p = [focal, 0.0, 0.5 * width, 0.0, 0.0, focal, 0.5 * height, 0.0, 0.0, 0.0, 1.0, 0.0]
    return CameraCalibration(
        timestamp=stamp(at_ns), frame_id=frame, width=width, height=height,
        distortion_model="plumb_bob", D=[0.0] * 5, K=k, R=np.eye(3).ravel().tolist(), P=p,
    )  # fmt: skip


def log_line(level: str, text: str, name: str, at_ns: int) -> Message:
    """A line of the log; `level` as Foxglove names it: INFO, WARNING, ERROR."""
    from foxglove_schemas_protobuf.Log_pb2 import Log

    return Log(timestamp=stamp(at_ns), level=Log.Level.Value(level), message=text, name=name)


def own(kind: str, at_ns: int, values: Mapping[str, object]) -> Message:
    """One of tandem's own messages, `Guard` or `Latency`; fields that are None are left out."""
    known = {name: value for name, value in values.items() if value is not None}
    return _own_class(kind)(timestamp=stamp(at_ns), **known)


@cache
def _own_class(kind: str) -> type[Message]:
    """Made at run time: there is no compiler of protobuf to be installed."""
    from google.protobuf import descriptor_pb2, timestamp_pb2
    from google.protobuf.descriptor_pool import Default
    from google.protobuf.message_factory import GetMessageClass

    fields = {"Guard": GUARD_FIELDS, "Latency": LATENCY_FIELDS}[kind]
    types = descriptor_pb2.FieldDescriptorProto
    numbers = {"string": types.TYPE_STRING, "bool": types.TYPE_BOOL, "double": types.TYPE_DOUBLE}
    file = descriptor_pb2.FileDescriptorProto(
        name=f"tandem/{kind}.proto", package="tandem", syntax="proto3",
        dependency=[timestamp_pb2.DESCRIPTOR.name],
    )  # fmt: skip
    message = file.message_type.add(name=kind)
    message.field.add(
        name="timestamp", number=1, type=types.TYPE_MESSAGE, label=types.LABEL_OPTIONAL,
        type_name=".google.protobuf.Timestamp",
    )  # fmt: skip
    for number, (name, type_) in enumerate(fields.items(), start=2):
        message.field.add(name=name, number=number, type=numbers[type_], label=types.LABEL_OPTIONAL)
    pool = Default()
    pool.AddSerializedFile(file.SerializeToString())
    made: type[Message] = GetMessageClass(pool.FindMessageTypeByName(f"tandem.{kind}"))
    return made


def schema_of(message: Message) -> tuple[str, bytes]:
    """Name and data of a message's schema: its file descriptors, each after those that it needs."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    files = [message.DESCRIPTOR.file]
    for file in files:  # it grows: behind each file stand those that it needs
        files.extend(file.dependencies)
    out = FileDescriptorSet()
    seen: set[str] = set()
    for file in reversed(files):
        if file.name not in seen:
            seen.add(file.name)
            file.CopyToProto(out.file.add())
    return message.DESCRIPTOR.full_name, out.SerializeToString()
