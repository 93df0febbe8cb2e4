"""What perfect sensors would read: specific force, rotation rate and magnetic field in each node's frame."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import IDENTITY, Array, normalise, to_matrix
from common.skeleton import Skeleton
from deploy.sim.suit.chain import Chain
from deploy.sim.suit.disturbance import Disturbance

CHANNELS = 9
"""Columns of all readings, in the order of the wire: accelerometer x y z, gyro x y z, magnetometer x y z."""
GRAVITY_M_S2 = 9.80665


def earth_field_ut(strength_ut: float, dip_deg: float) -> Array:
    """The earth's field (3,) in east-north-up: it points to magnetic north and, in its hemisphere, down."""
    dip = math.radians(dip_deg)
    return strength_ut * np.array([0.0, math.cos(dip), -math.sin(dip)])


class IdealSensors:
    """Sensors of every segment's node without any error.

    An accelerometer reads specific force, f = a − g: at rest +9.81 m/s² on the axis that points up.
    `q_segment_from_sensor` (N, 4) says how each sits on its segment; None: aligned with it. The field is the
    same everywhere, unless a `disturbance` gives it.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        field_ut: Array,
        q_segment_from_sensor: Array | None = None,
        disturbance: Disturbance | None = None,
    ) -> None:
        count = len(skeleton.segments)
        alignment = np.tile(IDENTITY, (count, 1)) if q_segment_from_sensor is None else q_segment_from_sensor
        self._chain = Chain(skeleton)
        self._segment_from_sensor = to_matrix(normalise(alignment))
        # rows: specific force, rate, field, in the world; the first two are filled in at each reading
        self._in_world = np.zeros((count, 3, 3))
        self._in_world[:, 2] = field_ut
        self._disturbance = disturbance

    def read(
        self, position_rad: Array, velocity_rad_s: Array, acceleration_rad_s2: Array, t_s: float = 0.0
    ) -> Array:
        """Readings (N, 9), m/s² · rad/s · µT, for joint positions and their derivatives, (J,) each.

        The time matters to a disturbance only.
        """
        motion = self._chain.motion(position_rad, velocity_rad_s, acceleration_rad_s2)
        self._in_world[:, 0] = motion.node_acceleration_m_s2
        self._in_world[:, 0, 2] += GRAVITY_M_S2
        self._in_world[:, 1] = motion.rate_rad_s
        if self._disturbance is not None:
            self._in_world[:, 2] = self._disturbance.field_ut(t_s, motion.node_position_m)
        # a row times R is Rᵀ times the column: from the world into the sensor
        in_sensor = self._in_world @ (motion.world_from_segment @ self._segment_from_sensor)
        return in_sensor.reshape(-1, CHANNELS)
