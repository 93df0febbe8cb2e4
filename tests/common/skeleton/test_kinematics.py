import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import Array, heading_turn, multiply, rotate
from common.skeleton import WORLD, load_skeleton
from common.skeleton.kinematics import orientations, origins
from common.skeleton.load import parse_skeleton

SKELETON = load_skeleton("nursing")
SEGMENT = {name: i for i, name in enumerate(SKELETON.segment_names)}
ZERO = np.zeros(len(SKELETON.joints))

AHEAD, BACK = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
LEFT, RIGHT = np.array([0.0, 1.0, 0.0]), np.array([0.0, -1.0, 0.0])
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])


def posed(**angles_deg: float) -> Array:
    position = ZERO.copy()
    for joint, angle in angles_deg.items():
        position[SKELETON.joint_names.index(joint)] = np.radians(angle)
    return position


def moved_m(segment: str, **angles_deg: float) -> Array:
    """How far that segment's joint moves from the zero pose."""
    at = SEGMENT[segment]
    here: Array = origins(SKELETON, orientations(SKELETON, posed(**angles_deg)))[at]
    there: Array = origins(SKELETON, orientations(SKELETON, ZERO))[at]
    return here - there


def pointing(segment: str, along: Array, **angles_deg: float) -> Array:
    """Where a direction of that segment points."""
    return rotate(orientations(SKELETON, posed(**angles_deg))[SEGMENT[segment]], along)


def by_scipy(position: Array, heading: float) -> tuple[list[Rotation], list[Array]]:
    """One segment after the other, one axis after the other."""
    angles = (SKELETON.angles_from_joints @ position).reshape(-1, 3)
    turns: dict[str, Rotation] = {WORLD: Rotation.from_rotvec([0.0, 0.0, heading])}
    places: dict[str, Array] = {}
    for segment, three in zip(SKELETON.segments, angles, strict=True):
        turn = turns[segment.parent]
        origin = np.array(segment.origin_m)
        if segment.parent == WORLD:
            places[segment.name] = origin
        else:
            places[segment.name] = places[segment.parent] + turn.apply(origin)
        for axis, angle in zip(segment.axes, three, strict=True):
            turn = turn * Rotation.from_rotvec(np.array(axis) * angle)
        turns[segment.name] = turn
    return [turns[name] for name in SEGMENT], [places[name] for name in SEGMENT]


def test_agrees_with_the_tree_walked_by_scipy() -> None:
    rng = np.random.default_rng(0)
    positions = rng.uniform(SKELETON.lower_rad, SKELETON.upper_rad, (10, len(ZERO)))
    headings = rng.uniform(-np.pi, np.pi, 10)
    q = orientations(SKELETON, positions, headings)
    places = origins(SKELETON, q)
    assert q.shape == (10, 36, 4)
    assert places.shape == (10, 36, 3)
    for row, (position, heading) in enumerate(zip(positions, headings, strict=True)):
        turns, expected_m = by_scipy(position, heading)
        found = Rotation.from_quat(q[row], scalar_first=True)
        assert np.max((found.inv() * Rotation.concatenate(turns)).magnitude()) < 1e-14
        assert np.allclose(places[row], expected_m, atol=1e-14)


def test_zero_pose_aligns_every_segment_with_the_world() -> None:
    assert np.array_equal(orientations(SKELETON, ZERO), np.tile([1.0, 0.0, 0.0, 0.0], (36, 1)))


def test_leading_axes_and_headings_broadcast() -> None:
    one = posed(left_elbow_pitch=40.0)
    headings = np.array([[0.3], [-2.0]])
    many = orientations(SKELETON, np.tile(one, (5, 1)), headings)
    assert many.shape == (2, 5, 36, 4)
    turned = multiply(heading_turn(-2.0), orientations(SKELETON, one))
    assert np.allclose(many[1, 3], turned, atol=1e-15)
    assert orientations(SKELETON, one, np.array([0.1, 0.2])).shape == (2, 36, 4)


