"""A simulated person in a suit, from perfect kinematics to the solved joint angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array, conjugate
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.suit.disturbance import Disturbance, DisturbanceConfig
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.motion import OperatorMotion
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from master.joint_angles.decomposition import JointAngles
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from tests.master.orientation.perfect import Node, Readings

EARTH_UT = earth_field_ut(50.0, 60.0)
DECIDE_TICKS = 16


@dataclass(frozen=True, slots=True)
class Worn:
    """What was solved, against the truth, every 16th tick."""

    joint_names: tuple[str, ...]
    t_s: Array
    error_deg: Array

    def rmse_deg(self, word: str, from_s: float = 3.5) -> float:
        """Over all joints whose names have that word."""
        columns = [i for i, name in enumerate(self.joint_names) if word in name]
        return float(np.sqrt(np.mean(self.error_deg[self.t_s >= from_s][:, columns] ** 2)))


Wear = Callable[..., Worn]


def arms() -> Skeleton:
    """The nursing profile's chest, upper arms and forearms."""
    whole = load_skeleton("nursing")
    segments = tuple(s for s in whole.segments if s.name == "chest" or s.name.endswith("arm"))
    angles = {angle for s in segments for angle in s.angles}
    return Skeleton("arms", segments, tuple(j for j in whole.joints if set(j.drives) <= angles))


def wear(
    skeleton: Skeleton,
    motion: OperatorMotion,
    seconds: float,
    *,
    seed: int = 1,
    rate_hz: float = 100.0,
    disturbance: dict[str, Any] | None = None,
    magnetometers: bool = True,
    q_sensor_from_segment: Array | None = None,
    bias_rad_s: Callable[[float], Array] | None = None,
    **estimation: object,
) -> Worn:
    """Run the estimator over a motion; `bias_rad_s` (t) is added to the gyros, (N, 3)."""
    count = len(skeleton.segments)
    calibration = identity(count)
    alignment = None
    if q_sensor_from_segment is not None:
        calibration = replace(calibration, q_sensor_from_segment=q_sensor_from_segment)
        alignment = conjugate(q_sensor_from_segment)
    room = DisturbanceConfig.model_validate(disturbance or {})
    names = skeleton.segment_names
    sensors = IdealSensors(skeleton, EARTH_UT, alignment, Disturbance(room, names, EARTH_UT))
    imperfections = Imperfections("calibrated", count, seed)
    cutoffs = {f"{s}_cutoff_hz": 0.25 * rate_hz for s in ("accelerometer", "gyroscope", "magnetometer")}
    config = EstimationConfig.model_validate(cutoffs | estimation)
    subject = Estimator(config, [Node()] * count, rate_hz, calibration, skeleton)
    solver = JointAngles(skeleton)
    fresh, lost = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    t_s, errors = [], []
    for tick in range(round(seconds * rate_hz)):
        now_s = tick / rate_hz
        state = motion.state(now_s)
        read = imperfections.apply(sensors.read(*state, now_s))
        gyr = read[:, 3:6] + (bias_rad_s(now_s) if bias_rad_s else 0.0)
        mag = read[:, 6:] if magnetometers else np.full((count, 3), np.nan)
        subject.update(Readings(read[:, :3], gyr, mag, fresh, lost))
        if tick % DECIDE_TICKS == 0:
            posture = subject.posture()
            solved, _ = solver.solve(posture.q_world_from_segment, posture.rate_rad_s)
            t_s.append(now_s)
            errors.append(np.degrees(solved - state[0]))
    return Worn(skeleton.joint_names, np.array(t_s), np.array(errors))


@pytest.fixture(name="wear")
def wear_fixture() -> Wear:
    """`wear`, as a fixture."""
    return wear


@pytest.fixture(name="arms")
def arms_fixture() -> Skeleton:
    """`arms`, as a fixture."""
    return arms()
