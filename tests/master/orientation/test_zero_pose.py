import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import Array, angle_between, conjugate, from_rotation_vector, heading_turn, multiply
from master.orientation.heading import HeadingMemory
from master.orientation.zero_pose import ZeroPose
from master.suit.doubt import Weight

SAME = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
NO_FIELD = np.full(3, np.nan)
ALL = np.ones(3, dtype=np.bool_)
ASKEW = Rotation.random(3, rng=0).as_quat(scalar_first=True)


def test_off_it_leaves_the_alignment_as_calibrated() -> None:
    zero_pose = ZeroPose(ASKEW, 0, 0.0)
    assert zero_pose.known.all()
    zero_pose.add(SAME, ALL)
    assert np.array_equal(zero_pose.q_sensor_from_segment, ASKEW)


def test_the_mean_over_the_time_becomes_the_zero_pose() -> None:
    rng = np.random.default_rng(1)
    zero_pose = ZeroPose(SAME, 400, 0.0)
    for tick in range(400):
        assert not zero_pose.known.any()
        assert np.array_equal(zero_pose.q_sensor_from_segment, SAME)
        sway = multiply(ASKEW, from_rotation_vector(0.01 * rng.normal(size=(3, 3))))
        # the sign of a quaternion means nothing
        zero_pose.add(sway if tick % 2 else -sway, ALL)
    assert zero_pose.known.all()
    zero = multiply(ASKEW, zero_pose.q_sensor_from_segment)
    assert np.max(angle_between(zero, SAME)) < 0.003


def test_the_operator_s_facing_is_kept() -> None:
    zero_pose = ZeroPose(SAME, 1, 0.7)
    zero_pose.add(ASKEW, ALL)
    zero = multiply(ASKEW, zero_pose.q_sensor_from_segment)
    assert np.max(angle_between(zero, heading_turn(0.7))) < 1e-7


def test_only_settled_nodes_count_and_one_that_drops_out_begins_again() -> None:
    zero_pose = ZeroPose(SAME, 4, 0.0)
    first, alone = np.array([True, True, False]), np.array([True, False, False])
    wrong = np.concatenate([ASKEW[:1], heading_turn(np.ones(2))])
    for _ in range(3):
        zero_pose.add(wrong, first)
    zero_pose.add(wrong, alone)
    assert zero_pose.known.tolist() == [True, False, False]
    for _ in range(4):
        assert not zero_pose.known[1:].any()
        zero_pose.add(ASKEW, ALL)
    assert zero_pose.known.all()
    zero = multiply(ASKEW, zero_pose.q_sensor_from_segment)
    assert np.max(angle_between(zero, SAME)) < 1e-7


def test_once_known_it_stays_even_while_the_node_is_lost() -> None:
    zero_pose = ZeroPose(SAME, 1, 0.0)
    zero_pose.add(ASKEW, np.array([True, False, False]))
    kept = zero_pose.q_sensor_from_segment[0].copy()
    zero_pose.add(SAME, np.array([False, False, False]))
    zero_pose.add(SAME, ALL)
    assert np.array_equal(zero_pose.q_sensor_from_segment[0], kept)


def test_a_lost_heading_is_taken_up_again() -> None:
    memory = HeadingMemory(3)
    held = multiply(heading_turn(np.array([0.5, -2.0, 3.0])), from_rotation_vector(np.full((3, 3), 0.1)))
    memory.lose(np.array([True, True, False]), held)
    # the restarted filters know the inclination, and some heading of their own
    restarted = multiply(heading_turn(np.array([1.0, 1.0, 1.0])), held)
    memory.find(ALL, restarted, NO_FIELD)
    back = angle_between(multiply(memory.turn, restarted), held)
    assert np.allclose(back, [0.0, 0.0, 1.0], atol=1e-7)
    # and once more, from what was held with the turn
    memory.lose(ALL, restarted)
    memory.find(ALL, held, NO_FIELD)
    assert np.allclose(angle_between(multiply(memory.turn, held), held)[:2], 0.0, atol=1e-7)


def test_of_aligned_nodes_it_takes_the_heading_and_their_lean() -> None:
    aligned = np.array([True, True, False])
    zero_pose = ZeroPose(ASKEW, 2, 0.7, aligned)
    # the heading is arbitrary; the second node's segment leans by 3° besides
    lean = from_rotation_vector(np.array([[0.0, 0.0, 0.0], [np.radians(3.0), 0.0, 0.0], [0.0, 0.0, 0.0]]))
    standing = multiply(multiply(heading_turn(np.array([1.0, -2.0, 0.3])), lean), conjugate(ASKEW))
    assert not zero_pose.add(standing, ALL).any()
    assert zero_pose.add(standing, ALL).all()
    assert np.array_equal(zero_pose.q_sensor_from_segment[aligned], ASKEW[aligned])
    assert np.allclose(zero_pose.correction_rad, [-0.3, 2.7, 0.0], atol=0.01)
    assert np.allclose(np.degrees(zero_pose.lean_rad[aligned]), [0.0, 3.0], atol=0.01)
    assert np.isnan(zero_pose.lean_rad[2])
    zero = multiply(standing[2:], zero_pose.q_sensor_from_segment[2:])
    assert np.max(angle_between(zero, heading_turn(0.7))) < 1e-7


