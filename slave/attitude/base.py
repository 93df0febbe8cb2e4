"""What the instrument's angles say of the base that carries it: its tilt, and what is published."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from common.quaternion import Array, cross
from common.wire.messages import BaseAttitude
from slave.attitude.angles import up_in_instrument, wrapped
from slave.attitude.attitude import near_vertical

Axis = Literal["ahead", "up"]
"""Where the instrument's axis points on the base (REP-103): ahead, x right and y down, as an optical frame
has them; or up, x right and y ahead."""
_BASE_UP: dict[Axis, Array] = {"ahead": np.array([0.0, -1.0, 0.0]), "up": np.array([0.0, 0.0, 1.0])}
"""The base's z in the instrument's coordinates."""


def tilt_rad(up: Array, axis: Axis) -> float:
    """Between the base's z and up (3,), of any length, in the instrument's coordinates: 0 to π."""
    base_up = _BASE_UP[axis]
    return float(np.arctan2(np.linalg.norm(cross(base_up, up)), base_up @ up))


def base_attitude(
    measured_ns: int,
    inclination_rad: float,
    azimuth_rad: float | None,
    tool_face_rad: float | None,
    axis: Axis,
    up: Array | None = None,
) -> BaseAttitude | None:
    """What is published of three angles, the azimuth true; None where they do not tell the base's tilt.

    `up` (3,), in the instrument's coordinates, tells the tilt better where it is known.
    """
    vertical = near_vertical(inclination_rad)
    if up is not None:
        tilt = tilt_rad(up, axis)
    elif axis == "up" or not vertical:
        if tool_face_rad is None and axis != "up":
            return None
        turn = np.asarray(tool_face_rad or 0.0)
        tilt = tilt_rad(up_in_instrument(np.asarray(inclination_rad), turn), axis)
    else:
        # an axis ahead that points up or down: the base stands on end, however it is turned
        tilt = 0.5 * math.pi
    return BaseAttitude(
        measured_ns,
        inclination_rad,
        None if vertical or azimuth_rad is None else azimuth_rad,
        tool_face_rad,
        tilt,
    )


def less(angle_rad: float | None, zero_rad: float) -> float | None:
    """An angle counted from another zero, 0 to 2π; None stays None."""
    return None if angle_rad is None else float(wrapped(np.asarray(angle_rad - zero_rad)))
