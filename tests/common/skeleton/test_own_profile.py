"""A profile of one's own: its file lies anywhere; its links, hinges and segments must fit together."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError
from common.quaternion import angle_between, multiply, rotate
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from common.skeleton.links import hinge_values, place_links
from common.skeleton.load import parse_skeleton
from slave.config import SlaveConfig

ARM = """
name = "bent"
model = "robot.xml"
[[segment]]
name = "chest"
parent = "world"
origin_m = [0.0, 0.0, 1.0]
node_m = [0.0, 0.0, 0.1]
link = "column"
[[segment]]
name = "arm"
parent = "chest"
origin_m = [0.0, 0.2, 0.0]
node_m = [0.0, 0.0, -0.1]
link = "upper"
[[joint]]
name = "one"
lower_deg = -100.0
upper_deg = 100.0
max_velocity_deg_s = 100.0
max_acceleration_deg_s2 = 1000.0
zero_deg = 30.0
[[joint]]
name = "two"
lower_deg = -100.0
upper_deg = 100.0
max_velocity_deg_s = 100.0
max_acceleration_deg_s2 = 1000.0
zero_deg = -50.0
[[link]]
name = "column"
parent = "world"
origin_m = [0.0, 0.0, 1.0]
q_parent_from_link = [0.9, 0.1, 0.3, 0.2]
[[link]]
name = "shoulder"
parent = "column"
origin_m = [0.0, 0.2, 0.0]
hinges = [{ name = "one", axis = [0.0, 0.6, 0.8], anchor_m = [0.1, 0.0, 0.0] }]
[[link]]
name = "upper"
parent = "shoulder"
origin_m = [0.0, 0.0, 0.1]
q_parent_from_link = [0.5, 0.5, 0.5, 0.5]
hinges = [{ name = "two", axis = [1.0, 0.0, 0.0] }]
bars = [{ from_m = [0.0, 0.0, 0.0], to_m = [0.0, 0.0, 0.2], radius_m = 0.05 }]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/robot.toml").write_text(ARM, "utf-8")
    (tmp_path / "mine/robot.xml").write_text("<mujoco/>", "utf-8")
    return tmp_path


def test_a_file_names_a_profile_beside_itself(folder: Path) -> None:
    (folder / "slave.toml").write_text(
        'robot = "r"\nprofile = "mine"\nlink = { listen = ["tcp/127.0.0.1:1"] }\n', "utf-8"
    )
    config = load_config(folder / "slave.toml", SlaveConfig)
    assert config.skeleton.joint_names == ("one", "two")
    assert config.skeleton.model == folder / "mine/robot.xml"
    assert load_skeleton(str(folder / "mine/robot.toml")).segment_names == ("chest", "arm")


def test_a_profile_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml: file = .*expected a readable file"):
        load_skeleton(str(tmp_path / "nowhere.toml"))


def test_in_the_zero_pose_every_segment_is_aligned_with_the_body(folder: Path) -> None:
    skeleton = load_skeleton(str(folder / "mine"))
    np.testing.assert_allclose(orientations(skeleton, skeleton.zero_rad), [[1.0, 0, 0, 0]] * 2, atol=1e-12)


def test_a_segment_turns_as_its_link_does(folder: Path) -> None:
    """Seen from the zero pose, and whatever frames the links have."""
    skeleton = load_skeleton(str(folder / "mine"))
    courses = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 2))
    placed = place_links(skeleton.own_links, hinge_values(skeleton.joints, courses))["upper"][1]
    zero = place_links(skeleton.own_links, hinge_values(skeleton.joints, skeleton.zero_rad))["upper"][1]
    turned = multiply(placed, zero * [1.0, -1.0, -1.0, -1.0])
    np.testing.assert_allclose(angle_between(orientations(skeleton, courses)[:, 1], turned), 0.0, atol=1e-7)


def test_a_hinge_turns_its_link_about_its_anchor(folder: Path) -> None:
    skeleton = load_skeleton(str(folder / "mine"))
    values = {"one": np.linspace(-1.0, 1.0, 5)}
    origin, q = place_links(skeleton.own_links, values)["shoulder"]
    np.testing.assert_allclose(np.ptp(origin + rotate(q, np.array([0.1, 0.0, 0.0])), axis=0), 0.0, atol=1e-12)
    assert np.ptp(origin, axis=0).max() > 0.05


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('link = "upper"', 'link = "hand"', r"arm\.link = 'hand': expected one of column, shoulder"),
        (
            'parent = "shoulder"',
            'parent = "elbow"',
            r"link\.upper\.parent = 'elbow': expected each",
        ),
        (
            'name = "two", axis',
            'name = "one", axis',
            r"link\.upper\.hinges = 'one': expected a name",
        ),
        ("axis = [1.0, 0.0, 0.0]", "axis = [0.0, 0.0, 0.0]", r"an axis that is not 0"),
        (
            'name = "two"\nlower',
            'name = "three"\nlower',
            r"three\.hinges = 'three': expected a hinge",
        ),
        (
            "zero_deg = 30.0",
            "hinges = { two = 1.0 }",
            r"joint\.hinges = 'two': expected a hinge",
        ),
        ("zero_deg = 30.0", "zero = 30.0", r"joint\.0\.zero = 30\.0: expected no such key"),
        ('model = "robot.xml"', 'model = "lost.xml"', r"model = .*lost\.xml': expected a file there"),
    ],
)
def test_a_table_whose_parts_do_not_fit(folder: Path, old: str, new: str, message: str) -> None:
    assert old in ARM
    (folder / "mine/robot.toml").write_text(ARM.replace(old, new, 1), "utf-8")
    load_skeleton.cache_clear()
    with pytest.raises(ConfigError) as caught:
        load_skeleton(str(folder / "mine"))
    assert re.search(message, str(caught.value)), caught.value


def test_a_joint_that_nobody_follows_is_to_be_left_out(folder: Path) -> None:
    text = ARM.replace('link = "upper"', 'link = "shoulder"').replace(
        'model = "robot.xml"', f'model = "{folder}/mine/robot.xml"'
    )
    with pytest.raises(ConfigError, match=r"two\.drives = {}: .*leave the joint out"):
        parse_skeleton(text, "robot.toml")
