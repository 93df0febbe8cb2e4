"""Single cases of what the robot is told: at the limits, past the poles, after a loss, and what it costs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

from common.quaternion import Array, from_rotation_vector, multiply
from common.reach import choice, follower
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from common.skeleton.load import parse_skeleton
from master.joint_angles.decomposition import JointAngles
from master.joint_angles.solver import JointSolver

from .human import body_rates, in_world, relative

SKELETON = load_skeleton("nursing")
NAMES, SEGMENTS = SKELETON.joint_names, SKELETON.segment_names
STILL = np.zeros((len(SEGMENTS), 3))
DT_S = 0.08


def angles_of(segment: str, deg: Array) -> Array:
    """Angles (T, N, 3) rad: one segment's (T, 3) about its axes, the others at zero."""
    out = np.zeros((len(deg), len(SEGMENTS), 3))
    out[:, SEGMENTS.index(segment)] = np.radians(deg)
    return out


def told(angle_rad: Array, solver: JointSolver | None = None) -> tuple[dict[str, Array], dict[str, Array]]:
    """Positions (T,) in degrees and velocities in °/s by joint."""
    q = in_world(SKELETON, relative(SKELETON, angle_rad))
    rate = body_rates(q, DT_S)
    solver = solver or JointSolver(SKELETON)
    rows = np.degrees([solver.solve(*row, DT_S) for row in zip(q, rate, strict=True)])
    return dict(zip(NAMES, rows[:, 0].T, strict=True)), dict(zip(NAMES, rows[:, 1].T, strict=True))


def there_and_back(angle_deg: float) -> Array:
    corners_s = [0.0, 1.0, 3.0, 5.0, 7.0, 8.0]
    angles: Array = np.interp(np.arange(0.0, 8.0, DT_S), corners_s, [0, 0, angle_deg, angle_deg, 0, 0])
    return angles


def steps(position_deg: dict[str, Array]) -> float:
    return max(float(np.abs(np.diff(each)).max()) for each in position_deg.values())


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("noise_deg", [0.0, 0.5])
@pytest.mark.parametrize("to_deg", [120.0, 180.0])
def test_an_arm_raised_sideways_stays_at_its_end_of_range(side: str, noise_deg: float, to_deg: float) -> None:
    raised = there_and_back(to_deg)
    arm = np.stack([0.0 * raised, raised, 0.0 * raised], axis=1)
    arm += np.random.default_rng(1).normal(0.0, noise_deg, arm.shape)
    position, _ = told(angles_of(f"{side}_upper_arm", arm))
    roll, pitch, yaw = (position[f"{side}_shoulder_{which}"] for which in ("roll", "pitch", "yaw"))
    np.testing.assert_allclose(roll, np.minimum(raised, 80.0), atol=5.0 * noise_deg + 1e-9)
    assert max(np.abs(pitch).max(), np.abs(yaw).max()) <= 5.0 * noise_deg + 1e-9
    assert steps(position) < 1.5 * (np.abs(np.diff(raised)).max() + 4.0 * noise_deg) + 2.0


@pytest.mark.parametrize("to_deg", [160.0, 178.0, 182.0, 185.0, 200.0])
def test_an_arm_raised_ahead_past_overhead_stays_up(to_deg: float) -> None:
    raised = there_and_back(to_deg)
    position, _ = told(angles_of("left_upper_arm", np.stack([raised, 0 * raised, 0 * raised], axis=1)))
    np.testing.assert_allclose(position["left_shoulder_pitch"], np.minimum(raised, 150.0), atol=1e-9)
    # what the shoulder cannot do the elbow does not do for it
    np.testing.assert_allclose(position["left_elbow_pitch"], 0.0, atol=1e-9)


