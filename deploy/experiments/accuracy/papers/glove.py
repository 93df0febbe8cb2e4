"""Paper B: two units of a glove on a fixture, first held at known angles, then moved together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from common.quaternion import Array, conjugate, multiply, to_matrix
from common.skeleton import Segment, Skeleton
from deploy.experiments.accuracy.papers.figures import PaperValue
from deploy.experiments.accuracy.papers.fixture import (
    SensorTake,
    Wave,
    Waves,
    free_joint,
    record,
    ticks,
    turntable,
)
from deploy.experiments.accuracy.papers.units import SESSION, calibrate
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, Move
from deploy.sim.suit.tray import TrayConfig
from master.joint_angles.angles import intrinsic_angles
from master.joint_angles.decomposition import JointAngles
from master.orientation.affine import Calibration, identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator

FILTERS = ("ekf", "vqf")
"""The paper's and our default."""
RATE_HZ = 200.0
ANGLES_DEG = (0.0, 30.0, 60.0, 90.0)
STILL_TARGET_DEG, STILL_PAPER_DEG = 0.5, 1.0
RMSE_TARGET_DEG, RMSE_PAPER_DEG = 1.0, 1.5
SPREAD_TARGET_PERCENT = 0.7
MOST_TARGET_DEG, MOST_PAPER_DEG = 2.0, 3.0
ZERO_POSE_S = 3.0
"""The fixture lies in its zero position this long at first: as a glove does, it takes its zero there."""
SETTLED_S = 4.5
"""By then the filters have settled and the zero is taken."""


@dataclass(frozen=True, slots=True)
class _Node:
    filter: str | None = None
    calibration: None = None


def experiment(
    seed: int, hold_s: float = 10.0, moved_s: float = 60.0, session: TrayConfig = SESSION
) -> list[PaperValue]:
    """The paper's section 4 with two units as delivered, calibrated by a session of their own."""
    units = Imperfections("raw", 2, seed)
    calibrated = calibrate(units, 2, [0, 1], seed, session)
    spread = tuple(100.0 * m.hold_out_spread_ut / m.fit.field_ut for m in calibrated.magnetic)
    found = [PaperValue("ellipsoid, hold-out spread", "%", spread, None, SPREAD_TARGET_PERCENT)]
    still, rows = held(units, hold_s)
    moving = moved(units, seed, moved_s)
    for name in FILTERS:
        figures = still_figures(rows, *orient(still, name, calibrated.calibration))
        figures += moving_figures(moving, orient(moving, name, calibrated.calibration)[0])
        found += [replace(figure, name=f"{name}: {figure.name}") for figure in figures]
    return found


def hinged_pair() -> Skeleton:
    """The second of two units is hinged to the first about the X axes of both; the first turns every way."""
    table = turntable()
    second = Segment(
        "second",
        "body",
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ("hinge", None, None),
        (0.03, 0.0, 0.0),
        (0.02, 0.0, 0.0),
    )
    return Skeleton("hinged pair", (*table.segments, second), (*table.joints, free_joint("hinge")))


def orient(take: SensorTake, filter_name: str, calibration: Calibration | None = None) -> tuple[Array, Array]:
    """Orientations (T, N, 4) and rates (T, N, 3) that the master's estimator finds, tick by tick."""
    count = take.samples.shape[2]
    config = EstimationConfig.model_validate({"filter": filter_name, "zero_pose_s": ZERO_POSE_S})
    estimator = Estimator(config, [_Node()] * count, take.rate_hz, calibration or identity(count))
    q, rate = np.empty((len(take.samples), count, 4)), np.empty((len(take.samples), count, 3))
    for k, tick in enumerate(ticks(take)):
        estimator.update(tick)
        posture = estimator.posture()
        q[k], rate[k] = posture.q_world_from_segment, posture.rate_rad_s
    return q, rate


def held(units: Imperfections, hold_s: float = 10.0) -> tuple[SensorTake, list[slice]]:
    """The pair level, hinged to each angle in turn; and which rows belong to each hold."""
    skeleton, turn_s = hinged_pair(), 1.5
    moves, rows, now_s, at_deg = [], [], SETTLED_S, 0.0
    for angle_deg in ANGLES_DEG:
        if angle_deg != at_deg:
            moves.append(Move("hinge", now_s, turn_s, math.radians(angle_deg)))
            now_s, at_deg = now_s + turn_s, angle_deg
        rows.append(slice(round(now_s * RATE_HZ), round((now_s + hold_s) * RATE_HZ)))
        now_s += hold_s
    moves.append(Move("hinge", now_s, turn_s, 0.0))
    motion = MinimumJerkMotion(skeleton.joint_names, np.zeros(4), moves, now_s + turn_s)
    return record(skeleton, motion, now_s, RATE_HZ, units, [0, 1]), rows


