"""Calibration of the readings: one affine map a sensor, and how the sensor sits on its segment.

A node's TOML, every key optional (identity where it is left out):

    accelerometer = [[a, b, c, offset], ...]    # 3 rows of 4: m/s² from m/s²
    gyroscope     = [[...], ...]                # rad/s from rad/s
    magnetometer  = [[...], ...]                # µT from µT
    q_sensor_from_segment = [w, x, y, z]        # mounting

    [made.accelerometer]                        # how a part came about; `Made` lists the keys
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from common.config import Section, load_config
from common.messages import Mask
from common.quaternion import IDENTITY, Array, normalise

ACC, GYR, MAG = 0, 1, 2
"""Places of the three sensors along the first axis of `samples` (3, N, 3) and of all that goes with it."""

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
    deviation of ‖m‖, µT; mounting: see `unit`.
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
    mounting: Made | None = None


class NodeCalibration(Section):
    """One node's TOML file."""

    accelerometer: AffineRows = _SAME
    """3 × 4, true specific force = matrix · reading + offset (last column, m/s²)."""
    gyroscope: AffineRows = _SAME
    """3 × 4, offset in rad/s."""
    magnetometer: AffineRows = _SAME
    """3 × 4, offset in µT."""
    q_sensor_from_segment: UnitQuaternion = IDENTITY.tolist()
    """Mounting: turns the segment's coordinates into the sensor's."""
    made: MadeParts = MadeParts()


@dataclass(frozen=True, slots=True)
class Calibration:
    """What all N nodes' files say, in node order."""

    affine: Array
    """(3, N, 3, 4): accelerometer, gyroscope, magnetometer."""
    q_sensor_from_segment: Array
    """(N, 4)."""
    mounting_made: Mask | None = None
    """(N,) whose file says how the mounting was found; None: nobody's."""

    @property
    def mounted(self) -> Mask:
        """(N,) nodes whose mounting is known: found, or at least not the identity."""
        askew: Mask = np.any(self.q_sensor_from_segment != IDENTITY, axis=-1)
        return askew if self.mounting_made is None else askew | self.mounting_made


def identity(count: int) -> Calibration:
    """Readings taken as they come, sensors aligned with their segments."""
    return _stack([NodeCalibration()] * count)


def load_calibration(paths: Sequence[Path | None]) -> Calibration:
    """Read the nodes' files; a node without one gets the identity.

    Raises ConfigError naming file, key, value and what was expected.
    """
    same = NodeCalibration()
    return _stack([same if path is None else load_config(path, NodeCalibration) for path in paths])


def _stack(nodes: list[NodeCalibration]) -> Calibration:
    return Calibration(
        affine=np.array(
            [
                [node.accelerometer for node in nodes],
                [node.gyroscope for node in nodes],
                [node.magnetometer for node in nodes],
            ]
        ),
        q_sensor_from_segment=normalise(np.array([node.q_sensor_from_segment for node in nodes])),
        mounting_made=np.array([node.made.mounting is not None for node in nodes], dtype=np.bool_),
    )


def apply(affine: Array, samples: Array) -> Array:
    """Calibrated samples (3, N, 3) of raw ones, for maps (3, N, 3, 4). NaN stays within its sensor."""
    out: Array = np.einsum("snij,snj->sni", affine[..., :3], samples)
    out += affine[..., 3]
    return out
