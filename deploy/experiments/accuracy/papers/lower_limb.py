"""Paper C: a person walks with sensors worn askew: the knees from gyros and accelerometers alone."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import IDENTITY, Array, conjugate, from_axis_angle, normalise, rotate
from common.skeleton import load_skeleton
from deploy.experiments.accuracy.papers.figures import PaperValue
from deploy.experiments.accuracy.papers.fixture import SensorTake, record
from deploy.sim.suit.imperfections import GradeName, Imperfections
from deploy.sim.suit.motion import load_motion
from master.calibrate.alignment import find_alignment
from master.calibrate.hinge import find_hinge
from master.calibrate.recording import NodeRecording
from master.orientation.hinge_angle import HingeAngleConfig, hinge_angles, hinge_of

RATE_HZ = 200.0
STILL_S = 3.5
"""The walk begins with standing still so long."""
MOTION_S = 20.0
ASKEW_DEG = 40.0
AXIS_TARGET_DEG = 2.0
KNEE_TARGET_DEG = 2.0
LEGS = load_skeleton("lower_limb")
WORN = tuple(name for name in LEGS.segment_names if name.endswith(("thigh", "shank")))
KNEES = ("left_shank", "right_shank")


def experiment(seed: int, grade: GradeName = "calibrated") -> list[PaperValue]:
    """Both knees of one walk, every sensor 40° askew about an axis of its own; no magnetometer is read."""
    q_segment_from_sensor = askew(seed)
    take = walk(seed, grade, q_segment_from_sensor)
    found = find_alignment(recordings(take), LEGS, zero_pose_s=(0.3, STILL_S - 0.3))
    missing = [name for name in WORN if name not in found.nodes]
    axes = axis_errors_deg(take, q_segment_from_sensor)
    figures = [PaperValue("hinge axes in both sensors' frames", "°", axes, None, AXIS_TARGET_DEG)]
    if missing:
        return [*figures, PaperValue("knee angle, RMSE", "°", (), None, KNEE_TARGET_DEG)]
    alignment = np.array(
        [found.nodes[name].q_sensor_from_segment if name in WORN else IDENTITY for name in LEGS.segment_names]
    )
    error_deg = knee_errors_deg(take, alignment)
    own_zero_deg = error_deg - error_deg.mean(axis=1, keepdims=True)
    return [
        *figures,
        PaperValue("knee angle, RMSE", "°", _rms(error_deg), None, KNEE_TARGET_DEG),
        PaperValue("knee angle, largest error", "°", tuple(np.abs(error_deg).max(axis=1).tolist())),
        PaperValue("knee angle, RMSE about its mean error", "°", _rms(own_zero_deg)),
    ]


def askew(seed: int) -> Array:
    """q_segment_from_sensor (N, 4): each sensor turned by 40° about an axis drawn evenly over the sphere."""
    axes = normalise(np.random.default_rng([seed, 11]).standard_normal((len(LEGS.segments), 3)))
    return from_axis_angle(axes, np.full(len(axes), math.radians(ASKEW_DEG)))


def walk(seed: int, grade: GradeName, q_segment_from_sensor: Array) -> SensorTake:
    """Standing still, then 20 s of walking, read by a unit on each of the 7 segments."""
    count = len(LEGS.segments)
    units = Imperfections(grade, count, seed)
    motion = load_motion("walk", LEGS)
    return record(LEGS, motion, STILL_S + MOTION_S, RATE_HZ, units, range(count), q_segment_from_sensor)


def recordings(take: SensorTake) -> dict[str, NodeRecording]:
    """The take by segment, without magnetometers."""
    return {
        name: NodeRecording(name, take.rate_hz, take.samples[:, 0, i], take.samples[:, 1, i])
        for i, name in enumerate(LEGS.segment_names)
        if name in WORN
    }


def axis_errors_deg(take: SensorTake, q_segment_from_sensor: Array) -> tuple[float, ...]:
    """Angle between each knee's found and true axis in both sensors' frames, whatever the sign."""
    after = slice(round(STILL_S * RATE_HZ), None)
    gyr = take.samples[:, 1] - take.samples[: after.start, 1].mean(axis=0)
    errors = []
    for name in KNEES:
        far = LEGS.segment_names.index(name)
        near = int(LEGS.parents[far])
        hinge = find_hinge(gyr[after, near], gyr[after, far], RATE_HZ)
        axis = np.array(LEGS.segments[far].axes[0], dtype=np.float64)
        for node, found in ((near, hinge.axis1), (far, hinge.axis2)):
            true = rotate(conjugate(q_segment_from_sensor[node]), axis)
            errors.append(math.degrees(math.atan2(_length(np.cross(true, found)), abs(float(true @ found)))))
    return tuple(errors)


def knee_errors_deg(take: SensorTake, q_sensor_from_segment: Array) -> Array:
    """Fused angle minus truth of both knees while walking, (2, T)."""
    rows = []
    for name in KNEES:
        far = LEGS.segment_names.index(name)
        near = int(LEGS.parents[far])
        hinge = hinge_of(LEGS, [name], q_sensor_from_segment)
        one = type(hinge)(*(getattr(hinge, field)[0] for field in type(hinge).__slots__))
        acc, gyr = take.samples[:, 0], take.samples[:, 1]
        track = hinge_angles(
            HingeAngleConfig(), one, RATE_HZ, gyr[:, near], acc[:, near], gyr[:, far], acc[:, far]
        )
        true_rad = take.position_rad[:, LEGS.joint_names.index(name.replace("shank", "knee_flexion"))]
        rows.append(np.degrees(track.angle_rad - true_rad)[round(STILL_S * RATE_HZ) :])
    return np.array(rows)


def _rms(error_deg: Array) -> tuple[float, ...]:
    return tuple(np.sqrt(np.mean(error_deg**2, axis=1)).tolist())


def _length(v: Array) -> float:
    return float(np.linalg.norm(v))
