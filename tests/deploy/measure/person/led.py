"""A simulated person who does what the led steps ask, with sensors that sit askew and are not perfect."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.recording.node import NodeRecording
from common.skeleton import load_skeleton
from deploy.measure.person.steps import SETTLE_S, STEP_S, STEPS
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut

SKELETON = load_skeleton("nursing")
NODES = ("chest", "head", "left_upper_arm", "left_forearm", "left_hand", "right_upper_arm", "right_forearm",
         "right_hand")  # fmt: skip
PARENTS = {
    name: SKELETON.segment_names[SKELETON.parents[SKELETON.segment_names.index(name)]]
    for name in NODES
    if SKELETON.parents[SKELETON.segment_names.index(name)] >= 0
}
RATE_HZ = 100.0
BOTH = ("left", "right")
MOVES: dict[str, dict[str, tuple[float, float, float]]] = {
    "right arm": {"right_shoulder_pitch": (40, 40, 0.25), "right_shoulder_roll": (15, 15, 0.16)},
    "left arm": {"left_shoulder_pitch": (40, 40, 0.25), "left_shoulder_roll": (15, 15, 0.16)},
    "both arms": {f"{side}_shoulder_pitch": (45, 45, 0.25) for side in BOTH},
    "right elbow": {"right_elbow_pitch": (50, 45, 0.25)},
    "left elbow": {"left_elbow_pitch": (50, 45, 0.25)},
    "hands": {
        **{f"{side}_elbow_pitch": (85, 0, 1.0) for side in BOTH},
        **{f"{side}_wrist_yaw": (0, 28, 0.3) for side in BOTH},
    },
    "forearms": {
        **{f"{side}_elbow_pitch": (85, 0, 1.0) for side in BOTH},
        **{f"{side}_elbow_roll": (0, 45, 0.25) for side in BOTH},
    },
    "head and back": {"neck_pitch": (0, 20, 0.25), "neck_yaw": (0, 30, 0.2), "waist_pitch": (15, 15, 0.2)},
}
"""By step and joint: middle and amplitude, °, and frequency, Hz."""


def posture(t_s: float) -> Array:
    out = SKELETON.zero_rad.copy()
    number, at_s = min(int(t_s // STEP_S), len(STEPS) - 1), t_s % STEP_S
    rise = np.clip((at_s - 0.3) / (SETTLE_S - 0.5), 0.0, 1.0) * np.clip((STEP_S - at_s) / 1.2, 0.0, 1.0)
    ease = rise**3 * (10.0 - 15.0 * rise + 6.0 * rise**2)
    for name, (middle, swing, hz) in MOVES.get(STEPS[number].name, {}).items():
        joint = SKELETON.joint_names.index(name)
        # there and back with a rest at each end, as the steps ask
        wave = math.tanh(3.0 * math.sin(2.0 * math.pi * hz * (at_s - SETTLE_S))) / math.tanh(3.0)
        wanted = math.radians(middle + swing * wave)
        low, high = SKELETON.lower_rad[joint], SKELETON.upper_rad[joint]
        wanted = wanted if low <= out[joint] + wanted <= high else np.clip(wanted, low, high) - 0.0
        out[joint] += ease * wanted
    return out


def led_person(seed: int = 0) -> dict[str, NodeRecording]:
    """All ten steps at 100 Hz."""
    random = np.random.default_rng(seed)
    askew = random.normal(size=(len(SKELETON.segments), 4)) * 0.3 + [1.0, 0.0, 0.0, 0.0]
    sensors = IdealSensors(SKELETON, earth_field_ut(48.0, 60.0), askew)
    h = 1e-3
    readings = []
    for t in np.arange(0.0, STEP_S * len(STEPS), 1.0 / RATE_HZ):
        before, now, after = posture(max(0.0, t - h)), posture(t), posture(t + h)
        readings.append(sensors.read(now, (after - before) / (2 * h), (after - 2 * now + before) / h**2))
    all_ = np.array(readings)
    out = {}
    for name in NODES:
        one = all_[:, SKELETON.segment_names.index(name)]
        sway = 0.02 * np.cumsum(random.normal(size=(len(one), 3)), axis=0) * 0.0
        acc = one[:, :3] * random.normal(1.0, 0.005, 3) + random.normal(0.0, 0.05, (len(one), 3)) + sway
        gyr = one[:, 3:6] * random.normal(1.0, 0.01, 3) + random.normal(0.0, 0.005, 3)
        gyr = gyr + random.normal(0.0, 0.01, (len(one), 3))
        out[name] = NodeRecording(name, RATE_HZ, acc, gyr)
    return out
