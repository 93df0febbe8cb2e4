"""Which part of a robot meets a person and where, and which load it must notice: from its own model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.contact.config import ContactConfig
from slave.contact.thresholds import angles_of, thresholds_nm
from slave.model.build import build_model, unit_rates
from slave.model.capsules import links

_HAND, _FOREARM = "right_hand", "right_forearm"
_HALF_KG = 0.5
_GRAVITY_M_S2 = 9.81


@dataclass(frozen=True, slots=True)
class MetPart:
    """A body of the robot, and the point on it that meets somebody, in the body's frame."""

    body: str
    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


def body_of(skeleton: Skeleton, segment: str) -> str | None:
    """The robot's body that follows a segment of the operator; None: it has none."""
    for each in skeleton.segments:
        if each.name == segment:
            names = {link.name for link in links(skeleton)}
            body = each.link or each.name
            return body if body in names else None
    return None


def hand(skeleton: Skeleton) -> MetPart | None:
    """The hand, where its last joint is. At the speed of `align` the least heavy part is what meets.

    Farther up a heavy arm meets a free person with less than what is ever noticed (`tandem status`).
    """
    body = body_of(skeleton, _HAND)
    return None if body is None else MetPart(body)


def wrist(skeleton: Skeleton) -> MetPart | None:
    """Where the hand hangs on the forearm: no joint of the hand has a lever there.

    A push at full speed on the end of a hand turns a light wrist faster than its limit, whatever the drives
    do: 300 N on a lever of 9 cm are twice what a wrist's motor of 12 N m gives.
    """
    last, above = body_of(skeleton, _HAND), body_of(skeleton, _FOREARM)
    if last is None:
        return None
    by_name = {link.name: link for link in links(skeleton)}
    link = by_name[last]
    while link.parent in by_name and link.parent != above:
        link = by_name[link.parent]
    at_m = link.hinges[0].anchor_m if link.hinges else (0.0, 0.0, 0.0)
    return MetPart(link.name, at_m)


@lru_cache(maxsize=16)
def undeclared_kg(skeleton: Skeleton, position_rad: tuple[float, ...], least_kg: float) -> float | None:
    """What hung on the forearm reaches a joint's threshold at rest in a posture (J,); None: no forearm.

    A robot of large motors and heavy arms does not notice what a small one does.
    """
    body = body_of(skeleton, _FOREARM)
    if body is None:
        return None
    model, config = build_model(skeleton), ContactConfig()
    data, rates = mujoco.MjData(model), unit_rates(skeleton, model)
    data.qpos[:] = np.array(position_rad) @ rates
    mujoco.mj_forward(model, data)
    moves = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, moves, None, model.body(body).id)
    lever_m: Array = np.abs(rates @ moves[2])
    held_nm: Array = np.abs(rates @ data.qfrc_bias)
    floor_nm = thresholds_nm(skeleton, model, config, angles_of(config, drives=False)).min(axis=0)
    needed_nm = floor_nm + config.model_error * held_nm
    moved = lever_m > 1e-3
    if not moved.any():
        return None
    kg = float((needed_nm[moved] / lever_m[moved]).min()) / _GRAVITY_M_S2
    return max(least_kg, _HALF_KG * math.ceil(kg / _HALF_KG))
