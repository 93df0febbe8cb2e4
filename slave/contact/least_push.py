"""Below which force no push is noticed, by the segment that is pushed. Pure."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.body import BodyModel
from slave.model.capsules import capsules, links

_LEAST_LEVER_M = 0.01
"""Nearer to its axis a push hardly turns a joint."""


def least_push_n(skeleton: Skeleton, floor_nm: Array) -> dict[str, float]:
    """By segment, N: the least push at its far end, in the zero pose, that reaches one joint's threshold.

    `floor_nm` (J,): the thresholds where motors do nothing, which gravity and motion raise; infinite for
    joints that are not watched. Segments that such a joint moves (fingers), or that none moves, are left out.
    """
    levers_m = _levers_m(skeleton)
    names = [link.name for link in links(skeleton)]
    out = {}
    for name, lever_m in zip(names, levers_m, strict=True):
        moved = lever_m > _LEAST_LEVER_M
        if moved.any() and np.isfinite(floor_nm[moved]).all():
            out[name] = float((floor_nm[moved] / lever_m[moved]).min())
    return out


def push_words(least_n: dict[str, float], drives: bool) -> str:
    """For a person: the segments by the force below which no push is noticed, and by whose angles."""
    if not least_n:
        return ""
    forces: dict[int, list[str]] = {}
    for name, force_n in least_n.items():
        forces.setdefault(math.ceil(force_n), []).append(name)
    listed = "; ".join(f"{force} N at {', '.join(names)}" for force, names in sorted(forces.items()))
    whose = "the drives' angles" if drives else "the output encoders"
    return f"by {whose} no push is noticed below {listed}; in motion, and if it is short, it takes more"


@lru_cache(maxsize=16)
def _levers_m(skeleton: Skeleton) -> Array:
    """(segments, J) by how much a joint's rad moves each segment's far end, m; 0 where it does not."""
    shape, segments = capsules(skeleton), range(len(links(skeleton)))
    zero_rad = np.clip(skeleton.zero_rad, skeleton.lower_rad, skeleton.upper_rad)
    posture = BodyModel(skeleton).at(zero_rad)
    out = []
    for segment in segments:
        ends = [np.array(one.to_m) for one in shape if one.segment == segment]
        far = max(ends, key=lambda end: float(end @ end), default=np.zeros(3))
        moves = posture.jacobian(segment, posture.point_m(segment, far))
        out.append(np.linalg.norm(moves, axis=0))
    return np.array(out)
