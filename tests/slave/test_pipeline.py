"""What the slave's parts do together, without a clock, a link or a servo."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgpack
import numpy as np
import pytest

from common.clock import NS_PER_MS, NS_PER_S
from common.clock_sync import MasterExchange
from common.errors import CodecError
from common.link.config import LinkConfig
from common.wire.codec import VERSION, decode, encode
from common.wire.control import read_reply
from common.wire.messages import (
    Action,
    ClockQuery,
    ClockReply,
    Command,
    CommandEcho,
    CommandStamps,
    ControlReply,
    ControlRequest,
    RobotState,
)
from common.wire.stop import pack_stop, read_stop_answer
from slave.config import SlaveConfig
from slave.pipeline import SlavePipeline
from slave.servos.servos import EncoderReading

HOUR_NS = 3600 * NS_PER_S


@pytest.fixture
def pipeline() -> SlavePipeline:
    return SlavePipeline(SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"])))


def converse(pipeline: SlavePipeline, master: MasterExchange, ahead_ns: int, now_ns: int) -> None:
    """One exchange, 1 ms each way, with a master whose clock is ahead of the slave's."""
    query = encode(master.query(now_ns + ahead_ns))
    reply = decode(pipeline.on_clock(query, now_ns + NS_PER_MS, now_ns + NS_PER_MS), ClockReply)
    assert master.on_reply(reply, now_ns + 2 * NS_PER_MS + ahead_ns)


def claim(pipeline: SlavePipeline, operator: str, clock: int, now_ns: int) -> ControlReply:
    request = ControlRequest("robot-1", Action.CLAIM, operator, clock=clock)
    return decode(pipeline.on_control(encode(request), now_ns, sender=operator), ControlReply)


def test_commands_are_judged_by_the_clock_of_who_holds_the_lease(pipeline: SlavePipeline) -> None:
    # another operator's master was there first, waits for the lease, and goes on asking
    ben, anna = MasterExchange(asker=7), MasterExchange(asker=8)
    now_ns = NS_PER_S
    for _ in range(8):
        now_ns += NS_PER_S // 4
        converse(pipeline, ben, 0, now_ns)
        converse(pipeline, anna, HOUR_NS, now_ns + 10 * NS_PER_MS)
    assert claim(pipeline, "anna", anna.asker, now_ns).done
    assert not claim(pipeline, "ben", ben.asker, now_ns).done
    offset = pipeline.clock.estimator.estimate(now_ns)
    assert offset.trusted
    assert abs(offset.offset_ns - HOUR_NS) <= offset.bound_ns


def test_a_query_that_is_no_query_changes_nothing(pipeline: SlavePipeline) -> None:
    with pytest.raises(CodecError, match="clock"):
        pipeline.on_clock(encode(ControlReply(True, "", "")), 1, 1)
    reply = decode(pipeline.on_clock(encode(ClockQuery(5)), 6, 7), ClockReply)
    assert reply == ClockReply(5, 6, 7, pipeline.instance)


def test_a_new_holder_never_sees_the_echo_of_the_last_ones_commands(pipeline: SlavePipeline) -> None:
    pipeline.traffic.journeys.echo = CommandEcho(9, 1, 2, 3, 4)
    assert claim(pipeline, "anna", 8, NS_PER_S).done
    state = decode(pipeline.state(NS_PER_S), RobotState, len(pipeline.skeleton.joints))
    assert state.operator == "anna"
    assert state.echo is None


def test_the_state_names_a_joint_whose_encoder_is_not_believed(pipeline: SlavePipeline) -> None:
    pipeline.guard._joints.plausible.words["neck_yaw"] = "the encoder jumps"
    state = decode(pipeline.state(NS_PER_S), RobotState, len(pipeline.skeleton.joints))
    assert state.faults["neck_yaw"] == "the encoder jumps"


def test_where_anybody_may_ask_the_robot_is_stopped_but_not_engaged(
    pipeline: SlavePipeline,
) -> None:
    def ask(action: Action) -> ControlReply:
        request = ControlRequest("robot-1", action, "ben", key="k", challenge=1)
        return decode(pipeline.on_stop(encode(request), NS_PER_S), ControlReply)

    for action in set(Action) - {Action.ESTOP, Action.STATUS}:
        reply = ask(action)
        assert (reply.done, reply.guard) == (False, "boot")
        assert reply.text == f"{action} is for operators only: send it on the control topic"
    assert pipeline.guard.lease.operator != "ben"
    assert ask(Action.STATUS).done
    assert read_reply(pipeline.on_stop(pack_stop("robot-1", "ben"), NS_PER_S), Action.ESTOP).guard == "estop"


