"""The least peak force of any reflex: a point mass that meets the clamped patient and begins to brake late.

No reflex knows of a touch before it, and until its drives answer, the part moves on. What then slows it is
the patient and the motor that brakes with all it has. Nothing pushes meanwhile: a real drive does, so that
each figure here is a lower bound. Pure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from common.skeleton import load_skeleton
from deploy.sim.patient.impact import JOINT, MEETS_RAD, Place
from deploy.sim.patient.patient import DAMPING_RATIO, MASS_KG, STIFFNESS_N_M
from slave.model.build import build_model, unit_rates

_STEP_S = 2e-5
_LONGEST_S = 0.3


@dataclass(frozen=True, slots=True)
class Striking:
    """What moves at the place of contact, along the way that it comes."""

    mass_kg: float
    """1 / (n · J M⁻¹ Jᵀ n): all joints are free to give way."""
    brake_n: float
    """The shoulder's motor with all that it has, at its lever."""


def striking(place: Place) -> Striking:
    """Of the robot that `meet` swings."""
    skeleton = load_skeleton("nursing")
    model = build_model(skeleton)
    data = mujoco.MjData(model)
    posture = np.clip(np.zeros(len(skeleton.joints)), skeleton.lower_rad, skeleton.upper_rad)
    posture[skeleton.joint_names.index(JOINT)] = MEETS_RAD
    data.qpos[:] = posture @ unit_rates(skeleton, model)
    mujoco.mj_fwdPosition(model, data)
    body = model.body(place.segment).id
    point_m = data.xpos[body] + data.xmat[body].reshape(3, 3) @ np.array(place.local_m)
    jacobian, inertia = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point_m, body)
    mujoco.mj_fullM(model, data, inertia)
    hinge = model.joint(JOINT)
    turned = jacobian[:, hinge.dofadr[0]]
    lever_m = float(np.linalg.norm(turned))
    along = (turned / lever_m) @ jacobian
    most_nm = float(model.jnt_actfrcrange[hinge.id, 1])
    return Striking(float(1.0 / (along @ np.linalg.solve(inertia, along))), most_nm / lever_m)


def least_peak_n(what: Striking, speed_m_s: float, brakes_after_s: float) -> float:
    """Peak force, N, on the clamped patient, if braking begins so long after the touch; inf: never.

    m x'' = -(k x + c x') - B.  Spring and damper are in parallel, so that c v is there at once.
    """
    damping = 2.0 * DAMPING_RATIO * math.sqrt(STIFFNESS_N_M * MASS_KG)
    depth, speed, peak, t_s = 0.0, speed_m_s, 0.0, 0.0
    while speed > 0.0 and t_s < _LONGEST_S:
        force = STIFFNESS_N_M * depth + damping * speed
        peak = max(peak, force)
        brake = what.brake_n if t_s >= brakes_after_s else 0.0
        speed -= (force + brake) / what.mass_kg * _STEP_S
        depth += speed * _STEP_S
        t_s += _STEP_S
    return peak


def latest_s(what: Striking, speed_m_s: float, most_n: float) -> float:
    """The latest that braking may begin for a peak of `most_n`, s; inf: it need not; below 0: never."""
    if least_peak_n(what, speed_m_s, math.inf) <= most_n:
        return math.inf
    if least_peak_n(what, speed_m_s, 0.0) > most_n:
        return -1.0
    low, high = 0.0, _LONGEST_S
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        within = least_peak_n(what, speed_m_s, middle) <= most_n
        low, high = (middle, high) if within else (low, middle)
    return low