@pytest.mark.parametrize("across_deg", [0.0, 0.5, 1.0, 2.0, 5.0])
@pytest.mark.parametrize("frequency_hz", [1.0, 4.0, 6.0])
def test_tremor_beside_the_pole_gets_at_most_three_times_its_speed(
    across_deg: float, frequency_hz: float
) -> None:
    """Sideways at 88°, ±3° up and down and some across, so that the pole is passed at any distance."""
    t = np.arange(0.0, 10.0, DT_S)
    up = 88.0 + 3.0 * np.sin(2.0 * np.pi * frequency_hz * t)
    across = across_deg * np.sin(2.0 * np.pi * 1.07 * frequency_hz * t + 1.0)
    arm = relative(SKELETON, angles_of("left_upper_arm", np.stack([0 * t, up, 0 * t], axis=1)))
    row = SEGMENTS.index("left_upper_arm")
    # across: about the vertical of the body, which pitch and yaw can only make together, and late
    arm[:, row] = multiply(from_rotation_vector(np.radians(across)[:, None] * [0.0, 0.0, 1.0]), arm[:, row])
    q = in_world(SKELETON, arm)
    rate = body_rates(q, DT_S)
    solver = JointSolver(SKELETON)
    position, velocity = np.array([solver.solve(*each, DT_S) for each in zip(q, rate, strict=True)]).swapaxes(
        0, 1
    )
    fastest = np.linalg.norm(rate[:, row], axis=-1)
    shoulder = [NAMES.index(f"left_shoulder_{which}") for which in ("pitch", "roll", "yaw")]
    assert np.all(np.abs(velocity[:, shoulder]) <= 3.0 * fastest[:, None] + 1e-9)
    assert np.abs(np.diff(position[:, shoulder], axis=0)).max() <= 3.0 * fastest.max() * DT_S + 1e-9


@pytest.mark.parametrize("beside_deg", [-1.5, -0.5, 0.5, 1.5])
def test_an_arm_that_passes_beside_the_pole_is_not_flung_about(beside_deg: float) -> None:
    raised = there_and_back(120.0)
    arm = relative(SKELETON, angles_of("left_upper_arm", np.stack([0 * raised, raised, 0 * raised], axis=1)))
    row = SEGMENTS.index("left_upper_arm")
    aside = from_rotation_vector(np.radians(beside_deg) * np.array([0.0, 0.0, 1.0]))
    arm[:, row] = multiply(aside, arm[:, row])
    q = in_world(SKELETON, arm)
    rate, solver = body_rates(q, DT_S), JointSolver(SKELETON)
    rows = np.degrees([solver.solve(*each, DT_S) for each in zip(q, rate, strict=True)])
    pitch = NAMES.index("left_shoulder_pitch")
    # within the limits, at 80°, that is what the posture asks for
    most = abs(beside_deg) / np.cos(np.radians(80.0)) + 1.0
    assert np.abs(rows[:, 0, [pitch, pitch + 2]]).max() <= most
    assert np.abs(rows[:, 1, [pitch, pitch + 2]]).max() <= 60.0


def test_what_the_robot_cannot_follow_is_said_in_degrees() -> None:
    solver = JointSolver(SKELETON)
    for deg, short_deg in ((70.0, 0.0), (90.0, 10.0), (120.0, 40.0)):
        told(angles_of("left_upper_arm", np.tile([0.0, deg, 0.0], (40, 1))), solver)
        short = dict(zip(SEGMENTS, np.degrees(solver.short_rad), strict=True))
        assert short.pop("left_upper_arm") == pytest.approx(short_deg, abs=1e-6)
        np.testing.assert_allclose(list(short.values()), 0.0, atol=1e-6)


def test_a_wrist_bent_far_is_followed_about_the_robot_s_axis() -> None:
    """The decomposition has a pole where the hand is bent by 90°; the nearest posture does not."""
    bent = np.linspace(-100.0, 100.0, 80)
    position, _ = told(angles_of("left_hand", np.stack([np.full(80, 20.0), bent, 0 * bent], axis=1)))
    assert steps(position) < 3.0
    assert np.all(np.abs(position["left_wrist_yaw"]) < 30.0)


def test_bending_past_a_right_angle_does_not_raise_the_trunk() -> None:
    bent = there_and_back(130.0)
    position, _ = told(angles_of("chest", np.stack([np.full(len(bent), 40.0), bent, 0 * bent], axis=1)))
    np.testing.assert_allclose(position["waist_pitch"], np.minimum(bent, 60.0), atol=1e-9)


