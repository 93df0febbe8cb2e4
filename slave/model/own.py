"""A robot's own model (MJCF) with tandem's servos on it: its masses, shapes and torque limits stay its own.

What is set: gravity compensation, armatures, stops and servos of the joints in the profile. What is taken
away: actuators, sensors, keyframes, damping and dry friction, because the servos here stand for whole drives.
A joint of the model that the profile leaves out is rigid, at 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from common.errors import ConfigError, ConfigMistake
from common.skeleton import Joint, Skeleton

COMPENSATED = 0.9
"""Share of gravity that the drives feed forward; their idea of the arm is never exact."""
_STOP_RAD = math.radians(3.0)
"""As in build.py: the mechanical stops stand this far outside the table's limits."""


@dataclass(frozen=True, slots=True)
class ServoGains:
    """A joint's servo: torque = stiffness (setpoint - angle) - damping · rate, within the limit."""

    armature_kg_m2: float
    stiffness_nm_rad: float
    damping_nm_s_rad: float
    torque_limit_nm: float


def leader(joint: Joint) -> tuple[str, float]:
    """The hinge that a joint's servo sits on, and its ratio to the joint."""
    return next(iter(joint.moves.items()))


def compile_own(skeleton: Skeleton, drives: Sequence[ServoGains], step_s: float) -> mujoco.MjModel:
    """The model of `skeleton.model`. Raises ConfigError where it cannot be compiled."""
    assert skeleton.model is not None
    try:
        spec = mujoco.MjSpec.from_file(str(skeleton.model))
        _strip(spec, {hinge for joint in skeleton.joints for hinge in joint.moves})
        spec.option.timestep, spec.option.integrator = step_s, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
        )
        for body in spec.bodies[1:]:
            body.gravcomp = COMPENSATED
        spec.worldbody.add_light(pos=[1.0, 0.0, 3.0], dir=[-0.3, 0.0, -1.0], diffuse=[0.8, 0.8, 0.8])
        for joint, drive in zip(skeleton.joints, drives, strict=True):
            _drive(spec, joint, drive, step_s)
        return spec.compile()
    except (ValueError, KeyError) as error:
        expected = f"a model that compiles ({error}); import the robot anew"
        raise ConfigError(skeleton.name, [ConfigMistake("model", str(skeleton.model), expected)]) from None


def _strip(spec: mujoco.MjSpec, moved: set[str]) -> None:
    for kept in (spec.actuators, spec.sensors, spec.keys, spec.equalities):
        for element in list(kept):
            spec.delete(element)
    for hinge in list(spec.joints):
        if hinge.name not in moved:
            spec.delete(hinge)


def _drive(spec: mujoco.MjSpec, joint: Joint, drive: ServoGains, step_s: float) -> None:
    first, first_ratio = leader(joint)
    for name, ratio in joint.moves.items():
        hinge = spec.joint(name)
        hinge.damping[:], hinge.frictionloss = 0.0, 0.0
        low, high = sorted((joint.lower_rad * ratio, joint.upper_rad * ratio))
        slack = _STOP_RAD * abs(ratio)
        hinge.range, hinge.limited = [low - slack, high + slack], mujoco.mjtLimited.mjLIMITED_TRUE
        if name != first:
            spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=name,
                name2=first,
                data=[0.0, ratio / first_ratio, *[0.0] * (mujoco.mjNEQDATA - 2)],
                solref=[2.5 * step_s, 1.0],
                solimp=[0.99, 0.99, 0.01, 0.5, 2.0],
            )
            continue
        hinge.armature = drive.armature_kg_m2 / ratio**2
        hinge.actgravcomp = True
        if hinge.actfrclimited != mujoco.mjtLimited.mjLIMITED_TRUE and not hinge.actfrcrange.any():
            limit = drive.torque_limit_nm / abs(ratio)
            hinge.actfrcrange = [-limit, limit]
        hinge.actfrclimited = mujoco.mjtLimited.mjLIMITED_TRUE
    spec.add_actuator(
        name=joint.name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=first,
        gear=[1.0 / first_ratio, *[0.0] * 5],
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[drive.stiffness_nm_rad, *[0.0] * 9],
        biasprm=[0.0, -drive.stiffness_nm_rad, -drive.damping_nm_s_rad, *[0.0] * 7],
        ctrlrange=[joint.lower_rad, joint.upper_rad],
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
    )
