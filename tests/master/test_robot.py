"""Robots of one master: each has its own lease, clock, numbers; what fails at one does not reach another."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest

from common.clock import monotonic_ns, to_ns
from common.clock_sync.exchange import SlaveExchange
from common.config.load import load_config
from common.metrics.master import MasterMetrics
from common.wire.codec import VERSION, decode, encode
from common.wire.lease import lease_id
from common.wire.messages import (
    Action,
    ClockQuery,
    Command,
    CommandEcho,
    ControlReply,
    ControlRequest,
    RobotState,
    Statistics,
)
from common.wire.presence import ProcessPresence
from common.wire.topics import CLOCK, CONTROL, STATE, STATISTICS, Topic
from master.alarms.situation import RobotSign
from master.app import Master
from master.config import MasterConfig
from master.joint_angles.sample import JointAngleSample
from master.robot import CLOCK_QUICK, CLOCK_SETTLED, CommandedRobot, asks_clock
from tests.published import master_metrics

EXAMPLE = Path(__file__).parents[2] / "deploy" / "examples" / "master.toml"
JOINTS = 25


@dataclass
class FakeLink:
    """A robot's topics; `fails` is what every question to it ends with."""

    token: int = 7
    fails: type[Exception] | None = None
    put: dict[str, list[bytes]] = field(default_factory=dict)
    asked: list[Action] = field(default_factory=list)
    hear: dict[str, Callable[[bytes, int], None]] = field(default_factory=dict)
    told: list[ControlRequest] = field(default_factory=list)
    instance: int = 1
    clock: SlaveExchange = field(default_factory=SlaveExchange)
    clock_asked: int = 0

    def publish(self, topic: Topic) -> Callable[[bytes], None]:
        return self.put.setdefault(topic.name, []).append

    def subscribe(self, topic: Topic, on_payload: Callable[[bytes, int], None], in_order: int = 0) -> None:
        self.hear[topic.name] = on_payload

    def subscribe_keys(self, *_: object, **__: object) -> None: ...

    def declare_alive(self, role: str, instance: int, endpoints: Sequence[str]) -> None: ...

    def watch_presence(self, on_change: Callable[[ProcessPresence, bool], None]) -> None:
        self.shown = on_change

    async def ask_all(self, topic: Topic, payload: bytes) -> list[Any]:
        self.told.append(decode(payload, ControlRequest))
        return []

    def counters(self) -> dict[str, dict[str, int]]:
        return {}

    async def ask(self, topic: Topic, payload: bytes) -> bytes:
        return (await self.ask_stamped(topic, payload))[0]

    async def ask_stamped(self, topic: Topic, payload: bytes) -> tuple[bytes, int]:
        if self.fails is not None:
            raise self.fails("planted")
        if topic is CLOCK:
            self.clock_asked += 1
            query = decode(payload, ClockQuery)
            received_ns = 10**15 + query.asked_ns
            reply = self.clock.on_query(query, received_ns, received_ns)
            return encode(replace(reply, instance=self.instance)), query.asked_ns + 1000
        assert topic == CONTROL.of("nurse-1")
        self.asked.append(decode(payload, ControlRequest).action)
        return encode(ControlReply(True, "hold", "yours", self.token, instance=self.instance)), 0

    def state(
        self,
        now_ns: int,
        token: int = 0,
        echo: CommandEcho | None = None,
        instance: int = 1,
        wanted_ms: int = 0,
    ) -> None:
        zeros, valid = np.zeros(JOINTS), np.ones(JOINTS, np.bool_)
        state = RobotState(
            "r", 1, now_ns, now_ns, "hold", "", "nurse-1" if token else "", valid, zeros, zeros, echo, 0, 1,
            lease_id=lease_id(token), instance=instance, wanted_period_ms=wanted_ms,
        )  # fmt: skip
        self.hear[STATE.name](encode(state), now_ns)

    def commands(self) -> list[Command]:
        return [decode(payload, Command, JOINTS) for payload in self.put["command"]]


class FakeSession:
    paths = ""
    overheard: Callable[[str, bytes, int], None] | None = None

    def __init__(self, **links: FakeLink) -> None:
        self.links = links

    def link(self, robot: str) -> Any:
        return self.links[robot]


