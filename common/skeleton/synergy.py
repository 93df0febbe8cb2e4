"""From the many joints of a skeleton to the fewer ones of a coarser robot, and back."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.skeleton.table import Skeleton


def joints_from_synergies(skeleton: Skeleton) -> Array:
    """Ratios (J, S): how far each joint goes for one unit of each of the S synergies."""
    ratios = np.zeros((len(skeleton.joints), len(skeleton.synergies)))
    for s, synergy in enumerate(skeleton.synergies):
        for joint, ratio in synergy.drives.items():
            ratios[skeleton.joint_names.index(joint), s] = ratio
    return ratios


def synergies_from_joints(skeleton: Skeleton) -> Array:
    """Weights (S, J), the least-squares inverse of the ratios c, each joint in one synergy: Σ c θ / Σ c²."""
    ratios = joints_from_synergies(skeleton)
    out: Array = (ratios / np.sum(ratios**2, axis=0)).T
    return out


def synergy_positions(skeleton: Skeleton, position_rad: Array) -> Array:
    """The coarser robot's positions (..., S) nearest to joint positions (..., J); likewise for velocities.

    For the profile `hand`: 14 flexion angles to the five finger joints of the nursing robot's hand.
    """
    out: Array = position_rad @ synergies_from_joints(skeleton).T
    return out
