"""The robot's summary: one a second, sooner after a change, never a flood; a call waits and is answered."""

from __future__ import annotations

from pathlib import Path

from common.config.load import load_config
from common.wire.call import CallRequest, pack_call, read_call_reply
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.summary import RobotSummary, decode_summary
from common.wire.together import beside
from slave.announce import Announcer
from slave.config import SlaveConfig
from slave.guard import Guard
from slave.guard.control import Control
from slave.guard.lease import WANTED_S

MS = 1_000_000
S = 1000 * MS
EXAMPLE = Path(__file__).parents[2] / "deploy" / "examples" / "slave.toml"
CONFIG = load_config(EXAMPLE, SlaveConfig)


class Robot:
    """Guard, control and announcer, without servos."""

    def __init__(self) -> None:
        self.guard = Guard("robot-1", CONFIG.skeleton, CONFIG.guard)
        self.control = Control("")
        self.announcer = Announcer("robot-1", 3)

    def summary(self, now_ns: int) -> RobotSummary | None:
        payload = self.announcer.summary(now_ns, self.guard, {})
        return None if payload is None else decode_summary(payload)

    def ask(self, action: Action, operator: str, now_ns: int, fresh: bool = True) -> ControlReply:
        status = ControlRequest("robot-1", Action.STATUS, operator)
        challenge = self.control.answer(self.guard, status, now_ns).challenge if fresh else 0
        request = ControlRequest("robot-1", action, operator, challenge=challenge)
        return self.control.answer(self.guard, request, now_ns)

    def call(self, now_ns: int, calls: bool = True, words: str = "") -> str:
        reply = self.announcer.on_call(pack_call(CallRequest(calls, words)), self.guard, now_ns)
        return read_call_reply(reply).text


def test_one_a_second_and_sooner_after_a_change() -> None:
    robot = Robot()
    assert robot.summary(0) is not None
    assert robot.summary(S - 1) is None
    assert robot.summary(S) is not None
    robot.call(S)
    assert robot.summary(S + 99 * MS) is None, "a change of a moment after the last summary waits"
    changed = robot.summary(S + 100 * MS)
    assert changed is not None
    assert changed.call is not None
    assert robot.summary(S + 200 * MS) is None, "a call that goes on is no change"
    assert robot.summary(2 * S + 100 * MS) is not None
    assert [robot.announcer._sequence] == [4]


def test_a_flickering_guard_sends_at_most_ten_a_second() -> None:
    robot, sent = Robot(), 0
    for tick in range(200):
        robot.call(tick * 5 * MS, calls=tick % 2 == 0)
        sent += robot.summary(tick * 5 * MS) is not None
    assert 2 <= sent <= 10


def test_a_call_waits_until_an_operator_claims_the_robot() -> None:
    robot = Robot()
    assert "an operator is called" in robot.call(0, words="dressing")
    assert "called for 5 s" in robot.call(5 * S), "calling again keeps the place in the queue"
    summary = robot.summary(7 * S)
    assert summary is not None
    assert summary.call is not None
    assert (summary.call.since_s, summary.call.words) == (7.0, "dressing")
    assert robot.ask(Action.CLAIM, "anna", 8 * S).done
    answered = robot.summary(8 * S)
    assert answered is not None
    assert answered.call is None
    assert answered.operator == "anna"
    assert "anna commands this robot already" in robot.call(8 * S)


def test_a_call_is_withdrawn() -> None:
    robot = Robot()
    robot.call(0)
    assert robot.call(S, calls=False) == "the call is withdrawn"
    assert robot.call(S, calls=False) == "nobody was called"
    summary = robot.summary(S)
    assert summary is not None
    assert summary.call is None


def test_who_takes_the_robot_is_told_for_ten_seconds_and_gets_no_right_by_it() -> None:
    robot = Robot()
    assert robot.ask(Action.TAKE, "anna", S).done
    wanted = robot.summary(S)
    assert wanted is not None
    assert (wanted.wanted_by, wanted.operator) == ("anna", "")
    assert robot.guard.lease.token == 0
    assert robot.guard.lease.wanted_by(S + round(WANTED_S * S)) == "anna"
    assert robot.guard.lease.wanted_by(S + round(WANTED_S * S) + 1) == ""
    assert robot.guard.lease.wanted_by(S - 1) == "", "a clock that went back ends it too"


def test_a_take_that_the_network_held_back_does_nothing() -> None:
    robot = Robot()
    assert not robot.ask(Action.TAKE, "anna", S, fresh=False).done
    assert robot.guard.lease.wanted_by(S) == ""


def test_a_robot_that_another_commands_cannot_be_taken() -> None:
    robot = Robot()
    robot.ask(Action.CLAIM, "anna", S)
    refused = robot.ask(Action.TAKE, "ben", S)
    assert not refused.done
    assert "handover" in refused.text
    assert robot.ask(Action.TAKE, "anna", S).text == "anna commands it already"
    assert not robot.ask(Action.TAKE, "", S).done
    robot.ask(Action.CLAIM, "anna", S)
    robot.guard.offer("ben", S)
    assert robot.ask(Action.TAKE, "ben", S).done, "offered to him"


def test_who_let_the_robot_go_is_told_until_it_is_claimed_again() -> None:
    robot = Robot()
    robot.ask(Action.CLAIM, "anna", S)
    assert robot.ask(Action.RELEASE, "anna", S).done
    free = robot.summary(S)
    assert free is not None
    assert (free.operator, free.let_go_by) == ("", "anna")
    robot.ask(Action.CLAIM, "ben", S)
    claimed = robot.summary(2 * S)
    assert claimed is not None
    assert (claimed.operator, claimed.let_go_by) == ("ben", "")


def test_the_doubt_beside_others_is_recognised() -> None:
    assert beside([]) == ""
    assert "a, b" in beside(["a", "b"])