def solved() -> JointAngleSample:
    return JointAngleSample(16, 1, 2, np.zeros(JOINTS), np.zeros(JOINTS), np.ones(JOINTS, np.bool_))


def master_of(tap: Any = None, /, **links: FakeLink) -> Master:
    config = load_config(
        EXAMPLE, MasterConfig, [f"robots={list(links)}", "capture.buses.0.channel='239.0.0.1'"]
    )
    session: Any = FakeSession(**links)
    return Master(config, session, tap=tap)


async def served(master: Master, until: Callable[[], bool]) -> None:
    """Run the robots' parts of a master, without its buses, until something is so."""
    tasks = [asyncio.create_task(master._fleet._serve(robot)) for robot in master._fleet]
    try:
        async with asyncio.timeout(10.0):
            while not until():  # noqa: ASYNC110
                await asyncio.sleep(0.005)
    finally:
        for task in tasks:
            task.cancel()
        results = await asyncio.gather(*tasks, return_exceptions=True)
    for result in results:
        if isinstance(result, Exception):
            raise result


def test_each_robot_gets_the_posture_under_its_own_name() -> None:
    links = {"a": FakeLink(token=7), "b": FakeLink(token=8)}
    master = master_of(**links)

    async def story() -> None:
        def all_asked() -> bool:
            for link in links.values():
                link.state(monotonic_ns())
            return all(link.asked for link in links.values())

        await served(master, all_asked)

    asyncio.run(story())
    master._send(solved())
    [to_a], [to_b] = (link.commands() for link in links.values())
    assert (to_a.robot, to_a.lease, to_a.sequence) == ("a", 7, 1)
    assert (to_b.robot, to_b.lease, to_b.sequence) == ("b", 8, 1)
    assert to_a.tick == to_b.tick == 16
    robots = master.metrics().robots
    assert {name: one.commands_sent for name, one in robots.items()} == {"a": 1, "b": 1}


@pytest.mark.parametrize("fails", [ValueError, OSError])
def test_what_fails_unforeseen_at_one_robot_ends_that_one_alone(fails: type[Exception]) -> None:
    links = {"a": FakeLink(), "b": FakeLink(fails=fails)}
    master = master_of(**links)

    def until() -> bool:
        links["a"].state(monotonic_ns())
        return bool(links["a"].asked) and master._fleet._given_up == {"b"}

    asyncio.run(served(master, until))
    master._send(solved())
    assert len(links["a"].commands()) == 1
    assert links["b"].commands() == []


def test_a_master_with_no_robot_left_ends() -> None:
    master = master_of(a=FakeLink(fails=ValueError))
    with pytest.raises(ExceptionGroup):
        asyncio.run(served(master, lambda: bool(master._fleet._given_up)))


def test_a_state_that_is_garbage_is_counted_at_its_robot() -> None:
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    link.hear["state"](b"garbage", 1)
    link.hear["state"](encode(ControlReply(True, "hold", "")), 2)
    heard = robot.metrics().robot
    assert heard.undecodable == 2
    assert heard.silent is True


def test_a_tapped_master_hears_the_robot_s_figures_for_its_recordings() -> None:
    """`tandem prove` compares the hand's motion with what the robot claims; 1 message a second."""
    for tap, heard in ((None, False), (Untouched(), True)):
        link = FakeLink()
        master_of(tap, a=link)
        assert (STATISTICS.name in link.hear) is heard


class Untouched:
    """A tap that nobody reads."""

    read = False
    behind = False

    def put(self, topic: str, payload: bytes, stamp_ns: int) -> None: ...


def test_each_round_trip_is_told_once() -> None:
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    robot._watch.round_trip.record(2_000_000)
    shared = master_metrics()
    robot.publish_metrics(1, shared)
    robot.publish_metrics(2, shared)
    told = [decode(payload, Statistics).metrics for payload in link.put["statistics"]]
    assert [one.robots["a"].round_trip_recent_us for one in told if isinstance(one, MasterMetrics)] == [
        (2000,),
        (),
    ]


