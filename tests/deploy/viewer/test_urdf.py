"""The URDF and the frames stand where the profile's own kinematics stand; read by MuJoCo, not by tandem."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

from common.quaternion import Array, multiply, rotate
from common.skeleton import WORLD, Skeleton, load_skeleton
from common.skeleton.links import hinge_values, place_links
from deploy.viewer.frames import transforms
from deploy.viewer.urdf import rpy, urdf
from slave.model.capsules import capsules, links

PROFILES = ("nursing", "hand", "lower_limb")


def posture(skeleton: Skeleton, seed: int) -> Array:
    return np.random.default_rng(seed).uniform(skeleton.lower_rad, skeleton.upper_rad)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", PROFILES)
def test_the_frames_stand_where_the_links_stand(name: str, seed: int) -> None:
    skeleton = load_skeleton(name)
    position_rad = posture(skeleton, seed)
    expected = place_links(links(skeleton), hinge_values(skeleton.joints, position_rad))
    found = {WORLD: (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))}
    for edge, translation_m, q in transforms(skeleton, position_rad):
        origin, q_parent = found[edge.parent]
        found[edge.child] = origin + rotate(q_parent, translation_m), multiply(q_parent, q)
    for link, (origin, q) in expected.items():
        np.testing.assert_allclose(found[link][0], origin, atol=1e-12)
        assert abs(found[link][1] @ q) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", PROFILES)
def test_mujoco_reads_the_urdf_and_stands_alike(name: str) -> None:
    skeleton = load_skeleton(name)
    root = ET.fromstring(urdf(skeleton))
    # MuJoCo welds fixed links into their parents unless it is told, and wants masses
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false", discardvisual="true")
    for body in root.iter("link"):
        inertial = ET.SubElement(body, "inertial")
        ET.SubElement(inertial, "mass", value="1")
        ET.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    position_rad = posture(skeleton, 5)
    values = hinge_values(skeleton.joints, position_rad)
    named = {joint.name: float(p) for joint, p in zip(skeleton.joints, position_rad, strict=True)}
    for number in range(model.njnt):
        joint = model.joint(number).name
        data.qpos[model.jnt_qposadr[number]] = named[joint] if joint in named else float(values[joint])
    mujoco.mj_kinematics(model, data)
    for link, (origin, q) in place_links(links(skeleton), values).items():
        if link != WORLD:
            stands = data.body(link)
            np.testing.assert_allclose(stands.xpos, origin, atol=1e-9)
            assert abs(stands.xquat @ q) == pytest.approx(1.0, abs=1e-9)
    assert model.ngeom == 3 * len([c for c in capsules(skeleton) if c.from_m != c.to_m])


def test_every_shape_has_a_material_and_every_follower_its_leader() -> None:
    skeleton = load_skeleton("nursing")
    root = ET.fromstring(urdf(skeleton))
    assert all(visual.find("material") is not None for visual in root.iter("visual"))
    joints = {joint.get("name") for joint in root.iter("joint")}
    assert set(skeleton.joint_names) <= joints
    mimics = {mimic.get("joint"): mimic.get("multiplier") for mimic in root.iter("mimic")}
    assert set(mimics) <= joints
    assert mimics["left_thumb"] == "1.2"


@pytest.mark.parametrize(
    "q", [(1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, -0.5), (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)]
)
def test_roll_pitch_yaw_turn_as_the_quaternion_does(q: tuple[float, ...]) -> None:
    roll, pitch, yaw = rpy(np.array(q))
    turned = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
    turned = multiply(turned, np.array([np.cos(pitch / 2), 0, np.sin(pitch / 2), 0]))
    turned = multiply(turned, np.array([np.cos(roll / 2), np.sin(roll / 2), 0, 0]))
    assert abs(turned @ np.array(q)) == pytest.approx(1.0, abs=1e-9)


def test_an_imported_robot_with_anchors_and_slides(tmp_path: Path) -> None:
    """A link with a hinge off its origin, a slide, and a second hinge."""
    from common.skeleton import RobotHinge, RobotLink
    from deploy.viewer import frames

    link = RobotLink(
        "arm", WORLD, (0.1, 0.2, 0.3), (0.8, 0.6, 0.0, 0.0),
        (RobotHinge("a", (0.0, 0.0, 1.0), (0.05, 0.0, 0.02)), RobotHinge("s", (1.0, 0.0, 0.0), slides=True),
         RobotHinge("b", (0.0, 1.0, 0.0), (0.0, 0.1, 0.0))),
    )  # fmt: skip
    values = {"a": np.array(0.7), "s": np.array(0.04), "b": np.array(-0.4)}
    origin, q = place_links((link,), values)["arm"]
    at, turned = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for edge in frames._of_link(link):
        translation_m, q_edge = edge.placed(values)
        at, turned = at + rotate(turned, translation_m), multiply(turned, q_edge)
    np.testing.assert_allclose(at, origin, atol=1e-12)
    assert abs(turned @ q) == pytest.approx(1.0, abs=1e-12)