def moved(units: Imperfections, seed: int, seconds: float = 60.0) -> SensorTake:
    """Both units on one body, turned by hand about all three axes; the truth is the reference unit."""
    skeleton = turntable(lever_m=0.1)
    random = np.random.default_rng([seed, 7])
    waves = {
        joint: [
            Wave(math.radians(degrees), frequency_hz, random.uniform(0.0, 2.0 * math.pi))
            for degrees, frequency_hz in parts
        ]
        for joint, parts in {
            "yaw": ((55.0, 0.11), (15.0, 0.47)),
            "pitch": ((35.0, 0.17), (12.0, 0.61)),
            "roll": ((50.0, 0.23), (15.0, 0.73)),
        }.items()
    }
    motion = Waves(skeleton.joint_names, waves, still_s=SETTLED_S)
    return record(skeleton, motion, seconds, RATE_HZ, units, [0, 0])


def still_figures(rows: Sequence[slice], q: Array, rate: Array) -> list[PaperValue]:
    """Mean error and spread of the hinge's angle at each hold, as the master solves it."""
    solver = JointAngles(hinged_pair())
    errors, spreads = [], []
    for hold, angle_deg in zip(rows, ANGLES_DEG, strict=True):
        solved = [solver.solve(q[k], rate[k])[0][3] for k in range(*hold.indices(len(q)))]
        errors.append(abs(math.degrees(float(np.mean(solved))) - angle_deg))
        spreads.append(math.degrees(float(np.std(solved))))
    return [
        PaperValue(
            "held at 0, 30, 60, 90°: mean error", "°", tuple(errors), STILL_PAPER_DEG, STILL_TARGET_DEG
        ),
        PaperValue("held: standard deviation", "°", tuple(spreads)),
    ]


def moving_figures(take: SensorTake, q: Array) -> list[PaperValue]:
    """Roll, pitch and yaw of both units against the truth, and by how much they are late."""
    after = round(SETTLED_S * RATE_HZ)
    truth = take.q_world_from_segment[after:, 0]
    true_deg = euler_deg(truth)
    rmse, most = [], []
    for unit in range(q.shape[1]):
        error_deg = euler_deg(q[after:, unit]) - true_deg
        error_deg = (error_deg + 180.0) % 360.0 - 180.0
        rmse.extend(np.sqrt(np.mean(error_deg**2, axis=0)).tolist())
        most.extend(np.abs(error_deg).max(axis=0).tolist())
    late_ms = tuple(1e3 * lateness_s(truth, q[after:, unit], RATE_HZ) for unit in range(q.shape[1]))
    return [
        PaperValue("moved: RMSE of each axis", "°", tuple(rmse), RMSE_PAPER_DEG, RMSE_TARGET_DEG),
        PaperValue("moved: largest error of each axis", "°", tuple(most), MOST_PAPER_DEG, MOST_TARGET_DEG),
        PaperValue("moved: delay of the estimate", "ms", late_ms, 60.0, 60.0),
    ]


def lateness_s(truth: Array, estimate: Array, rate_hz: float) -> float:
    """By how much the estimate (T, 4) trails the truth (T, 4): the error along the motion over its speed.

    Least squares of error = -lateness · rate, over what turns; negative where it leads.
    """
    rate = _between(truth[:-1], truth[1:]) * rate_hz
    error = _between(truth, estimate)[:-1]
    return -float(np.sum(error * rate) / np.sum(rate**2))


def _between(p: Array, q: Array) -> Array:
    """The small rotation from p to q in p's frame, as a vector (T, 3)."""
    turn = multiply(conjugate(p), q)
    out: Array = 2.0 * turn[:, 1:] * np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    return out


def euler_deg(q: Array) -> Array:
    """Yaw, pitch and roll (T, 3), intrinsic z-y-x."""
    # x-y-z of the inverse, its signs turned, is z-y-x
    roll, pitch, yaw = intrinsic_angles(to_matrix(conjugate(q)))
    out: Array = -np.degrees(np.stack([yaw, pitch, roll], axis=-1))
    return out
