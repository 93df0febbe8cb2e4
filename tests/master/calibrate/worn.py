"""A simulated person as units worn askew read it: stands in the zero pose, then swings all joints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, from_axis_angle
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from master.calibrate.recording import NodeRecording

RATE_HZ = 100.0
STILL_S, MOVING_S = 3.0, 20.0
FINGERS = ("thumb", "index", "middle", "ring", "little")


@dataclass(frozen=True)
class Worn:
    """What a simulated person's units read, and the truth."""

    skeleton: Skeleton
    nodes: dict[str, NodeRecording]
    q_segment_from_sensor: dict[str, Array]
    angles_rad: Array
    """(T, J)."""


def wear(profile: str, seed: int, askew_deg: float = 40.0, moving_s: float = MOVING_S) -> Worn:
    """Stand in the zero pose, then swing all joints; units of the grade `calibrated`, each askew."""
    skeleton = load_skeleton(profile)
    random = np.random.default_rng(seed)
    lower, upper = np.maximum(skeleton.lower_rad, -1.2), np.minimum(skeleton.upper_rad, 1.6)
    f, phase = random.uniform(0.25, 0.7, (3, len(lower))), random.uniform(0.0, 2.0 * math.pi, (3, len(lower)))

    def position(t: Array) -> Array:
        s = np.clip((t - STILL_S) / 1.5, 0.0, 1.0)[:, None]
        waves = np.sin(2.0 * math.pi * f[:, None] * (t[None, :, None] - STILL_S) + phase[:, None]).mean(
            axis=0
        )
        out: Array = (
            s**3 * (10.0 - 15.0 * s + 6.0 * s**2) * 0.5 * (lower + upper + 0.8 * (upper - lower) * waves)
        )
        return out

    t, h = np.arange(round((STILL_S + moving_s) * RATE_HZ)) / RATE_HZ, 1e-4
    before, now, after = position(t - h), position(t), position(t + h)
    count = len(skeleton.segments)
    axis = random.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    alignment = from_axis_angle(axis, np.radians(askew_deg) * random.uniform(0.5, 1.0, count))
    sensors = IdealSensors(skeleton, earth_field_ut(50.0, 60.0), alignment)
    flaws = Imperfections("calibrated", count, seed)
    motion = zip(now, (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2, strict=True)
    readings = np.array([flaws.apply(sensors.read(*state)) for state in motion])
    names = [n for n in skeleton.segment_names if profile == "hand" or not any(x in n for x in FINGERS)]
    rows = {name: skeleton.segment_names.index(name) for name in names}
    return Worn(
        skeleton,
        {n: NodeRecording(n, RATE_HZ, readings[:, i, :3], readings[:, i, 3:6]) for n, i in rows.items()},
        {n: alignment[i] for n, i in rows.items()},
        now,
    )
