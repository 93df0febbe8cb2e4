from importlib import resources

import numpy as np
import pytest

from common.errors import ConfigError
from common.quaternion import rotate
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from common.skeleton.load import parse_skeleton

SKELETON = load_skeleton("nursing")
TEXT = (resources.files("common.skeleton") / "nursing.toml").read_text("utf-8")

ARM = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "elbow_roll", "wrist_yaw"]
SIDES = ("left", "right")
BODY = ["neck_yaw", "neck_pitch", "waist_pitch", *(f"{side}_{joint}" for side in SIDES for joint in ARM)]
FINGERS = [f"{side}_{f}" for side in SIDES for f in ("thumb", "index", "middle", "ring", "little")]


def test_the_nursing_robot_has_36_nodes_and_25_joints() -> None:
    assert len(SKELETON.segments) == 36
    assert list(SKELETON.joint_names) == BODY + FINGERS
    assert len(SKELETON.angle_slots) == 15 + 28


def test_it_is_read_once_and_can_be_a_key() -> None:
    assert load_skeleton("nursing") is load_skeleton("nursing")
    assert {SKELETON: 1}[SKELETON] == 1


def test_parents_stand_before_their_children() -> None:
    assert np.all(SKELETON.parents < np.arange(36))
    assert np.flatnonzero(SKELETON.parents < 0).tolist() == [0]


def test_limits_hold_zero_and_are_in_radians() -> None:
    assert np.all(SKELETON.lower_rad <= 0.0)
    assert np.all(SKELETON.upper_rad > 0.0)
    assert np.all(SKELETON.upper_rad < np.pi)
    assert np.all(SKELETON.max_velocity_rad_s > 1.0)
    assert np.all(SKELETON.max_acceleration_rad_s2 > 10.0)


def test_joints_and_angles_are_inverse() -> None:
    product = SKELETON.joints_from_angles @ SKELETON.angles_from_joints
    assert np.allclose(product, np.eye(25), atol=1e-15)


def test_axis_frames_are_right_handed() -> None:
    assert np.allclose(np.linalg.det(SKELETON.axis_frames), 1.0)
    for segment, frame, hand in zip(
        SKELETON.segments, SKELETON.axis_frames, SKELETON.axis_handedness, strict=True
    ):
        assert np.array_equal(frame[:, :2].T, segment.axes[:2])
        assert np.array_equal(hand * frame[:, 2], segment.axes[2])


def test_a_joint_needs_both_its_nodes_and_no_others() -> None:
    def needs(joint: str) -> set[str]:
        row = SKELETON.joint_needs_node[SKELETON.joint_names.index(joint)]
        return {name for name, needed in zip(SKELETON.segment_names, row, strict=True) if needed}

    assert needs("waist_pitch") == {"chest"}
    assert needs("left_elbow_pitch") == {"left_upper_arm", "left_forearm"}
    fingers = {f"right_index_{phalanx}" for phalanx in ("proximal", "middle", "distal")}
    assert needs("right_index") == fingers | {"right_hand"}


def test_an_unknown_profile_names_those_there_are() -> None:
    with pytest.raises(ConfigError, match=r"profile = 'dancing': expected one of .*nursing"):
        load_skeleton("dancing")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'parent = "chest"',
            'parent = "tail"',
            r"head\.parent = 'tail': expected a segment listed before it",
        ),
        ('name = "head"', 'name = "chest"', r"segment\.name = 'chest': expected a name used once"),
        ('axes = "z y x"', 'axes = "z z x"', r"chest\.axes = .*: expected x, y and z in some order"),
        ("lower_deg = -70.0", "lower_deg = 70.0", r"neck_yaw\.lower_deg = .*: expected a limit below"),
        (
            "left_thumb_ipj = 1.2",
            "left_index_mpj = 1.2",
            r"left_index\.drives = 'left_index_mpj': expected a",
        ),
        (
            "left_thumb_ipj = 1.2",
            "left_thumb_ipj = 0",
            r"left_thumb\.drives = .*: expected at least one angle",
        ),
        ("left_thumb_ipj = 1.2", "tail = 1.2", r"left_thumb\.drives = 'tail': expected a segment's angle"),
    ],
)
def test_a_table_that_contradicts_itself(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(ConfigError, match=f"other.toml: {message}"):
        parse_skeleton(TEXT.replace(old, new, 1), "other.toml")


LEGS = load_skeleton("lower_limb")
LEG = ["hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion", "ankle_flexion"]


def test_the_legs_have_7_nodes_and_10_joints() -> None:
    assert len(LEGS.segments) == 7
    assert list(LEGS.joint_names) == [f"{side}_{joint}" for side in SIDES for joint in LEG]
    assert np.all(LEGS.lower_rad < 0.0)
    assert np.all(LEGS.upper_rad > 0.0)
    knees = [s for s in LEGS.segments if s.name.endswith("shank")]
    assert [knee.human for knee in knees] == [(True, False, False)] * 2


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(
    ("joint", "segment", "of", "towards"),
    [
        ("hip_flexion", "thigh", [0, 0, -1], [1, 0, 0]),
        ("hip_abduction", "thigh", [0, 0, -1], [0, 1, 0]),
        ("hip_rotation", "thigh", [1, 0, 0], [0, -1, 0]),
        ("knee_flexion", "shank", [0, 0, -1], [-1, 0, 0]),
        ("ankle_flexion", "foot", [1, 0, 0], [0, 0, 1]),
    ],
)
def test_legs_turn_as_anatomy_counts(
    side: str, joint: str, segment: str, of: list[int], towards: list[int]
) -> None:
    """The thigh swings ahead and outwards, the toes turn in and up, the shank swings back: left as right."""
    mirror = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
    position = np.zeros(10)
    position[LEGS.joint_names.index(f"{side}_{joint}")] = 0.1
    q = orientations(LEGS, position)[LEGS.segment_names.index(f"{side}_{segment}")]
    moved = mirror * rotate(q, mirror * np.array(of, dtype=float)) - of
    np.testing.assert_allclose(moved @ towards, np.sin(0.1), atol=1e-12)
