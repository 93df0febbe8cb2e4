"""How an instrument stands: its three angles, with what near the vertical has no meaning left out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from slave.attitude.angles import (
    azimuth_rad,
    gravity_tool_face_rad,
    inclination_rad,
    magnetic_tool_face_rad,
    true_azimuth_rad,
)

NEAR_VERTICAL_RAD = math.radians(5.0)
"""Nearer than this to the vertical, either way, an axis has no azimuth, and its tool-face is the field's.

An accelerometer's error shows in azimuth and gravity tool-face divided by the inclination's sine: 0.04° is
there 0.5°, the accuracy that is promised.
"""


@dataclass(frozen=True, slots=True)
class Attitude:
    """The angles of one moment, rad; `angles.py` has their definitions."""

    inclination_rad: float
    magnetic_azimuth_rad: float | None
    """None near the vertical, or where no field is measured."""
    azimuth_rad: float | None
    """From true north: the declination added."""
    gravity_tool_face_rad: float | None
    """None near the vertical."""
    magnetic_tool_face_rad: float | None
    """None where the axis lies along the field, or there is none."""

    @property
    def tool_face_rad(self) -> float | None:
        """From gravity; near the vertical from the field (paper D, Eqs. 21 and 22)."""
        if self.gravity_tool_face_rad is None:
            return self.magnetic_tool_face_rad
        return self.gravity_tool_face_rad


def near_vertical(inclination: float) -> bool:
    """Whether an axis at this inclination (rad) is too near the vertical to have an azimuth."""
    return min(inclination, math.pi - inclination) < NEAR_VERTICAL_RAD


def attitude(up: Array, field: Array, declination_rad: float = 0.0) -> Attitude | None:
    """The attitude from specific force and field (3,), instrument's frame; None if either is not finite.

    A field of zero is one that is not measured: the inclination does not need it.
    """
    inclination = _known(inclination_rad(up))
    if inclination is None:
        return None
    vertical = near_vertical(inclination)
    magnetic = None if vertical else _known(azimuth_rad(up, field))
    return Attitude(
        inclination_rad=inclination,
        magnetic_azimuth_rad=magnetic,
        azimuth_rad=None if magnetic is None else turned(magnetic, declination_rad),
        gravity_tool_face_rad=None if vertical else _known(gravity_tool_face_rad(up)),
        magnetic_tool_face_rad=_known(magnetic_tool_face_rad(field)),
    )


def turned(azimuth: float, declination_rad: float) -> float:
    """True azimuth of a magnetic one, rad."""
    return float(true_azimuth_rad(np.asarray(azimuth), declination_rad))


def _known(angle: Array) -> float | None:
    value = float(angle)
    return value if math.isfinite(value) else None
