"""A nine-axis sensor's TOML file: one affine map for each of its sensors, and how it sits.

Every key optional (identity where it is left out):

    accelerometer = [[a, b, c, offset], ...]    # 3 rows of 4: m/s² from m/s²
    gyroscope     = [[...], ...]                # rad/s from rad/s
    magnetometer  = [[...], ...]                # µT from µT
    q_sensor_from_segment = [w, x, y, z]        # alignment

    [made.accelerometer]                        # how a part came about; `Made` lists the keys
"""

from __future__ import annotations

from datetime import date
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, AliasChoices, Field

from common.config.section import Section
from common.quaternion import IDENTITY

_WORST_CONDITION = 1e6
"""Beyond it a map all but loses a direction; a sound sensor's is near 1."""


def _affine(rows: list[list[float]]) -> list[list[float]]:
    if [len(row) for row in rows] != [4, 4, 4]:
        raise ValueError("expected 3 rows of 4 numbers, the last an offset")
    # written so that the NaN condition of a matrix of zeros fails too
    if not np.linalg.cond(np.array(rows)[:, :3]) < _WORST_CONDITION:
        raise ValueError("expected three independent rows; this matrix is singular")
    return rows


def _unit_quaternion(q: list[float]) -> list[float]:
    if len(q) != 4 or not abs(np.linalg.norm(q) - 1.0) < 1e-3:
        raise ValueError("expected a unit quaternion [w, x, y, z]")
    return q


AffineRows = Annotated[list[list[float]], AfterValidator(_affine)]
UnitQuaternion = Annotated[list[float], AfterValidator(_unit_quaternion)]

_SAME = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]


class Made(Section):
    """How one part of a node's file came about; for people, the master only checks its form.

    The residuals are means over the data of: accelerometer |‖a‖ - g| of still intervals, m/s²; gyroscope
    the angle between gravity as turned by the gyro and as measured, rad; magnetometer the standard
    deviation of ‖m‖, µT; alignment: see `unit`.
    """

    date: date
    recording: str
    """Name of the file, without its folder."""
    unit: str
    """Of the residuals."""
    residual_before: float | None = None
    residual_after: float | None = None
    hold_out: float | None = None
    """The residual on data that the parameters were not fitted to."""
    sigma: list[list[float]] | None = None
    """1σ of each number of the part, as the fit states it."""


class MadeParts(Section):
    """`[made]`: one table a part."""

    accelerometer: Made | None = None
    gyroscope: Made | None = None
    magnetometer: Made | None = None
    alignment: Made | None = Field(default=None, validation_alias=AliasChoices("alignment", "mounting"))
    """How the sensor sits on its segment. Files of earlier versions call it `mounting`."""


class NodeCalibration(Section):
    """One node's TOML file."""

    accelerometer: AffineRows = _SAME
    """3 × 4, true specific force = matrix · reading + offset (last column, m/s²)."""
    gyroscope: AffineRows = _SAME
    """3 × 4, offset in rad/s."""
    magnetometer: AffineRows = _SAME
    """3 × 4, offset in µT."""
    q_sensor_from_segment: UnitQuaternion = IDENTITY.tolist()
    """Sensor-to-segment alignment: turns the segment's coordinates into the sensor's."""
    made: MadeParts = MadeParts()
