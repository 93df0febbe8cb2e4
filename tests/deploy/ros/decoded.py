"""The messages as an independent implementation of CDR (pycdr2, of the makers of Cyclone DDS) reads them.

The structures are those of ROS's public interface definitions.
"""

# mypy: disable-error-code="type-arg"
from dataclasses import dataclass
from typing import Any

from pycdr2 import IdlStruct
from pycdr2.types import float64, int32, sequence, uint8, uint32


@dataclass
class Time(IdlStruct, typename="Time"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="Header"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="JointState"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class CompressedImage(IdlStruct, typename="CompressedImage"):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
class Vector3(IdlStruct, typename="Vector3"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="Quaternion"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class TransformOf(IdlStruct, typename="Transform"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="TransformStamped"):
    header: Header
    child_frame_id: str
    transform: TransformOf


@dataclass
class TFMessage(IdlStruct, typename="TFMessage"):
    transforms: sequence[TransformStamped]


@dataclass
class KeyValue(IdlStruct, typename="KeyValue"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="DiagnosticStatus"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="DiagnosticArray"):
    header: Header
    status: sequence[DiagnosticStatus]


def read(kind: type[IdlStruct], payload: bytes) -> Any:
    """The message; its fields are plain Python values, which pycdr2's types do not say."""
    return kind.deserialize(payload)


def nanoseconds(header: Header) -> int:
    """ns since 1970."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)