def test_while_two_bear_the_name_both_are_told_and_neither_is_claimed() -> None:
    link: Any = FakeLink()
    master = master_of(a=link)
    link.shown(ProcessPresence("a", "slave", 1, 3, "1.0", "room 1"), True)
    link.shown(ProcessPresence("a", "slave", 2, 3, "1.0", "room 2"), True)

    def until() -> bool:
        for instance in (1, 2):
            link.state(monotonic_ns(), instance=instance)
        return len(link.told) >= 2

    asyncio.run(served(master, until))
    assert link.asked == []
    assert {request.action for request in link.told} == {Action.NAMESAKE}
    assert "room 1 (instance 00000001) and room 2 (instance 00000002)" in link.told[0].key
    (robot,) = master._fleet
    assert "2 robots have the name a" in robot.standing


def test_a_namesake_s_states_do_not_end_the_lease_and_a_restart_does() -> None:
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    robot._lease.on_reply(ControlReply(True, "hold", "yours", 7, instance=1), 0)
    for tenth in range(1, 30):
        for instance, token in ((1, 7), (2, 0)):
            link.state(tenth * 100_000_000, token, instance=instance)
    assert robot._lease.token == 7
    link.state(10_000_000_000, instance=2)  # the other is not heard any more
    assert robot._lease.token == 0


def test_a_robot_of_another_version_is_named() -> None:
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    link.hear["state"](msgpack.packb(["state", VERSION + 1, "whatever"]), monotonic_ns())
    assert f"schema version {VERSION + 1}, expected {VERSION}" in robot.standing


def test_the_operator_s_alarms_know_a_robot_only_while_it_is_heard() -> None:
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    assert robot.sign == RobotSign()
    link.state(monotonic_ns())
    assert robot.sign == RobotSign("hold", "", ours=False)


def test_the_clock_of_a_robot_that_stands_is_asked_at_half_the_rate_once_it_is_known() -> None:
    assert all(asks_clock(turn, moves=False) for turn in range(CLOCK_SETTLED + 1))
    later = range(CLOCK_SETTLED + 1, CLOCK_SETTLED + 101)
    assert sum(asks_clock(turn, moves=False) for turn in later) == 50
    assert all(asks_clock(turn, moves=True) for turn in later)
    # the robot takes another asker after a second of silence
    assert all(any(asks_clock(turn + i, moves=False) for i in range(2)) for turn in later)


def test_the_robot_trusts_the_clock_at_the_first_turn_of_the_exchange() -> None:
    """A nurse who takes a robot waited 0.7 s for four turns of it."""
    link: Any = FakeLink()
    robot = CommandedRobot("a", "nurse-1", JOINTS, link=link)
    link.clock.follow(robot.clock.asker)

    def trusted() -> bool:
        newest_ns = 10**15 + monotonic_ns()
        return bool(link.clock.estimate(newest_ns).trusted)

    async def turns(clock_of: int) -> None:
        asked, link.instance = link.clock_asked, clock_of
        turn = asyncio.create_task(robot._keep_clock())
        while link.clock_asked == asked:  # noqa: ASYNC110
            await asyncio.sleep(0)
        turn.cancel()

    asyncio.run(turns(1))
    assert trusted()
    assert link.clock_asked == 1 + CLOCK_QUICK
    asyncio.run(turns(1))
    assert link.clock_asked == 2 + CLOCK_QUICK, "and then as ever"
    link.clock = SlaveExchange()
    link.clock.follow(robot.clock.asker)
    asyncio.run(turns(2))
    assert trusted(), "a robot that was started anew has measured nothing"


def test_a_robot_that_obeyed_and_fell_silent_is_sent_no_more_than_the_usual_rate() -> None:
    """Its line had an outage, and gets no four times as many commands as the others' lines are quick."""
    now_ns, links = monotonic_ns(), {"lan": FakeLink(), "rough": FakeLink(), "never": FakeLink()}
    fleet = master_of(**links)._fleet
    for robot in fleet:
        robot._lease.token, robot._lease.instance = 7, 1
    links["lan"].state(now_ns + to_ns(60.0), 7, wanted_ms=20)
    links["rough"].state(now_ns + to_ns(60.0), 7, wanted_ms=80)
    assert fleet.wanted_ms == {"lan": 20, "rough": 80}
    links["rough"].state(now_ns - to_ns(60.0), 7, wanted_ms=20)
    assert fleet.wanted_ms == {"lan": 20, "rough": 0}
    links["rough"].state(now_ns + to_ns(60.0), 8, wanted_ms=20)
    assert fleet.wanted_ms == {"lan": 20}, "another holds its lease"
