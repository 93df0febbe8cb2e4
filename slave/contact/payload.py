"""The robot's model with what it carries."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import build_model
from slave.servos.payload import PayloadConfig


def loaded_model(skeleton: Skeleton, payload: Mapping[str, PayloadConfig]) -> mujoco.MjModel:
    """The skeleton's model, each payload a point mass of its segment's body."""
    model = build_model(skeleton)
    for segment, carried in payload.items():
        _add(model, model.body(segment).id, carried.mass_kg, np.array(carried.center_m))
    if payload:
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _add(model: mujoco.MjModel, body: int, mass_kg: float, center_m: Array) -> None:
    own_kg, own_m = float(model.body_mass[body]), model.body_ipos[body].copy()
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes = turn.reshape(3, 3)
    whole_kg = own_kg + mass_kg
    whole_m = (own_kg * own_m + mass_kg * center_m) / whole_kg
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    # Steiner: each part's inertia about the common centre
    for part_kg, part_m in ((own_kg, own_m), (mass_kg, center_m)):
        away = part_m - whole_m
        inertia += part_kg * (away @ away * np.eye(3) - np.outer(away, away))
    principal, frame = np.linalg.eigh(inertia)
    frame[:, 0] *= np.sign(np.linalg.det(frame))
    model.body_mass[body], model.body_ipos[body], model.body_inertia[body] = whole_kg, whole_m, principal
    mujoco.mju_mat2Quat(model.body_iquat[body], frame.ravel())
