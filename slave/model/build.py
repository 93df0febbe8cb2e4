"""A MuJoCo robot built from the skeleton table, so that the model and the table cannot disagree.

Segments become capsules of one density, angles become hinges; a robot that has a model of its own is that
model (`own.py`). Each robot joint is a geared position servo on the first hinge that it moves; further hinges
follow by joint equality couplings. Servo gains are worked out from the model's own inertia, as one tunes a
drive to its load.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import WORLD, Joint, RobotLink, Skeleton
from slave.model import eye
from slave.model.capsules import capsules, links
from slave.model.own import COMPENSATED, ServoGains, compile_own, leader

STEP_S = 0.004
"""Physics step: 31 to a period of the servos' 8 Hz. README.md has what a finer one would change."""

BANDWIDTH_HZ = 8.0
DAMPING_RATIO = math.sqrt(0.5)
"""The damping whose response is a pure delay to second order (s² term 4ζ² - 1 = 2ζ²)."""

_DENSITY_KG_M3 = 900.0
_ROTOR_TO_LOAD = 1.0
"""Rotor inertia seen through the gear, over the heaviest load's: matched, as gears are chosen."""
_LEAST_ARMATURE_KG_M2 = 2e-4
_STOP_RAD = math.radians(3.0)
"""The mechanical stops stand this far outside the table's limits, so that a limit can be reached."""
_HEADROOM = 1.5
"""Torque limit over what worst gravity and the joint's greatest acceleration need together, or over what all
other joints at their greatest accelerations do to it, where that is more: at wrists."""


def build_model(skeleton: Skeleton, step_s: float = STEP_S) -> mujoco.MjModel:
    """The compiled robot. Hinges bear the names of segment angles, actuators those of joints, in order.

    Ranges of hinges are the mechanical stops, ranges of actuators the table's limits.
    """
    bare = _compile(skeleton, [ServoGains(0.0, 0.0, 0.0, 1.0)] * len(skeleton.joints), step_s)
    return _compile(skeleton, _drives(skeleton, bare), step_s)