@pytest.mark.parametrize("side", ["left", "right"])
def test_signs_of_the_arm_joints(side: str) -> None:
    outward, inward = (LEFT, RIGHT) if side == "left" else (RIGHT, LEFT)
    assert moved_m(f"{side}_hand", **{f"{side}_elbow_pitch": 20.0}) @ AHEAD > 0.05
    assert moved_m(f"{side}_hand", **{f"{side}_shoulder_pitch": 20.0}) @ AHEAD > 0.1
    assert moved_m(f"{side}_hand", **{f"{side}_shoulder_roll": 20.0}) @ outward > 0.1
    # with the elbow bent, yaw and roll swing the hand
    swung = {f"{side}_elbow_pitch": 90.0, f"{side}_shoulder_yaw": 20.0}
    straight = {f"{side}_elbow_pitch": 90.0}
    assert abs((moved_m(f"{side}_hand", **swung) - moved_m(f"{side}_hand", **straight)) @ inward) > 0.05


def test_signs_are_mirrored_left_and_right() -> None:
    rng = np.random.default_rng(1)
    mirror = np.array([1.0, -1.0, 1.0])
    position = rng.uniform(SKELETON.lower_rad, SKELETON.upper_rad)
    position[[SKELETON.joint_names.index("neck_yaw")]] = 0.0
    swapped = position.copy()
    for i, name in enumerate(SKELETON.joint_names):
        other = name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        swapped[i] = position[SKELETON.joint_names.index(other)]
    places = origins(SKELETON, orientations(SKELETON, position))
    mirrored = origins(SKELETON, orientations(SKELETON, swapped))
    for name, i in SEGMENT.items():
        other = name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        assert np.allclose(places[i], mirror * mirrored[SEGMENT[other]], atol=1e-12), name


def test_signs_of_waist_and_neck() -> None:
    assert moved_m("head", waist_pitch=20.0) @ AHEAD > 0.1
    assert pointing("head", UP, neck_pitch=20.0) @ AHEAD > 0.3
    assert pointing("head", AHEAD, neck_yaw=20.0) @ LEFT > 0.3


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("finger", ["index", "middle", "ring", "little"])
def test_fingers_curl_toward_the_palm(side: str, finger: str) -> None:
    # the palm faces the thigh
    palm = RIGHT if side == "left" else LEFT
    assert pointing(f"{side}_{finger}_proximal", DOWN, **{f"{side}_{finger}": 30.0}) @ palm > 0.4
    assert moved_m(f"{side}_{finger}_distal", **{f"{side}_{finger}": 30.0}) @ palm > 0.02


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_thumb_closes_over_the_palm(side: str) -> None:
    palm = RIGHT if side == "left" else LEFT
    assert pointing(f"{side}_thumb_proximal", AHEAD, **{f"{side}_thumb": 30.0}) @ palm > 0.4


def test_a_tree_that_is_not_a_chain_of_depth_a_power_of_two() -> None:
    table = 'name = "chain"\njoint = []\n' + "".join(
        f'[[segment]]\nname = "s{i}"\nparent = "{"world" if i == 0 else f"s{i - 1}"}"\n'
        f'axes = "z y x"\nangles = "_ a{i} _"\norigin_m = [1.0, 0.0, 0.0]\nnode_m = [0.0, 0.0, 0.0]\n'
        for i in range(5)
    )
    joints = "".join(
        f'[[joint]]\nname = "a{i}"\nlower_deg = -9\nupper_deg = 9\n'
        "max_velocity_deg_s = 1\nmax_acceleration_deg_s2 = 1\n"
        for i in range(5)
    )
    chain = parse_skeleton(table.replace("joint = []\n", "") + joints, "chain.toml")
    q = orientations(chain, np.radians([10.0, 20.0, 30.0, 40.0, 50.0]))
    total = 2.0 * np.degrees(np.arctan2(q[:, 2], q[:, 0]))
    assert np.allclose(total, [10.0, 30.0, 60.0, 100.0, 150.0])