@pytest.mark.parametrize(
    "way",
    [
        SlavePipeline.on_stop,
        partial(SlavePipeline.on_control, sender="carl"),
        partial(SlavePipeline.on_control, sender=None),
    ],
)
@pytest.mark.parametrize(
    "payload",
    [
        pack_stop("robot-1", "ben"),
        pack_stop("another robot", ""),
        encode(ControlRequest("robot-1", Action.ESTOP, "ben")),
        msgpack.packb(["control", 99, "robot-1", "estop", "ben", {"of": "later"}]),
    ],
    ids=["frozen", "misaddressed", "codec", "later"],
)
def test_a_stop_of_any_version_stops_and_is_answered(
    pipeline: SlavePipeline, way: Callable[..., bytes], payload: bytes
) -> None:
    answer = read_stop_answer(way(pipeline, payload, NS_PER_S))
    assert answer is not None
    assert answer.stopped
    assert answer.instance == pipeline.instance
    assert pipeline.guard.state == "estop"


def test_every_answer_and_state_tells_which_process_it_is_of(pipeline: SlavePipeline) -> None:
    assert pipeline.instance > 0
    asked = encode(ControlRequest("robot-1", Action.STATUS, "ben"))
    for payload in (asked, b"garbage"):
        assert (
            decode(pipeline.on_control(payload, NS_PER_S, sender="ben"), ControlReply).instance
            == pipeline.instance
        )
    state = decode(pipeline.state(NS_PER_S), RobotState, len(pipeline.skeleton.joints))
    assert state.instance == pipeline.instance


def test_told_of_a_namesake_it_is_said_with_the_state_and_passes(pipeline: SlavePipeline) -> None:
    request = ControlRequest("robot-1", Action.NAMESAKE, "anna", "2 robots have the name robot-1")
    assert decode(pipeline.on_control(encode(request), NS_PER_S, sender="anna"), ControlReply).done
    reading = EncoderReading(NS_PER_S, np.zeros(25, np.int64), np.ones(25, np.bool_))

    def faults(now_ns: int) -> dict[str, str]:
        pipeline.tick(now_ns, reading)
        told = decode(pipeline.state(now_ns), RobotState, len(pipeline.skeleton.joints)).faults
        assert told.pop("contact").startswith("no contact detection")
        return told

    assert faults(NS_PER_S) == {"name": "2 robots have the name robot-1"}
    assert faults(4 * NS_PER_S) == {}


def test_who_may_only_stop_it_may_not_tell_it_of_a_namesake(pipeline: SlavePipeline) -> None:
    request = ControlRequest("robot-1", Action.NAMESAKE, "anna", "words")
    assert not decode(pipeline.on_stop(encode(request), NS_PER_S), ControlReply).done
    assert pipeline.namesakes.words(NS_PER_S) is None


def test_other_versions_are_counted_and_reported_once_a_second(pipeline: SlavePipeline) -> None:
    said: list[str] = []
    pipeline.unread.warn = said.append
    later = msgpack.packb(["command", VERSION + 1, "robot-1", 0])
    for tick in range(30):
        pipeline.on_command(later, 1, NS_PER_S + tick * NS_PER_S // 10, sender="anna")
    assert pipeline.unread.counts == {"command": 30}
    assert len(said) == 3
    assert f"schema version {VERSION + 1}, expected {VERSION}" in said[0]
    assert said[-1].endswith("(21 so far)")


@pytest.mark.parametrize("sender", ["ben", "", "Anna", None])
def test_nobody_asks_in_another_s_name(pipeline: SlavePipeline, sender: str | None) -> None:
    for action in set(Action) - {Action.ESTOP}:
        request = ControlRequest("robot-1", action, "anna", key="k")
        reply = decode(pipeline.on_control(encode(request), NS_PER_S, sender=sender), ControlReply)
        assert not reply.done
    assert pipeline.guard.counters.foreign_requests == len(Action) - 1
    assert pipeline.guard.operator == ""
    assert claim(pipeline, "anna", 1, NS_PER_S).done


def test_a_stolen_token_is_worth_nothing_on_another_key(pipeline: SlavePipeline) -> None:
    token = claim(pipeline, "anna", 1, NS_PER_S).lease
    joints = len(pipeline.skeleton.joints)
    zeros, valid = np.zeros(joints), np.ones(joints, np.bool_)
    stamps = CommandStamps(NS_PER_S, NS_PER_S, NS_PER_S, NS_PER_S)
    stolen = encode(Command("robot-1", token, 1, 1, stamps, True, valid, zeros, zeros, operator="anna"))
    for sender in ("ben", "", None):
        pipeline.on_command(stolen, NS_PER_S, NS_PER_S, sender=sender)
    assert pipeline.guard.counters.dropped == {"operator": 3}
    assert pipeline.traffic.arrivals.metrics().arrived == 0
    pipeline.on_command(stolen, NS_PER_S, NS_PER_S, sender="anna")
    assert pipeline.guard.counters.dropped == {"operator": 3, "clock": 1}, (
        "past the gate; its clock is unknown"
    )


def test_a_state_names_the_joints_that_a_limit_held_back_since_the_one_before(
    pipeline: SlavePipeline,
) -> None:
    joints = len(pipeline.skeleton.joints)
    pipeline.motion._clamped[3] = True
    told = decode(pipeline.state(NS_PER_S), RobotState, joints).clamped
    assert told is not None
    assert np.flatnonzero(told).tolist() == [3]
    assert decode(pipeline.state(NS_PER_S), RobotState, joints).clamped is None