def _compile(skeleton: Skeleton, drives: Sequence[ServoGains], step_s: float) -> mujoco.MjModel:
    if skeleton.model is not None:
        return compile_own(skeleton, drives, step_s)
    root = ET.Element("mujoco", model=skeleton.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(root, "option", timestep=f"{step_s!r}", integrator="implicitfast")
    ET.SubElement(option, "flag", contact="disable", autoreset="disable")
    world = ET.SubElement(root, "worldbody")
    _surroundings(world, skeleton)
    add_segments(world, skeleton, _hinges(skeleton, drives))
    equality, actuator = ET.SubElement(root, "equality"), ET.SubElement(root, "actuator")
    for joint, drive in zip(skeleton.joints, drives, strict=True):
        _couplings(equality, joint)
        _servo(actuator, joint, drive)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def add_segments(
    world: ET.Element, skeleton: Skeleton, hinges: dict[str, dict[str, str]] | None = None
) -> dict[str, ET.Element]:
    """The segments as bodies, by name; the MJCF attributes of each driven angle's hinge: bare by default."""
    if hinges is None:
        hinges = {angle: {"name": angle} for joint in skeleton.joints for angle in joint.moves}
    bodies = {WORLD: world}
    for i, link in enumerate(links(skeleton)):
        bodies[link.name] = body = _body(bodies[link.parent], link, hinges)
        _add_capsules(body, skeleton, i)
    return bodies


def _surroundings(world: ET.Element, skeleton: Skeleton) -> None:
    ET.SubElement(world, "light", pos="1 0 3", dir="-0.3 0 -1", diffuse="0.8 0.8 0.8")
    ET.SubElement(world, "geom", name="floor", type="plane", size="3 3 0.1", rgba="0.5 0.5 0.5 1")
    for post in skeleton.stand:
        fromto = _text((*post.from_m, *post.to_m))
        ET.SubElement(world, "geom", type="cylinder", fromto=fromto, size=f"{post.radius_m!r}")


def _hinges(skeleton: Skeleton, drives: Sequence[ServoGains]) -> dict[str, dict[str, str]]:
    """MJCF attributes of every driven angle's hinge."""
    hinges = {}
    for joint, drive in zip(skeleton.joints, drives, strict=True):
        for angle, ratio in joint.drives.items():
            stops = sorted((joint.lower_rad * ratio, joint.upper_rad * ratio))
            hinge = {"name": angle, "armature": f"{_LEAST_ARMATURE_KG_M2 / 10!r}"}
            if angle == leader(joint)[0]:
                limit = drive.torque_limit_nm / abs(ratio)
                # only the leader meets a stop: the couplings keep the followers inside theirs
                hinge = {
                    "name": angle,
                    # a joint's inertia and torque are seen at the hinge through the ratio
                    "armature": f"{drive.armature_kg_m2 / ratio**2!r}",
                    "range": f"{stops[0] - _STOP_RAD!r} {stops[1] + _STOP_RAD!r}",
                    "actuatorfrcrange": f"{-limit!r} {limit!r}",
                    "actuatorgravcomp": "true",
                }
            hinges[angle] = hinge
    return hinges


def _body(parent: ET.Element, link: RobotLink, hinges: dict[str, dict[str, str]]) -> ET.Element:
    """A body that hangs on its parent by those of its hinges that a joint moves."""
    body = ET.SubElement(
        parent,
        "body",
        name=link.name,
        pos=_text(link.origin_m),
        quat=_text(link.q_parent_from_link),
        gravcomp=f"{COMPENSATED}",
    )
    for hinge in link.hinges:
        if hinge.name in hinges:
            kind, place = "slide" if hinge.slides else "hinge", _text(hinge.anchor_m)
            ET.SubElement(body, "joint", hinges[hinge.name], type=kind, axis=_text(hinge.axis), pos=place)
    if link.name == eye.LINK:
        at = _text(eye.POSITION_M)
        ET.SubElement(body, "site", name="head", pos=at)
        axes, field = _text((*eye.RIGHT, *eye.UP)), f"{eye.FIELD_DEG!r}"
        ET.SubElement(body, "camera", name=eye.NAME, pos=at, xyaxes=axes, fovy=field)
    return body


def _add_capsules(body: ET.Element, skeleton: Skeleton, index: int) -> None:
    own = [capsule for capsule in capsules(skeleton) if capsule.segment == index]
    if not own:  # MuJoCo moves no body without mass
        ET.SubElement(body, "inertial", pos="0 0 0", mass="0.001", diaginertia="1e-6 1e-6 1e-6")
    for capsule in own:
        ET.SubElement(
            body,
            "geom",
            type="capsule",
            fromto=_text((*capsule.from_m, *capsule.to_m)),
            size=f"{capsule.radius_m!r}",
            density=f"{_DENSITY_KG_M3}",
            rgba="0.85 0.85 0.9 1",
        )


def _couplings(equality: ET.Element, joint: Joint) -> None:
    first, first_ratio = leader(joint)
    for angle, ratio in joint.drives.items():
        if angle != first:
            ET.SubElement(
                equality,
                "joint",
                joint1=angle,
                joint2=first,
                polycoef=f"0 {ratio / first_ratio!r} 0 0 0",
                solref=f"{2.5 * STEP_S} 1",
                solimp="0.99 0.99 0.01",
            )


def _servo(actuator: ET.Element, joint: Joint, drive: ServoGains) -> None:
    angle, ratio = leader(joint)
    ET.SubElement(
        actuator,
        "position",
        name=joint.name,
        joint=angle,
        # the setpoint and the gains are the joint's; the gear takes them to the leading angle
        gear=f"{1.0 / ratio!r}",
        kp=f"{drive.stiffness_nm_rad!r}",
        kv=f"{drive.damping_nm_s_rad!r}",
        ctrlrange=f"{joint.lower_rad!r} {joint.upper_rad!r}",
    )


def _drives(skeleton: Skeleton, model: mujoco.MjModel) -> list[ServoGains]:
    """Servos tuned to the heaviest load of each joint: on a lighter one they are damped the more.

    Their lag behind a ramp is damping / stiffness = 2 ζ / ω, whatever the load.
    """
    inertia, gravity, by_others = _loads(skeleton, model)
    armature = np.maximum(_ROTOR_TO_LOAD * inertia, _LEAST_ARMATURE_KG_M2)
    total = inertia + armature
    omega = 2.0 * math.pi * BANDWIDTH_HZ
    alone = gravity + total * skeleton.max_acceleration_rad_s2
    torque = _HEADROOM * np.maximum(alone, by_others)
    return [
        ServoGains(float(a), float(i * omega**2), float(2.0 * DAMPING_RATIO * omega * i), float(t))
        for a, i, t in zip(armature, total, torque, strict=True)
    ]


def _loads(skeleton: Skeleton, model: mujoco.MjModel) -> tuple[Array, Array, Array]:
    """Greatest inertia, kg m², gravity torque and torque by the other joints' accelerations, N m, (J,) each.

    Over four postures (zero, middle and limits of all ranges), turned any way up. The last is Σ |M_jk| a_k
    over the other joints k, each at the table's greatest acceleration a_k, with the signs that add up: a
    wrist's drive must hold the hand still while the arm behind it speeds up.
    """
    data = mujoco.MjData(model)
    rates = unit_rates(skeleton, model)
    middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
    postures = (skeleton.zero_rad, middle, skeleton.lower_rad, skeleton.upper_rad)
    inertia, by_others = np.empty((2, len(postures), len(middle)))
    torque = np.empty((len(postures), 3, len(middle)))
    products = np.empty((model.nv, len(middle)))
    product = np.empty(model.nv)
    down = model.opt.gravity.copy()
    for i, posture in enumerate(postures):
        data.qpos[:] = posture @ rates
        for k in range(3):
            model.opt.gravity[:] = np.linalg.norm(down) * np.eye(3)[k]
            mujoco.mj_forward(model, data)
            torque[i, k] = rates @ data.qfrc_bias
        for j, rate in enumerate(rates):
            mujoco.mj_mulM(model, data, product, rate)
            products[:, j] = product
        coupling = np.abs(rates @ products)
        inertia[i] = np.diag(coupling)
        by_others[i] = (
            coupling @ skeleton.max_acceleration_rad_s2 - inertia[i] * skeleton.max_acceleration_rad_s2
        )
    model.opt.gravity[:] = down
    # gravity torque is linear in gravity: the norm over three axes is that of the worst direction
    gravity = np.linalg.norm(torque, axis=1).max(axis=0)
    return inertia.max(axis=0), gravity, by_others.max(axis=0)


def unit_rates(skeleton: Skeleton, model: mujoco.MjModel) -> Array:
    """(J, hinges): how every hinge turns for one unit of each joint; `joints @ it` gives qpos."""
    rates = np.zeros((len(skeleton.joints), model.nv))
    for j, joint in enumerate(skeleton.joints):
        for angle, ratio in joint.moves.items():
            rates[j, model.joint(angle).dofadr[0]] = ratio
    return rates


def _text(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(n)) for n in numbers)
