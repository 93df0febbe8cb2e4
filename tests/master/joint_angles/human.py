"""What a person's joints can do, beyond what robots' can, and smooth motions of all of it."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array, conjugate, from_axis_angle, multiply, to_rotation_vector
from common.skeleton import Skeleton

HUMAN_DEG = {
    "chest": ((-180, 180), (-30, 115), (-35, 35)),
    "head": ((-85, 85), (-60, 75), (-45, 45)),
    "upper_arm": ((-60, 190), (-40, 185), (-95, 95)),
    "forearm": ((-10, 150), (-8, 8), (-95, 95)),
    "hand": ((-35, 35), (-85, 85), (-15, 15)),
    "thigh": ((-30, 130), (-40, 65), (-60, 60)),
    "shank": ((-10, 150), (-5, 5), (-20, 20)),
    "foot": ((-60, 35), (-30, 35), (-20, 20)),
    "proximal": ((-40, 95), (-25, 25), (-10, 10)),
    "middle": ((-10, 120), (-3, 3), (-3, 3)),
    "distal": ((-15, 95), (-3, 3), (-3, 3)),
}
"""About the three axes of each segment's table, by the end of its name. A root may lie and face anywhere."""
ROOT_DEG = ((-180, 180), (-90, 90), (-60, 60))


def human_range(skeleton: Skeleton) -> tuple[Array, Array]:
    """Lowest and highest angles (N, 3) about each segment's axes, rad."""
    rows = [
        next((deg for end, deg in HUMAN_DEG.items() if s.name.endswith(end)), None)
        if s.parent != "world" or s.name == "chest"
        else ROOT_DEG
        for s in skeleton.segments
    ]
    assert None not in rows
    low, high = np.moveaxis(np.radians(np.array(rows, dtype=np.float64)), -1, 0)
    return low, high


def relative(skeleton: Skeleton, angle_rad: Array) -> Array:
    """Rotations parent from segment (..., N, 4) for angles (..., N, 3) about the table's axes."""
    axes = np.array([s.axes for s in skeleton.segments], dtype=np.float64)
    one, two, three = (from_axis_angle(axes[:, k], angle_rad[..., k]) for k in range(3))
    return multiply(multiply(one, two), three)


def in_world(skeleton: Skeleton, q_parent_from_segment: Array) -> Array:
    """Orientations (..., N, 4)."""
    q = np.empty_like(q_parent_from_segment)
    for i, parent in enumerate(skeleton.parents):
        own = q_parent_from_segment[..., i, :]
        q[..., i, :] = own if parent < 0 else multiply(q[..., parent, :], own)
    return q


def body_rates(q: Array, dt_s: float) -> Array:
    """Rates (T, ..., 3) in each segment's own frame by differences along the first axis; the first are 0."""
    out = np.zeros((*q.shape[:-1], 3))
    out[1:] = to_rotation_vector(multiply(conjugate(q[:-1]), q[1:])) / dt_s
    return out


def random_motions(skeleton: Skeleton, count: int, steps: int, dt_s: float, seed: int) -> Array:
    """Angles (steps, count, N, 3) rad: minimum-jerk movements to and fro, no axis faster than 300°/s.

    Half of them go right across the human range, its ends included; half are small ones anywhere in it.
    """
    rng = np.random.default_rng(seed)
    low, high = human_range(skeleton)

    def anywhere() -> Array:
        share = np.clip(rng.uniform(-0.15, 1.15, (count, *low.shape)), 0.0, 1.0)
        return low + (high - low) * share

    begin, end = anywhere(), anywhere()
    near = np.clip(begin + rng.normal(0.0, np.radians(12.0), begin.shape), low, high)
    end = np.where(rng.uniform(size=(count, 1, 1)) < 0.5, near, end)
    farthest = np.abs(end - begin).max(axis=(1, 2))
    lasts_s = np.maximum(rng.uniform(0.4, 3.0, count), 1.875 * farthest / np.radians(300.0))
    u = np.arange(steps)[:, None] * dt_s / lasts_s + rng.uniform(0.0, 2.0, count)
    u = np.abs((u + 1.0) % 2.0 - 1.0)[..., None, None]
    path: Array = begin + (end - begin) * (u**3 * (10.0 + u * (6.0 * u - 15.0)))
    return path


def turns(q: Array) -> Array:
    """By how much rotations (T, ..., 4) turn from one to the next along the first axis, rad."""
    product = np.abs(np.einsum("t...i,t...i->t...", q[1:], q[:-1]))
    out: Array = 2.0 * np.arccos(np.minimum(product, 1.0))
    return out
