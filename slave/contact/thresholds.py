"""From which external torque each joint counts as pushed: what the observer's own noise cannot reach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.contact.config import ContactConfig
from slave.encoders.counts import RAD_PER_COUNT
from slave.model.build import unit_rates
from slave.model.own import leader

DRIVE_STEP_RAD = 2.0 * np.pi / (1 << 16)
"""At the joint's output, of a drive's own encoder: 13 bits behind a gear of 8; most are finer."""
BY_OUTPUTS_S, BY_DRIVES_S = (0.01, 0.02), (0.004, 0.01)
"""Time constants by the 12-bit output encoders, and by drives' own angles."""
COUNTS = 2.25
"""So many counts of every encoder may change at once. Seen in an hour of motions: see README.md."""
TORQUE_NOISE = 0.02
"""Of the torque that a drive tells, share of its motor's limit: four times that of its current."""
LEAST_NM = 0.4
"""Four newtons at a hand's width: less is no push, and what an open hand carries may be wrong by so much."""
FEEBLE_NM = 0.1
"""A joint whose motor has less torque is a finger's: it is meant to touch, and presses with a few newtons."""
_STEP_RESPONSE = 0.2306
"""Peak of s² / (1 + s T)³ for a unit step, times T²: (x - x²/2) e^-x at x = t / T = 2 - √2."""


@dataclass(frozen=True, slots=True)
class Angles:
    """Whose angles the observer takes: their steps, and the time constants that suit them."""

    step_rad: float
    time_constants_s: tuple[float, ...]
    """Ascending. The shortest notices what grows fast, the others what is weak."""


def angles_of(config: ContactConfig, *, drives: bool) -> Angles:
    """The drives' own where they tell them, else the output encoders'."""
    usual_s, step_rad = (BY_DRIVES_S, DRIVE_STEP_RAD) if drives else (BY_OUTPUTS_S, RAD_PER_COUNT)
    shortest_s = config.time_constant_s or usual_s[0]
    return Angles(step_rad, (shortest_s, *(each for each in usual_s if each > shortest_s)))


@cache
def noise_nm(skeleton: Skeleton, model: mujoco.MjModel, angles: Angles) -> Array:
    """(T, J) torque that the steps of quantised angles alone can feign, N m.

    A count that changes is a momentum M Δq̇ that comes and goes. The worst of four postures, the joints'
    couplings included.
    """
    data, rates = mujoco.MjData(model), unit_rates(skeleton, model)
    middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
    product, most = np.empty(model.nv), np.zeros(len(rates))
    for posture in (skeleton.zero_rad, middle, skeleton.lower_rad, skeleton.upper_rad):
        data.qpos[:] = posture @ rates
        mujoco.mj_fwdPosition(model, data)
        feigned = np.zeros(len(rates))
        for rate in rates:
            mujoco.mj_mulM(model, data, product, rate)
            feigned += np.abs(rates @ product)
        most = np.maximum(most, feigned)
    constants_s = np.array(angles.time_constants_s)[:, None]
    out: Array = most * (COUNTS * _STEP_RESPONSE * angles.step_rad / constants_s**2)
    return out


def thresholds_nm(skeleton: Skeleton, model: mujoco.MjModel, config: ContactConfig, angles: Angles) -> Array:
    """(T, J) thresholds at rest, N m; infinite for joints that are not watched: unnamed fingers."""
    out = noise_nm(skeleton, model, angles).copy()
    for j, joint in enumerate(skeleton.joints):
        angle, ratio = leader(joint)
        limit_nm = model.jnt_actfrcrange[model.joint(angle).id, 1] * abs(ratio)
        out[:, j] = np.maximum(LEAST_NM, out[:, j] + TORQUE_NOISE * limit_nm)
        if joint.name in config.joints:
            out[:, j] = config.joints[joint.name].threshold_nm
        elif limit_nm < FEEBLE_NM:
            out[:, j] = np.inf
    return out