STILL = np.zeros((3, 3))


def leaning(deg: float, node: int = 1) -> Array:
    """All in the zero pose but one, whose segment leans."""
    turn = np.zeros((3, 3))
    turn[node, 1] = np.radians(deg)
    return multiply(from_rotation_vector(turn), conjugate(ASKEW))


@pytest.mark.parametrize(("deg", "taken"), [(14.9, True), (15.1, False), (25.0, False), (90.0, False)])
def test_a_lean_of_an_aligned_segment_is_refused_for_all(deg: float, taken: bool) -> None:
    zero_pose = ZeroPose(ASKEW, 4, 0.0, ALL)
    for _ in range(4):
        zero_pose.add(leaning(deg), ALL, STILL)
    assert zero_pose.known.all() == taken
    assert zero_pose.known.any() == taken
    doubts = zero_pose.doubts(ALL)
    if taken:
        assert doubts == {}
        return
    assert zero_pose.refused == 1
    assert list(doubts) == [1, 0, 2]
    assert doubts[1].words == f"zero pose refused: leaned by {deg:.0f}°, at most 15 is upright"
    assert doubts[0].words == "waits for the zero pose: stand upright, arms hanging, and still"
    assert {doubt.weight for doubt in doubts.values()} == {Weight.REFUSED}
    for _ in range(4):
        zero_pose.add(leaning(2.0), ALL, STILL)
    assert zero_pose.known.all()
    assert zero_pose.doubts(ALL) == {}


@pytest.mark.parametrize(("deg_s", "taken"), [(14.9, True), (15.1, False), (60.0, False)])
def test_who_turns_during_the_pose_is_asked_again(deg_s: float, taken: bool) -> None:
    zero_pose, turning = ZeroPose(SAME, 4, 0.0), STILL.copy()
    turning[2, 0] = np.radians(deg_s)
    for tick in range(4):
        zero_pose.add(ASKEW, ALL, turning if tick == 2 else STILL)
    assert zero_pose.known.all() == taken
    if not taken:
        assert zero_pose.reasons == {2: f"turned at {deg_s:.0f}°/s, at most 15 is standing still"}
        # from the beginning, not from where it was
        for _ in range(2):
            assert not zero_pose.add(ASKEW, ALL, STILL).any()
            assert not zero_pose.known.any()
        zero_pose.add(ASKEW, ALL, STILL)
    assert zero_pose.known.all()


def test_who_bends_slowly_is_asked_again_too() -> None:
    zero_pose = ZeroPose(SAME, 400, 0.0)
    for tick in range(400):
        bend = np.zeros((3, 3))
        bend[0, 1] = np.radians(8.0) * tick / 400
        zero_pose.add(multiply(ASKEW, from_rotation_vector(bend)), ALL, STILL)
    assert not zero_pose.known.any()
    assert "turned by 6°" in zero_pose.reasons[0]


def test_of_an_unknown_alignment_a_lean_cannot_be_noticed() -> None:
    zero_pose = ZeroPose(SAME, 4, 0.0)
    for _ in range(4):
        zero_pose.add(leaning(25.0), ALL, STILL)
    assert zero_pose.known.all()


def test_a_node_that_comes_later_needs_the_whole_pose_again() -> None:
    zero_pose, first = ZeroPose(ASKEW, 4, 0.0, ALL), np.array([True, True, False])
    for _ in range(4):
        zero_pose.add(leaning(0.0), first, STILL)
    assert zero_pose.known.tolist() == [True, True, False]
    for _ in range(8):
        zero_pose.add(leaning(40.0), ALL, STILL)
    assert not zero_pose.known[2]
    assert "is 40° from the zero pose" in zero_pose.doubts(ALL)[1].words
    for _ in range(4):
        zero_pose.add(leaning(0.0), ALL, STILL)
    assert zero_pose.known.all()


def test_a_later_node_delays_no_other_and_refuses_if_it_leans() -> None:
    first = np.array([True, True, False])
    for deg, known in ((0.0, [True, True, False]), (20.0, [False, False, False])):
        zero_pose = ZeroPose(ASKEW, 4, 0.0, ALL)
        for tick in range(4):
            zero_pose.add(leaning(deg, node=2), first if tick < 2 else ALL, STILL)
        assert zero_pose.known.tolist() == known