def test_a_lost_node_begins_anew_and_touches_no_other_joint() -> None:
    """At 120° sideways, the arm turned in: from below the arm stays there, from nowhere it is nearest."""
    raised = np.stack([np.zeros(40), np.linspace(0.0, 120.0, 40), np.full(40, 45.0)], axis=1)
    angle = angles_of("left_upper_arm", raised)
    angle[:, SEGMENTS.index("right_upper_arm")] = np.radians(raised[:1])
    q = in_world(SKELETON, relative(SKELETON, angle))
    rate, solver = body_rates(q, DT_S), JointSolver(SKELETON)
    for each in zip(q, rate, strict=True):
        before, _ = solver.solve(*each, DT_S)
    lost = q[-1].copy()
    lost[SEGMENTS.index("left_upper_arm")] = np.nan
    without, _ = solver.solve(lost, STILL, DT_S)
    hit = SKELETON.joint_needs_node[:, SEGMENTS.index("left_upper_arm")]
    assert np.isnan(without[hit]).all()
    np.testing.assert_array_equal(without[~hit], before[~hit])
    found, velocity = solver.solve(q[-1], STILL, DT_S)
    fresh, _ = JointSolver(SKELETON).solve(q[-1], STILL)
    np.testing.assert_array_equal(found, fresh)
    assert np.isfinite(velocity).all()


@pytest.mark.parametrize("elapsed_s", [0.0, -1.0, 0.51, 100.0, np.inf])
def test_after_a_long_gap_or_a_clock_set_back_nothing_is_remembered(elapsed_s: float) -> None:
    solver = JointSolver(SKELETON)
    q = orientations(SKELETON, np.zeros(len(NAMES)))
    solver.solve(q, STILL)
    far = orientations(SKELETON, SKELETON.upper_rad)
    np.testing.assert_allclose(solver.solve(far, STILL, elapsed_s)[0], SKELETON.upper_rad, atol=1e-9)


