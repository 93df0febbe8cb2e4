"""Messages of ROS 2 in CDR, with their type names and hashes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from common.clock import NS_PER_S
from common.quaternion import Array

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

JOINT_STATE = "sensor_msgs/msg/JointState"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
TF = "tf2_msgs/msg/TFMessage"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


@dataclass(frozen=True, slots=True)
class Transform:
    """Where a frame stands in another."""

    parent: str
    child: str
    translation_m: Array
    """(3,)."""
    q_parent_from_child: Array
    """(4,) wxyz."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One row of a diagnostic array."""

    level: int
    """0 OK, 1 WARN, 2 ERROR, 3 STALE."""
    name: str
    message: str
    hardware_id: str
    values: dict[str, str]


@cache
def types() -> Typestore:
    """Message definitions of ROS 2 Jazzy, which are those of Humble to Kilted for all messages here.

    Raises ModuleNotFoundError without the extra `ros`.
    """
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def type_hash(kind: str) -> str:
    """RIHS01 hash of a type, as the keys of rmw_zenoh carry it."""
    return str(types().hash_rihs01(kind))


def joint_state(
    names: Sequence[str], position_rad: Array, stamp_ns: int, effort_nm: Array | None = None
) -> bytes:
    """A JointState of joints (J,); those without a number are left out, their names too."""
    known = np.isfinite(position_rad)
    effort = np.zeros(0) if effort_nm is None else np.nan_to_num(effort_nm[known])
    message = _of(
        JOINT_STATE,
        header=_header(stamp_ns, ""),
        name=[name for name, there in zip(names, known.tolist(), strict=True) if there],
        position=np.ascontiguousarray(position_rad[known]),
        velocity=np.zeros(0),
        effort=np.ascontiguousarray(effort),
    )
    return _encoded(JOINT_STATE, message)


def compressed_image(jpeg: bytes, frame_id: str, stamp_ns: int) -> bytes:
    """A CompressedImage that holds this JPEG."""
    message = _of(
        COMPRESSED_IMAGE,
        header=_header(stamp_ns, frame_id),
        format="jpeg",
        data=np.frombuffer(jpeg, dtype=np.uint8),
    )
    return _encoded(COMPRESSED_IMAGE, message)


def tf_message(transforms: Sequence[Transform], stamp_ns: int) -> bytes:
    """A TFMessage of these transforms."""
    rows = []
    for one in transforms:
        x, y, z = one.translation_m.tolist()
        qw, qx, qy, qz = one.q_parent_from_child.tolist()
        transform = _of(
            "geometry_msgs/msg/Transform",
            translation=_of("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=_of("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )
        rows.append(
            _of(
                "geometry_msgs/msg/TransformStamped",
                header=_header(stamp_ns, one.parent),
                child_frame_id=one.child,
                transform=transform,
            )
        )
    return _encoded(TF, _of(TF, transforms=rows))


def diagnostics(rows: Sequence[Diagnostic], stamp_ns: int) -> bytes:
    """A DiagnosticArray of these rows."""
    statuses = [
        _of(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=row.level,
            name=row.name,
            message=row.message,
            hardware_id=row.hardware_id,
            values=[
                _of("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in row.values.items()
            ],
        )
        for row in rows
    ]
    return _encoded(DIAGNOSTICS, _of(DIAGNOSTICS, header=_header(stamp_ns, ""), status=statuses))


def _header(stamp_ns: int, frame_id: str) -> object:
    second, rest = divmod(stamp_ns, NS_PER_S)
    stamp = _of("builtin_interfaces/msg/Time", sec=second, nanosec=rest)
    return _of("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def _of(kind: str, **fields: object) -> object:
    make: Callable[..., object] = types().types[kind]
    return make(**fields)


def _encoded(kind: str, message: object) -> bytes:
    return bytes(types().serialize_cdr(message, kind))
