"""The simulated robot's encoders under setpoints flung about at their limits: none is doubted or stopped."""

import numpy as np
import pytest

from common.skeleton import load_skeleton
from slave.encoders.counts import Encoders
from slave.guard import GuardConfig
from slave.guard.placed import Placement
from slave.guard.plausible import EncoderPlausibility
from slave.limit.limit import SetpointLimiter
from slave.servos.mujoco.simulated import SimulatedRobot

PERIOD_NS = 5_000_000


@pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])
def test_a_joint_flung_to_and_fro_at_its_limits_is_believed(profile: str) -> None:
    skeleton, config = load_skeleton(profile), GuardConfig()
    limits, names = config.limits(skeleton), skeleton.joint_names
    rng = np.random.default_rng(3)
    target = np.clip(np.zeros(len(names)), skeleton.lower_rad, skeleton.upper_rad)
    robot = SimulatedRobot(skeleton, position_rad=target)
    limiter, encoders = SetpointLimiter(names, limits), Encoders(skeleton)
    part = EncoderPlausibility(names, skeleton.max_velocity_rad_s, config)
    placement = Placement(names, skeleton.lower_rad, skeleton.upper_rad)
    limiter.seat(target)
    part.note(0, target)
    held = np.zeros(len(names), np.bool_)
    for i in range(1, 200 * 15):
        now_ns = i * PERIOD_NS
        if i % 60 == 0:
            joint = rng.integers(len(names))
            target[joint] = rng.uniform(skeleton.lower_rad[joint], skeleton.upper_rad[joint])
        robot.advance(now_ns)
        reading = robot.read()
        shown = encoders.position_rad(reading.counts)
        assert not part.judge(shown, reading.valid, reading.read_ns, moving=True), part.words
        moves = placement.take(
            reading.read_ns, shown, reading.valid, drive_rad=None, span=part.span, under_way=True
        )
        assert part.span is None or moves is None
        limiter.step(
            now_ns, 0.005, target, np.zeros_like(target), held,
            limits.max_velocity_rad_s, limits.max_acceleration_rad_s2,
        )  # fmt: skip
        robot.write(limiter.position_rad)
        part.note(now_ns, limiter.position_rad)
