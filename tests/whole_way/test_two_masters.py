"""Two masters under one name at one robot: one lease at a time, and each knows whether it is its own."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

from common.clock import NS_PER_S, to_ns
from common.config.load import load_config
from common.link.access import operators_of
from common.link.config import AccessConfig
from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlReply, ControlRequest, RobotState
from deploy.examples.profiles import example
from master.lease import GRACE_S, LeaseKeeper
from slave.config import SlaveConfig
from slave.guard.control import Control
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


def test_a_running_master_takes_over_what_is_offered_to_its_operator() -> None:
    robot = Robot()
    nurse_1, nurse_2 = LeaseKeeper("robot-1", "nurse-1"), LeaseKeeper("robot-1", "nurse-2")
    robot.hear(nurse_1)
    robot.hear(nurse_2)
    assert nurse_1.token
    assert nurse_2.answer == "nurse-1 holds the lease"

    def ask(operator: str, action: Action, key: str = "", challenge: int = 0) -> ControlReply:
        request = encode(ControlRequest("robot-1", action, operator, key, challenge=challenge))
        return decode(robot.slave.on_control(request, robot.now_ns, sender=operator), ControlReply)

    challenge = ask("nurse-1", Action.STATUS).challenge
    assert "no valid challenge" in ask("nurse-1", Action.HANDOVER, "nurse-2").text
    offered = ask("nurse-1", Action.HANDOVER, "nurse-2", challenge)
    assert offered.text == "holds; nurse-2 may take over now, or nurse-1 engages again"
    robot.now_ns += to_ns(0.3)
    robot.slave.guard.lease.renew(robot.now_ns)  # by nurse-1's commands
    robot.hear(nurse_2)
    assert nurse_2.token == robot.slave.guard.lease.token != nurse_1.token
    robot.now_ns += to_ns(GRACE_S)
    robot.hear(nurse_1)
    assert nurse_1.answer in ("the lease was lost to nurse-2", "nurse-2 holds the lease")
    assert not nurse_1.token


def test_with_rules_a_robot_is_offered_to_its_operators_alone() -> None:
    access = AccessConfig(operators={"nurse-1": ["robot-1"], "nurse-2": ["robot-1"], "nurse-3": ["robot-2"]})
    control = Control("", operators_of(access, "robot-1"))
    guard = Robot().slave.guard
    assert guard.claim("nurse-1", 0)
    assert control._no_successor(guard, "nurse-2") is None
    refused = control._no_successor(guard, "nurse-3")
    assert refused == "nurse-3 may not command this robot; [link.access] permits, beside you: nurse-2"
    assert operators_of(None, "robot-1") is None
