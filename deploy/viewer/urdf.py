"""The robot as URDF: its links, hinges and limits, and its capsules as cylinders with round ends.

URDF has no capsule: each is a cylinder and two spheres. Every shape has a material: viewers draw one without
a material transparent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from common.quaternion import Array, to_matrix
from common.skeleton import Joint, Skeleton
from deploy.viewer.frames import ROOT, FrameEdge, edges
from slave.model.capsules import Capsule, capsules, links

COLOUR = "0.82 0.84 0.88 1"
EFFORT_NM = 1000.0
"""URDF wants a limit; a profile tells none."""


@dataclass(frozen=True, slots=True)
class _Moved:
    """A hinge that a joint of the robot moves."""

    joint: Joint
    ratio: float
    name: str
    """Of the URDF's joint: of the robot's where both are the same quantity, else the hinge's."""
    follows: _Moved | None
    """The joint's first hinge, where this is another."""


def urdf(skeleton: Skeleton) -> str:
    """The robot description. A joint's first hinge bears the joint's name where its ratio is 1."""
    robot = ET.Element("robot", name=skeleton.name)
    ET.SubElement(ET.SubElement(robot, "material", name="body"), "color", rgba=COLOUR)
    ET.SubElement(robot, "link", name=ROOT)
    moved = _moved(skeleton)
    bodies = {link.name: i for i, link in enumerate(links(skeleton))}
    for edge in edges(skeleton):
        link = ET.SubElement(robot, "link", name=edge.child)
        for capsule in capsules(skeleton):
            if bodies.get(edge.child) == capsule.segment:
                _add_capsule(link, capsule)
        _add_joint(robot, edge, None if edge.hinge is None else moved.get(edge.hinge.name))
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode")


def _moved(skeleton: Skeleton) -> dict[str, _Moved]:
    found: dict[str, _Moved] = {}
    for joint in skeleton.joints:
        first: _Moved | None = None
        for hinge, ratio in joint.moves.items():
            name = joint.name if first is None and ratio == 1.0 else hinge
            found[hinge] = _Moved(joint, ratio, name, first)
            first = first or found[hinge]
    return found


def _add_joint(robot: ET.Element, edge: FrameEdge, moved: _Moved | None) -> None:
    hinge = edge.hinge
    if hinge is None or moved is None:
        name = edge.child if hinge is None else hinge.name
        joint = ET.SubElement(robot, "joint", name=f"{name}_fixed", type="fixed")
    else:
        kind = "prismatic" if hinge.slides else "revolute"
        joint = ET.SubElement(robot, "joint", name=moved.name, type=kind)
        ET.SubElement(joint, "axis", xyz=_text(hinge.axis))
        lower, upper = sorted((moved.joint.lower_rad * moved.ratio, moved.joint.upper_rad * moved.ratio))
        speed = moved.joint.max_velocity_rad_s * abs(moved.ratio)
        limits = {"lower": lower, "upper": upper, "velocity": speed, "effort": EFFORT_NM}
        ET.SubElement(joint, "limit", {key: f"{value!r}" for key, value in limits.items()})
        if moved.follows is not None:
            multiplier = moved.ratio / moved.follows.ratio
            ET.SubElement(joint, "mimic", joint=moved.follows.name, multiplier=f"{multiplier!r}")
    ET.SubElement(joint, "parent", link=edge.parent)
    ET.SubElement(joint, "child", link=edge.child)
    ET.SubElement(
        joint, "origin", xyz=_text(edge.translation_m.tolist()), rpy=_text(rpy(edge.q_parent_from_child))
    )


def rpy(q: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation (4,): fixed axes x, y, z, as URDF turns."""
    r = to_matrix(q)
    pitch = float(np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0])))
    if abs(r[2, 0]) > 1.0 - 1e-12:  # roll and yaw turn about one axis: all of it is called yaw
        return 0.0, pitch, float(np.arctan2(-r[0, 1], r[1, 1]))
    return float(np.arctan2(r[2, 1], r[2, 2])), pitch, float(np.arctan2(r[1, 0], r[0, 0]))


def _add_capsule(link: ET.Element, capsule: Capsule) -> None:
    ends = np.array([capsule.from_m, capsule.to_m])
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    radius = f"{capsule.radius_m!r}"
    for end in ends:
        _shape(link, end, (0.0, 0.0, 0.0), "sphere", radius=radius)
    if length > 0.0:
        x, y, z = (along / length).tolist()
        lean = (0.0, float(np.arctan2(np.hypot(x, y), z)), float(np.arctan2(y, x)))
        _shape(link, ends.mean(axis=0), lean, "cylinder", radius=radius, length=f"{length!r}")


def _shape(link: ET.Element, at_m: Array, turned: Sequence[float], kind: str, **size: str) -> None:
    for purpose in ("visual", "collision"):
        shape = ET.SubElement(link, purpose)
        ET.SubElement(shape, "origin", xyz=_text(at_m.tolist()), rpy=_text(turned))
        ET.SubElement(ET.SubElement(shape, "geometry"), kind, size)
        if purpose == "visual":
            ET.SubElement(shape, "material", name="body")


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{float(value)!r}" for value in values)
