"""A recorded motion at any speed, and how a robot followed it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from common.errors import RecordingError, TandemError
from common.wire.messages import RobotState
from deploy.examples import profiles
from deploy.ops.replay.onto_robot import simulated
from deploy.ops.replay.played import FollowedWatch, PlayedMotion, motion_of
from master.joint_angles.sample import JointAngleSample

EXAMPLES = Path(profiles.__file__).parent


def sample(number: int, valid: tuple[bool, bool] = (True, True), doubt: str = "") -> JointAngleSample:
    """One each 80 ms; joint 0 rises by 0.1 rad each, joint 1 falls by 0.2."""
    position = np.array([0.1 * number, -0.2 * number])
    at_ns = 5_000_000_000 + number * 80_000_000
    return JointAngleSample(
        number, at_ns, at_ns, np.where(valid, position, 0.0), np.zeros(2), np.array(valid), doubt
    )


def test_it_lies_on_straight_lines_and_its_rate_follows_the_speed() -> None:
    motion = motion_of(sample(number) for number in range(11))
    assert motion.seconds == pytest.approx(0.8)
    for time_s in (0.0, 0.08, 0.1, 0.43, 0.79):
        for speed in (0.5, 1.0, 3.0):
            position, rate, valid = motion.at(time_s, speed)
            np.testing.assert_allclose(position, [time_s / 0.8, -2 * time_s / 0.8], atol=1e-9)
            np.testing.assert_allclose(rate, [speed * 1.25, -speed * 2.5], atol=1e-9)
            assert valid.all()


@pytest.mark.parametrize("time_s", [-1.0, 0.81, 5.0])
def test_before_and_after_it_stands(time_s: float) -> None:
    motion = motion_of(sample(number) for number in range(11))
    position, rate, _ = motion.at(time_s, 2.0)
    np.testing.assert_array_equal(position, motion.position_rad[0 if time_s < 0 else -1])
    np.testing.assert_array_equal(rate, 0.0)


def test_it_begins_where_all_joints_are_known_and_an_unknown_one_keeps_its_angle() -> None:
    rows = [
        sample(0, (False, True)),
        sample(1, doubt="no zero pose"),
        sample(2),
        sample(3, (True, False)),
        sample(4),
    ]
    motion = motion_of(rows)
    np.testing.assert_allclose(motion.position_rad, [[0.2, -0.4], [0.3, -0.4], [0.4, -0.8]])
    assert motion.valid.tolist() == [[True, True], [True, False], [True, True]]
    with pytest.raises(RecordingError, match="nothing can be played"):
        motion_of(rows[:2])


def test_the_robot_is_judged_while_it_follows_and_each_hold_is_named() -> None:
    motion: PlayedMotion = motion_of(sample(number) for number in range(11))
    watch = FollowedWatch(motion, ("a", "b"), 1.0)
    yes = np.ones(2, np.bool_)
    state = RobotState("r", 1, 1, 1, "track", "", "replay", yes, np.zeros(2), np.zeros(2), None, 0, 1)
    for number in range(8):
        at_s = 0.1 * number
        off = motion.at(at_s, 1.0)[0] + np.radians([1.0, 3.0])
        guard = "hold" if number in (3, 4) else "track"
        watch.take(replace(state, position_rad=off, guard=guard, reason="no command"), at_s)
    found = watch.findings()
    assert found.followed == pytest.approx(6 / 8)
    assert found.holds == ["hold: no command"]
    assert found.rms_deg == pytest.approx({"a": 1.0, "b": 3.0})
    assert found.seconds == pytest.approx(0.7)


def test_real_drives_are_refused(tmp_path: Path) -> None:
    assert simulated(EXAMPLES / "slave.toml").robot == "robot-1"
    bus = '[[servos.canopen.buses]]\nname = "left"\ninterface = "socketcan"\nchannel = "can0"\nfd = false\n'
    example = (EXAMPLES / "slave.toml").read_text("utf-8")
    real = example.replace('backend = "mujoco"', 'backend = "canopen"').replace(
        "[camera]", f"{bus}[camera]", 1
    )
    (tmp_path / "real.toml").write_text(real, "utf-8")
    with pytest.raises(TandemError, match=r"backend is canopen: .* a simulated robot only"):
        simulated(tmp_path / "real.toml")
