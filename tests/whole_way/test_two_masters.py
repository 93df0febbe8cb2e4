"""Two masters under one name at one robot: one lease at a time, and each knows whether it is its own."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

from common.clock import NS_PER_S, to_ns
from common.config.load import load_config
from common.wire.codec import decode, encode
from common.wire.messages import ControlReply, RobotState
from deploy.examples.profiles import example
from master.lease import GRACE_S, LeaseKeeper
from slave.config import SlaveConfig
from slave.pipeline import SlavePipeline


@dataclass
class Robot:
    """A slave at its own clock, asked and heard without a network."""

    now_ns: int = NS_PER_S
    config: SlaveConfig = field(default_factory=lambda: load_config(example("slave"), SlaveConfig))

    def __post_init__(self) -> None:
        self.slave = SlavePipeline(self.config, draw_token=itertools.count(1).__next__)

    def hear(self, keeper: LeaseKeeper) -> None:
        """A master hears the robot's state, and claims if it has no lease."""
        state = decode(self.slave.state(self.now_ns), RobotState, len(self.config.skeleton.joints))
        keeper.on_state(state, self.now_ns)
        request = keeper.request(self.now_ns)
        if request is not None:
            reply = self.slave.on_control(encode(request), self.now_ns, sender=request.operator)
            keeper.on_reply(decode(reply, ControlReply), self.now_ns)

    def wait(self, seconds: float) -> None:
        self.now_ns += to_ns(seconds)
        self.slave.guard.lease.lapse(self.now_ns)


def test_the_loser_notices_and_waits_its_turn() -> None:
    robot = Robot()
    first, second = LeaseKeeper("robot-1", "nurse-1"), LeaseKeeper("robot-1", "nurse-1")
    robot.hear(first)
    robot.hear(second)
    assert first.token
    assert not second.token

    # the first is cut off for longer than its lease lasts: the second has it now
    robot.wait(robot.config.guard.lease_timeout_s + GRACE_S)
    robot.hear(second)
    assert second.token not in (0, first.token)
    robot.hear(first)
    assert not first.token
    assert "holds the lease" in first.answer or "another master" in first.answer
    robot.hear(second)
    assert second.token == robot.slave.guard.lease.token
