"""A limiter with a damper, every step of which is judged by distances computed another way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Mask
from deploy.measure.apart import Distances
from slave.guard import GuardConfig
from slave.guard.events import Clamp
from slave.guard.zones import Zone
from slave.limit.damper import DistanceDamper
from slave.limit.limit import SetpointLimiter

SKELETON = load_skeleton("nursing")
LIMITS = GuardConfig().limits(SKELETON)
NAMES = SKELETON.joint_names
J = len(NAMES)
DT_S = 0.005
MARGIN_M = 0.02
SLACK_M = 0.002
EPS = 1e-9


def posture(**degrees: float) -> Array:
    """Both arms alike for a name without a side."""
    out: Array = np.zeros(J)
    for j, name in enumerate(NAMES):
        side, _, joint = name.partition("_")
        out[j] = np.radians(degrees.get(name, degrees.get(joint, 0.0) if side in ("left", "right") else 0.0))
    return out


CROSSED = posture(shoulder_pitch=45, shoulder_roll=-10, shoulder_yaw=-75, elbow_pitch=90)
ON_THE_HEAD = posture(shoulder_pitch=135, shoulder_yaw=-50, elbow_pitch=122)
THROUGH_THE_CHEST = posture(shoulder_pitch=-25, shoulder_roll=10, shoulder_yaw=-70, elbow_pitch=129)


class Robot:
    """Goes where it is told, and keeps what it must; `course` is all setpoints since the last `judge`."""

    def __init__(self, zones: Sequence[Zone] = (), start: Array | None = None, damped: bool = True) -> None:
        self.damper = DistanceDamper(SKELETON, 100.0 * MARGIN_M, zones)
        self.limiter = SetpointLimiter(NAMES, LIMITS, self.damper if damped else None)
        self.limiter.seat(np.zeros(J) if start is None else start)
        self.distances = Distances(SKELETON, zones)
        self.clamps: list[Clamp] = []
        self.course = [self.limiter.position_rad]

    def go(
        self,
        target: Array,
        seconds: float,
        held: Mask | None = None,
        dt_s: float = DT_S,
        slowness: float = 1.0,
    ) -> None:
        none = np.zeros(J, np.bool_)
        most = LIMITS.max_velocity_rad_s / slowness, LIMITS.max_acceleration_rad_s2 / slowness
        if slowness == 1.0:
            most = LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2
        for _ in range(round(seconds / dt_s)):
            p, v = self.limiter.position_rad, self.limiter.velocity_rad_s
            self.clamps += self.limiter.step(
                0, dt_s, target, np.zeros(J), none if held is None else held, *most
            )
            self._check(p, v, dt_s)

    def stop(self, dt_s: float = DT_S) -> None:
        while not self.limiter.at_rest:
            p, v = self.limiter.position_rad, self.limiter.velocity_rad_s
            self.limiter.stop(dt_s)
            self._check(p, v, dt_s)

    def _check(self, p: Array, v: Array, dt_s: float) -> None:
        q, w = self.limiter.position_rad, self.limiter.velocity_rad_s
        assert (np.abs(w) <= LIMITS.max_velocity_rad_s + EPS).all()
        assert (np.abs(w - v) <= LIMITS.max_acceleration_rad_s2 * dt_s + EPS).all()
        assert (q >= LIMITS.lower_rad - EPS).all()
        assert (q <= LIMITS.upper_rad + EPS).all()
        assert np.allclose(q - p, w * dt_s, rtol=0, atol=EPS)
        # the way between two setpoints counts too
        self.course += [p + share * (q - p) for share in (0.25, 0.5, 0.75, 1.0)]

    def least_m(self) -> tuple[float, Array]:
        """The least distance within the robot, and to each zone, on the course since the last call."""
        course = np.array(self.course)
        self.course = [self.limiter.position_rad]
        to_zones = self.distances.to_zones_m(course)
        return float(self.distances.own_m(course).min()), to_zones.min(axis=0, initial=np.inf)
