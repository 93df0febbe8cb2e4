"""What a robot says, decoded by another CDR implementation than the one that encoded it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.quaternion import multiply, rotate
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations, origins
from common.wire.messages import RobotState
from common.wire.video import VideoFrame
from deploy.ros.translate import OK, STALE, Translator, WallTime

from .decoded import CompressedImage, DiagnosticArray, JointState, TFMessage, nanoseconds, read

NURSING = load_skeleton("nursing")
POSITION = np.random.default_rng(2).uniform(0.9 * NURSING.lower_rad, 0.9 * NURSING.upper_rad)
WALL_NS = 1_700_000_000_000_000_000


def state(**changes: object) -> RobotState:
    valid = np.ones(25, np.bool_)
    plain = RobotState(
        "robot-1", 1, 7_000_000_000, 6_990_000_000, "track", "follows", "nurse-1", valid, POSITION,
        POSITION + 0.1, None, 0, 1, effort_nm=np.linspace(0.0, 2.4, 25),
    )  # fmt: skip
    return replace(plain, **changes)  # type: ignore[arg-type]


def told(one: RobotState, wall_ns: int = WALL_NS) -> dict[str, bytes]:
    translator = Translator("robot-1", NURSING)
    return {topic.name: payload for topic, payload in translator.state(one, wall_ns)}


def test_joint_states_and_targets() -> None:
    messages = told(state())
    encoders = read(JointState, messages["/robot_1/joint_states"])
    assert encoders.name == list(NURSING.joint_names)
    np.testing.assert_array_equal(encoders.position, POSITION)
    np.testing.assert_allclose(encoders.effort, np.linspace(0.0, 2.4, 25))
    assert encoders.velocity == []
    assert nanoseconds(encoders.header) == WALL_NS - 10_000_000, "when the encoders were read"
    targets = read(JointState, messages["/robot_1/joint_targets"])
    np.testing.assert_array_equal(targets.position, POSITION + 0.1)
    assert nanoseconds(targets.header) == WALL_NS


def test_a_joint_without_a_reading_is_not_told() -> None:
    valid = np.ones(25, np.bool_)
    valid[3] = False
    messages = told(state(encoder_valid=valid, effort_nm=None))
    encoders = read(JointState, messages["/robot_1/joint_states"])
    assert encoders.name == [n for j, n in enumerate(NURSING.joint_names) if j != 3]
    assert len(encoders.position) == 24
    assert encoders.effort == []
    children = {t.child_frame_id for t in read(TFMessage, messages["/tf"]).transforms}
    (segment,) = {s.name for s in NURSING.segments if NURSING.joint_names[3] in s.angles}
    assert f"robot_1/{segment}" not in children
    assert len(children) == len(NURSING.segments) - 1


def test_tf_stands_as_the_robot_stands() -> None:
    q, place = orientations(NURSING, POSITION), origins(NURSING, orientations(NURSING, POSITION))
    turn = {"robot_1/base_link": (np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))}
    for one in read(TFMessage, told(state())["/tf"]).transforms:
        of_parent, at = turn[one.header.frame_id]
        t, r = one.transform.translation, one.transform.rotation
        turn[one.child_frame_id] = (
            multiply(of_parent, np.array([r.w, r.x, r.y, r.z])),
            at + rotate(of_parent, np.array([t.x, t.y, t.z])),
        )
    for i, name in enumerate(NURSING.segment_names):
        found, at = turn[f"robot_1/{name}"]
        assert abs(float(found @ q[i])) == pytest.approx(1.0, abs=1e-9)
        np.testing.assert_allclose(at, place[i], atol=1e-9)


def test_diagnostics_once_a_second_and_at_each_change() -> None:
    translator = Translator("robot-1", NURSING)

    def rows(one: RobotState, at_s: float) -> list[tuple[int, str, str]]:
        messages = dict(translator.state(one, WALL_NS + round(1e9 * at_s)))
        found = [p for t, p in messages.items() if t.name == "/diagnostics"]
        return [(s.level, s.name, s.message) for p in found for s in read(DiagnosticArray, p).status]

    assert rows(state(), 0.0) == [(OK, "robot-1: guard", "follows")]
    assert rows(state(), 0.5) == []
    held = state(guard="hold", reason="no command for 0.20 s", faults={"left_elbow_pitch": "overcurrent"})
    assert rows(held, 0.6) == [
        (1, "robot-1: guard", "no command for 0.20 s"),
        (2, "robot-1: left_elbow_pitch", "overcurrent"),
    ]
    assert rows(held, 1.5) == []
    assert len(rows(held, 1.7)) == 2
    assert rows(state(guard="estop", reason="pressed"), 1.8) == [(2, "robot-1: guard", "pressed")]
    assert translator.silence(WALL_NS + 2_700_000_000) == []
    ((_, payload),) = translator.silence(WALL_NS + 5_800_000_000)
    (status,) = read(DiagnosticArray, payload).status
    assert (status.level, status.message) == (STALE, "no state for 4 s")


def test_a_picture_is_passed_on_as_it_is() -> None:
    translator = Translator("robot-1", NURSING)
    translator.state(state(), WALL_NS)
    jpeg = b"\xff\xd8" + bytes(range(200)) + b"\xff\xd9"
    topic, payload = translator.picture("head", VideoFrame(4, 6_950_000_000, 6_960_000_000, 320, 240, jpeg))
    assert topic.name == "/robot_1/head/image/compressed"
    image = read(CompressedImage, payload)
    assert (image.format, bytes(image.data), image.header.frame_id) == ("jpeg", jpeg, "robot_1/head")
    assert nanoseconds(image.header) == WALL_NS - 50_000_000


def test_stamps_do_not_jitter_with_the_link_and_follow_a_robot_that_starts_anew() -> None:
    wall = WallTime()
    wall.note(1_000_000_000, 50_000_000_000, 1)
    wall.note(2_000_000_000, 51_080_000_000, 1)  # 80 ms late: no news
    assert wall.of(2_000_000_000) == 51_000_000_000 + 100_000, "but for what clocks may drift"
    wall.note(3_000_000_000, 51_990_000_000, 1)  # the fastest so far
    assert wall.of(3_000_000_000) == 51_990_000_000
    wall.note(5_000, 60_000_000_000, 2)
    assert wall.of(5_000) == 60_000_000_000