def test_within_the_limits_it_says_what_the_decomposition_says() -> None:
    """To the last posture's neighbourhood everything: these are far apart, so each is begun anew."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        position = SKELETON.lower_rad + rng.uniform(size=len(NAMES)) * (
            SKELETON.upper_rad - SKELETON.lower_rad
        )
        position[NAMES.index("left_shoulder_roll")] *= 0.8
        position[NAMES.index("right_shoulder_roll")] *= 0.8
        q = orientations(SKELETON, position, rng.uniform(-3.0, 3.0))
        rate = rng.normal(size=(len(SEGMENTS), 3))
        reference, reference_rate = JointAngles(SKELETON).solve(q, rate)
        found, velocity = JointSolver(SKELETON).solve(q, rate)
        np.testing.assert_allclose(found, reference, atol=1e-9)
        # a rate about axes that a joint lacks counts otherwise: the nearest posture is not the decomposition
        whole = [j for j, name in enumerate(NAMES) if "shoulder" in name]
        np.testing.assert_allclose(velocity[whole], reference_rate[whole], rtol=1e-6, atol=1e-6)


def test_another_robot_s_axes_and_ratios_come_from_its_table() -> None:
    """Yaw, roll, pitch with a roll that goes past the pole, one joint geared down and one turned round."""
    text = """
    name = "other"
    segment = [
      { name = "trunk", parent = "world", axes = "z y x", angles = "_ _ _", origin_m = [0, 0, 1], node_m = [0, 0, 0.1] },
      { name = "arm", parent = "trunk", axes = "-z x -y", angles = "yaw roll pitch", origin_m = [0, 0, 0], node_m = [0, 0, 0] },
      { name = "hand", parent = "arm", axes = "x -y z", angles = "_ bend twist", origin_m = [0, 0, 0], node_m = [0, 0, 0] },
    ]
    joint = [
      { name = "pitch", lower_deg = -200.0, upper_deg = 100.0, max_velocity_deg_s = 100.0, max_acceleration_deg_s2 = 100.0 },
      { name = "geared", lower_deg = -60.0, upper_deg = 280.0, max_velocity_deg_s = 100.0, max_acceleration_deg_s2 = 100.0, drives = { roll = 0.5 } },
      { name = "yaw", lower_deg = -170.0, upper_deg = 170.0, max_velocity_deg_s = 100.0, max_acceleration_deg_s2 = 100.0 },
      { name = "bend", lower_deg = -30.0, upper_deg = 90.0, max_velocity_deg_s = 100.0, max_acceleration_deg_s2 = 100.0, drives = { bend = -1.0 } },
      { name = "twist", lower_deg = -30.0, upper_deg = 90.0, max_velocity_deg_s = 100.0, max_acceleration_deg_s2 = 100.0 },
    ]
    """  # noqa: E501
    other = parse_skeleton(text, "other.toml")
    rng = np.random.default_rng(3)
    for _ in range(100):
        position = rng.uniform(other.lower_rad, other.upper_rad)
        position[1] = np.radians(rng.uniform(-60.0, 130.0))  # on the side of the pole where all begin
        found, _ = JointSolver(other).solve(orientations(other, position, 1.0), np.zeros((3, 3)))
        q, again = orientations(other, position), orientations(other, found)
        np.testing.assert_allclose(np.abs(np.sum(q * again, axis=-1)), 1.0, atol=1e-12)
        np.testing.assert_allclose(found[3:], position[3:], atol=1e-9)
    # straight over the pole: the roll is kept and goes on
    solver = JointSolver(other)
    for roll_deg in np.arange(0.0, 270.0, 2.0):
        position = np.radians([10.0, roll_deg, 20.0, 0.0, 0.0])
        found, _ = solver.solve(orientations(other, position), np.zeros((3, 3)))
    np.testing.assert_allclose(np.degrees(found), np.degrees(position), atol=1.0)


def arms_stay() -> None:
    for beside_deg in (-1.5, 0.5):
        test_an_arm_that_passes_beside_the_pole_is_not_flung_about(beside_deg)
    test_an_arm_raised_sideways_stays_at_its_end_of_range("left", 0.5, 120.0)
    test_an_arm_raised_ahead_past_overhead_stays_up(185.0)


MUTANTS: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "nearest without the decomposition kept": lambda m: m.setattr(
        follower, "choose", lambda wanted, nearest, kept: nearest
    ),
    "turned along the pole's valley for nothing": lambda m: m.setattr(
        follower, "worth_turning", lambda wanted, group, aim, last: aim
    ),
    "kept without being unwrapped": lambda m: m.setattr(choice, "TURN", 1e6),
}


@pytest.mark.parametrize("mutant", MUTANTS.values(), ids=MUTANTS)
def test_without_a_protection_an_arm_does_not_stay(
    mutant: Callable[[pytest.MonkeyPatch], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    mutant(monkeypatch)
    with pytest.raises(AssertionError):
        arms_stay()


@pytest.mark.bench
def test_what_it_costs_beside_the_plain_decomposition() -> None:
    """Ratios, so that the speed of this machine does not matter; the plain one took 29 to 63 µs."""
    joints = 0.6 * SKELETON.upper_rad + 0.4 * SKELETON.lower_rad
    within = [orientations(SKELETON, joints + 0.01 * np.sin(0.3 * k)) for k in range(200)]
    raised = relative(
        SKELETON, angles_of("left_upper_arm", np.array([[5.0, 100.0 + k % 3, 9.0] for k in range(200)]))
    )
    plain = cost_us(JointAngles(SKELETON).solve, within)
    assert cost_us(JointSolver(SKELETON).solve, within) < 3.0 * plain
    assert cost_us(JointSolver(SKELETON).solve, list(in_world(SKELETON, raised))) < 5.0 * plain


def cost_us(solve: Callable[[Array, Array], object], postures: list[Array]) -> float:
    best = np.inf
    for _ in range(15):
        begin = time.perf_counter()
        for q in postures:
            solve(q, STILL)
        best = min(best, time.perf_counter() - begin)
    return 1e6 * best / len(postures)
