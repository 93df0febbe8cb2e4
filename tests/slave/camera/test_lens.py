"""A camera's calibration: read, checked against robot and picture, and told by the slave in shares."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from common.errors import ConfigError
from common.metrics.lens import Lens
from common.metrics.tree import from_tree, to_tree
from common.quaternion import rotate
from common.skeleton import load_skeleton
from slave.camera.lens import eye
from slave.model import eye as place
from tests.slave.camera.test_cameras import slave

GOOD = """
[camera]
source = "v4l2"
width = 640
height = 480
[camera.calibration]
size = [1280, 960]
fx = 1000.0
fy = 1001.0
cx = 640.0
cy = 500.0
k1 = -0.1
link = "head"
position_m = [0.09, 0.0, 0.1]
q_link_from_camera = [0.5, -0.5, 0.5, -0.5]
"""


def test_a_real_cameras_calibration_is_told_in_shares_of_the_picture() -> None:
    config = slave(GOOD)
    lens = config.camera.all[0].lens(config.skeleton)
    assert lens is not None
    assert lens.focal == (1000.0 / 1280.0, 1001.0 / 960.0)
    assert lens.centre == (0.5, 500.0 / 960.0)
    assert lens.radial == (-0.1, 0.0)
    assert lens.link == "head"
    assert from_tree(Lens, to_tree(lens)) == lens


def test_without_one_nothing_is_known_of_a_real_camera_and_all_of_a_simulated_eye() -> None:
    skeleton = load_skeleton("nursing")
    bare = slave('[camera]\nsource = "v4l2"\n').camera.all[0]
    assert bare.lens(skeleton) is None
    lens = slave('[camera]\nsource = "robot"\n').camera.all[0].lens(skeleton)
    assert lens is not None
    assert lens.focal[1] == pytest.approx(0.5 / math.tan(math.radians(35.0)))
    assert lens.focal[0] == pytest.approx(lens.focal[1] * 240 / 320)


def test_the_eyes_two_descriptions_are_one() -> None:
    right, down, ahead = (rotate(np.array(place.Q_LINK_FROM_CAMERA), axis) for axis in np.eye(3))
    np.testing.assert_allclose(right, place.RIGHT, atol=1e-12)
    np.testing.assert_allclose(down, -np.array(place.UP), atol=1e-12)
    np.testing.assert_allclose(ahead, [1.0, 0.0, 0.0], atol=1e-12)


def test_a_camera_that_shows_the_whole_robot_has_no_eye() -> None:
    skeleton = load_skeleton("nursing")
    assert eye(skeleton, "room", 320, 240) is None
    headless = tuple(replace(s, name=s.name.replace("head", "skull")) for s in skeleton.segments)
    assert eye(replace(skeleton, segments=headless), "head", 320, 240) is None


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('link = "head"', 'link = "haed"', r"camera\.calibration\.link = 'haed'.*head"),
        ("[0.5, -0.5, 0.5, -0.5]", "[0.5, -0.5, 0.5, 0.0]", r"q_link_from_camera .*length 1"),
        ("size = [1280, 960]", "size = [1280, 720]", r"calibration\.size .*640 × 480"),
        ("fx = 1000.0\n", "", r"camera.*calibration\.fx"),
        ("fy = 1001.0", "fy = 0.0", r"calibration\.fy"),
        ('source = "v4l2"', 'source = "robot"', r"calibration.*own eye is known"),
    ],
)
def test_a_mistake_is_named(before: str, after: str, said: str) -> None:
    assert before in GOOD
    with pytest.raises(ConfigError, match=said):
        slave(GOOD.replace(before, after))
