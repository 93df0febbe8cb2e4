"""What the observer makes of the messages it hears; the link is a table of callbacks."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from common.link import Link
from common.metrics.parts import Ticks
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import Command, CommandEcho, CommandStamps, Message, RobotState, Statistics, Truth
from common.wire.topics import COMMAND, STATE, STATISTICS, TRUTH, Topic
from deploy.harness.observer import RATE_OVER_NS, Observer
from tests.published import master_metrics, slave_metrics

SKELETON = load_skeleton("nursing")
JOINTS = len(SKELETON.joints)
ALL, ZERO = np.ones(JOINTS, np.bool_), np.zeros(JOINTS)
NOW_NS, FRESH_NS = 10_000_000_000, 160_000_000
"""Two command periods: from then on the robot does not take them."""
TOPIC = {Command: COMMAND, RobotState: STATE, Truth: TRUTH, Statistics: STATISTICS}

GOOD_COMMAND = Command("robot-1", 7, 5, 80, CommandStamps(1, 2, 3, 4), True, ALL, ZERO, ZERO)
GOOD_ECHO = CommandEcho(5, 4, NOW_NS - 10_000_000, NOW_NS - 9_000_000, 0)
GOOD_STATE = RobotState(
    "robot-1", 1, NOW_NS, NOW_NS, "hold", "disengaged", "nurse-1", ALL, ZERO, ZERO, GOOD_ECHO, 0, 50_000
)
TRUE = Truth(80, 1, ZERO, ZERO)


class Wire:
    """Takes the observer's subscriptions and plays messages to them."""

    def __init__(self) -> None:
        self.on_payload: dict[Topic, Callable[[bytes, int], None]] = {}
        self.observer = Observer(cast(Link, self), SKELETON)

    def subscribe(self, topic: Topic, on_payload: Callable[[bytes, int], None]) -> None:
        self.on_payload[topic] = on_payload

    def hear(self, *messages: Message) -> Observer:
        for message in messages:
            self.on_payload[TOPIC[type(message)]](encode(message), 0)
        return self.observer


def without_joints(*names: str) -> Command:
    return replace(GOOD_COMMAND, valid=np.array([name not in names for name in SKELETON.joint_names]))


def echoed(age_ns: int) -> RobotState:
    return replace(GOOD_STATE, echo=replace(GOOD_ECHO, received_ns=NOW_NS - age_ns))


def test_ready_when_all_is_there() -> None:
    assert Wire().hear(GOOD_COMMAND, GOOD_STATE).ready


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([], "the robot is not heard"),
        ([GOOD_COMMAND], "the robot is not heard"),
        ([GOOD_STATE], "the master sends no commands"),
        (
            [without_joints("neck_yaw", "waist_pitch"), GOOD_STATE],
            "2 joints are not known yet (neck_yaw, waist_pitch …)",
        ),
        ([replace(GOOD_COMMAND, lease=0), replace(GOOD_STATE, echo=None)], "does not hold the robot's lease"),
        ([GOOD_COMMAND, replace(GOOD_STATE, echo=None, offset_bound_ns=-1)], "offset is not trusted yet"),
        ([GOOD_COMMAND, replace(GOOD_STATE, echo=None)], "the robot takes no command yet"),
        ([GOOD_COMMAND, echoed(FRESH_NS)], "the robot takes no command yet"),
        (
            [GOOD_COMMAND, replace(GOOD_STATE, guard="estop", reason="pressed")],
            "the guard is in estop: pressed",
        ),
    ],
)
def test_each_missing_piece_has_its_words(messages: list[Message], words: str) -> None:
    observer = Wire().hear(*messages)
    assert not observer.ready
    assert words in observer.waiting_for()


def test_commands_count_while_the_last_is_under_two_periods_old() -> None:
    assert Wire().hear(GOOD_COMMAND, echoed(FRESH_NS - 1)).ready
    assert not Wire().hear(GOOD_COMMAND, echoed(FRESH_NS)).ready


def test_the_guard_s_states_are_kept_in_their_order_once_each_time() -> None:
    wire = Wire()
    assert wire.observer.guard == "not heard"
    assert wire.observer.sent_ns == 0
    for guard in ("boot", "hold", "hold", "align", "hold"):
        wire.hear(replace(GOOD_STATE, guard=guard))
    assert wire.observer.guards_seen == ["boot", "hold", "align", "hold"]
    assert wire.observer.guard == "hold"
    assert wire.observer.sent_ns == NOW_NS


def test_only_what_comes_while_recording_is_kept_to_be_judged() -> None:
    wire = Wire()
    observer = wire.hear(GOOD_COMMAND, GOOD_STATE, TRUE)
    observer.recording = True
    wire.hear(GOOD_COMMAND, GOOD_STATE, TRUE)
    observer.recording = False
    wire.hear(GOOD_COMMAND, GOOD_STATE, TRUE)
    assert (len(observer.commands), len(observer.states)) == (1, 1)
    trace = observer.trace
    assert (len(trace.solved().tick), len(trace.moved().encoder_ns), len(trace.truth().tick)) == (1, 1, 1)


def test_what_is_no_message_changes_nothing() -> None:
    wire = Wire()
    for topic, on_payload in wire.on_payload.items():
        on_payload(b"\xc1", 0)
        on_payload(encode(GOOD_COMMAND if topic is not COMMAND else GOOD_STATE), 0)
    assert (wire.observer.command, wire.observer.state, wire.observer.truth) == (None, None, None)
    assert (wire.observer.master, wire.observer.slave) == (None, None)
    assert wire.observer.undecodable == 8, "and is counted"


def test_statistics_are_kept_by_role() -> None:
    old, new, robot = master_metrics(), master_metrics(ticks=Ticks(2, 0)), slave_metrics()
    observer = Wire().hear(Statistics(1, old), Statistics(1, robot), Statistics(2, new))
    assert (observer.master, observer.slave) == (new, robot)


def test_rates_use_the_senders_numbers_so_unheard_messages_count() -> None:
    wire = Wire()

    def command(sequence: int, put_ns: int) -> Command:
        return replace(GOOD_COMMAND, sequence=sequence, stamps=CommandStamps(1, 2, 3, put_ns))

    wire.hear(command(5, NOW_NS), command(17, NOW_NS + RATE_OVER_NS - 1))
    assert wire.observer.rates_hz == {}
    wire.hear(command(30, NOW_NS + 2_000_000_000))
    assert wire.observer.rates_hz == {"commands": 12.5}
    wire.hear(command(1, NOW_NS + 9_000_000_000), command(26, NOW_NS + 11_000_000_000))
    assert wire.observer.rates_hz == {"commands": 12.5}, "a sender that starts again is counted anew"


def test_the_capture_rate_is_the_masters_ticks_that_ran() -> None:
    wire = Wire()
    for second in range(1, 3):
        ticks = Ticks(200 * second, 4 * second)
        wire.hear(Statistics(second * 1_000_000_000, master_metrics(ticks=ticks)))
    assert wire.observer.rates_hz == {"capture": 196.0}


def test_news_comes_with_the_next_message() -> None:
    async def story() -> None:
        wire = Wire()
        wire.hear(GOOD_STATE)
        waiting = asyncio.create_task(wire.observer.news())
        await asyncio.sleep(0)
        assert not waiting.done()
        wire.hear(GOOD_STATE)
        await asyncio.wait_for(waiting, 5.0)

    asyncio.run(story())
