"""An e-stop is repeated until it is acknowledged; who was not reached is said."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress

import pytest

from common.errors import LinkError, LinkTimeoutError
from common.link import open_link, open_session
from common.link.config import LinkConfig
from common.link.queries import Answered
from common.wire.codec import encode
from common.wire.messages import ControlReply
from common.wire.presence import ProcessPresence
from common.wire.stop import StopAnswer, pack_stop, pack_stop_answer, read_stop
from common.wire.topics import STOP
from deploy.client.answer import RobotAnswer
from deploy.client.destination import Destination
from deploy.client.stop import OnAnswer, repeat_until_stopped, stop_robots
from deploy.client.stop_count import StopCount

ACKNOWLEDGED = pack_stop_answer(StopAnswer(True, "estop", "stopped"))
STOP_IT = pack_stop("robot-1", "anna")
BOTH = (1, 2)


class Road:
    """The way to robots on which the first questions are lost, or hang, or come back wrong."""

    def __init__(self, *lost: Exception | bytes | str, answers: Sequence[bytes] = (ACKNOWLEDGED,)) -> None:
        self.lost = list(lost)
        self.answers = answers
        self.asked = 0

    async def ask_all(self, payload: bytes, on_answer: OnAnswer) -> None:
        assert payload == STOP_IT
        self.asked += 1
        trouble = self.lost.pop(0) if self.lost else None
        if isinstance(trouble, Exception):
            raise trouble
        if isinstance(trouble, bytes):
            on_answer(Answered(trouble, 0, "s"))
            return
        if trouble == "hangs":
            await asyncio.Event().wait()
        for answer in self.answers:
            on_answer(Answered(answer, 0, "s"))


def shown(instance: int) -> ProcessPresence:
    return ProcessPresence("robot-1", "slave", instance, 3, "1.0", f"room {instance}")


async def stopped(
    road: Road, count: StopCount, within_s: float = 20.0, settled: bool = True
) -> list[RobotAnswer]:
    told: list[RobotAnswer] = []
    known = asyncio.Event()
    if settled:
        known.set()
    with suppress(TimeoutError):
        async with asyncio.timeout(within_s):
            await repeat_until_stopped(road.ask_all, count, STOP_IT, known, told.append, repeat_s=0.01)
    return told


@pytest.mark.parametrize(
    "lost",
    [
        [],
        [LinkError("nobody"), LinkError("nobody")],
        [LinkTimeoutError("late")],
        ["hangs", "hangs", "hangs"],
        [b"garbage"],
        [pack_stop_answer(StopAnswer(False, "track", "no"))],
        [pack_stop_answer(StopAnswer(True, "track", "another's answer"))],
        [encode(ControlReply(True, "estop", "an answer to another question"))],
    ],
    ids=range(8),
)
def test_it_is_repeated_until_the_robot_says_that_it_is_stopped(lost: list[Exception | bytes | str]) -> None:
    road, count = Road(*lost), StopCount("robot-1", 1.0)
    told = asyncio.run(stopped(road, count))
    assert [(answer.done, answer.text) for answer in told] == [(True, "stopped")]
    assert count.complete
    assert road.asked == len(lost) + 1


@pytest.mark.parametrize("trouble", ["hangs", LinkError("nobody")])
def test_it_goes_on_while_nobody_answers(trouble: Exception | str) -> None:
    road, count = Road(*[trouble] * 10_000), StopCount("robot-1", 0.1)
    assert asyncio.run(stopped(road, count, within_s=0.1)) == []
    assert not count.complete
    assert "NOT STOPPED" in count.answers()[0].text
    assert 2 <= road.asked <= 11


def test_one_acknowledgement_does_not_end_it_before_all_are_seen() -> None:
    road, count = Road(), StopCount("robot-1", 0.1)
    told = asyncio.run(stopped(road, count, within_s=0.1, settled=False))
    assert len(told) == 1
    assert road.asked >= 2


def test_a_late_acknowledgement_of_an_early_question_counts() -> None:
    class Slow(Road):
        async def ask_all(self, payload: bytes, on_answer: OnAnswer) -> None:
            self.asked += 1
            if self.asked > 1:
                await asyncio.Event().wait()
            await asyncio.sleep(0.05)
            on_answer(Answered(ACKNOWLEDGED, 0, "s"))

    road, count = Slow(), StopCount("robot-1", 1.0)
    assert len(asyncio.run(stopped(road, count))) == 1
    assert road.asked >= 3


def test_each_of_one_name_must_acknowledge() -> None:
    first, second = (pack_stop_answer(StopAnswer(True, "estop", "stopped", n)) for n in BOTH)
    count = StopCount("robot-1", 0.1)
    for instance in BOTH:
        count.expect(shown(instance))
    assert len(asyncio.run(stopped(Road(answers=[first]), count, within_s=0.05))) == 1
    one, other = count.answers()
    assert (one.done, one.instance, other.done, other.instance) == (True, 1, False, 2)
    assert "room 2" in other.line
    assert len(asyncio.run(stopped(Road(answers=[first, second]), count))) == 1
    assert [answer.done for answer in count.answers()] == [True, True]
    assert "room 1 (instance 00000001) and room 2" in str(count.namesakes())


def test_one_that_answers_without_having_shown_itself_counts_too() -> None:
    both = [pack_stop_answer(StopAnswer(True, "estop", "stopped", n)) for n in BOTH]
    count = StopCount("robot-1", 0.1)
    asyncio.run(stopped(Road(answers=both), count))
    assert [answer.instance for answer in count.answers()] == [1, 2]
    assert count.namesakes() is not None


def endpoint() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@asynccontextmanager
async def robots(**at: str) -> AsyncIterator[dict[str, list[str]]]:
    """Slaves that only answer; who asked each of them to do what."""
    asked: dict[str, list[str]] = {name: [] for name in at}

    async with AsyncExitStack() as stack:
        for name, where in at.items():
            link = await stack.enter_async_context(open_link(LinkConfig(listen=[where]), name))

            def answer(payload: bytes, _: int, name: str = name) -> bytes:
                asked[name].append(f"estop by {read_stop(payload)}")
                return ACKNOWLEDGED

            link.answer(STOP, answer)
            link.declare_alive("slave")
        yield asked


def stop(
    at: dict[str, str], there: dict[str, str], named: tuple[str, ...], everyone: bool
) -> tuple[list[RobotAnswer], dict[str, list[str]]]:
    async def story() -> tuple[list[RobotAnswer], dict[str, list[str]]]:
        async with robots(**there) as asked:
            where = Destination(LinkConfig(connect=list(at.values())), named, "anna")
            told: list[RobotAnswer] = []
            answers = await stop_robots(where, everyone, told.append, within_s=1.5)
            assert sorted(map(str, told)) == sorted(map(str, answers))
            return answers, asked

    return asyncio.run(story())


def test_all_stops_every_robot_that_is_there_and_names_only_those() -> None:
    at = {"a": endpoint(), "b": endpoint()}
    answers, asked = stop(at, at, (), everyone=True)
    assert [(answer.robot, answer.done) for answer in answers] == [("a", True), ("b", True)]
    assert all(asked[name][0] == "estop by anna" for name in at)


def test_a_named_one_is_stopped_alone() -> None:
    at = {"a": endpoint(), "b": endpoint()}
    answers, asked = stop(at, at, ("b",), everyone=False)
    assert [(answer.robot, answer.done) for answer in answers] == [("b", True)]
    assert asked["a"] == []


def test_a_robot_without_an_answer_is_named_and_delays_no_other() -> None:
    at = {"a": endpoint(), "b": endpoint()}
    answers, _ = stop(at, {"a": at["a"]}, ("a", "b"), everyone=True)
    by_name = {answer.robot: answer for answer in answers}
    assert by_name["a"].done
    assert not by_name["b"].done
    assert "NOT STOPPED" in by_name["b"].text
    assert "at the robot itself" in by_name["b"].text
    assert "1 of 2 endpoints" in by_name[""].text


def test_all_that_reaches_no_robot_says_so() -> None:
    answers, _ = stop({"a": endpoint()}, {}, (), everyone=True)
    assert [answer.done for answer in answers] == [False]
    assert "NOT REACHED" in answers[0].text


def test_through_routers_one_answer_is_enough_and_none_an_error() -> None:
    dead, router = endpoint(), endpoint()

    async def story() -> list[RobotAnswer]:
        def through(*routers: str) -> LinkConfig:
            return LinkConfig(mode="client", connect=list(routers))

        with pytest.raises(LinkError, match=f"no router answered at {dead}"):
            await stop_robots(Destination(through(dead), ("a",), "anna"), False, within_s=0.2)
        async with (
            open_session(LinkConfig(listen=[router]), "router"),
            open_link(through(router), "a") as robot,
        ):
            robot.answer(STOP, lambda _payload, _ns: ACKNOWLEDGED)
            robot.declare_alive("slave")
            return await stop_robots(Destination(through(dead, router), (), "anna"), True, within_s=5.0)

    answers = asyncio.run(story())
    assert [(answer.robot, answer.done) for answer in answers] == [("a", True)]


@pytest.mark.parametrize("through_a_router", [False, True])
@pytest.mark.parametrize("everyone", [False, True])
def test_two_of_one_name_are_both_stopped_and_told_by_address(through_a_router: bool, everyone: bool) -> None:
    asked: list[int] = []

    async def story() -> list[RobotAnswer]:
        at = [endpoint(), endpoint()]
        where = LinkConfig(connect=at)
        links = [LinkConfig(listen=[each]) for each in at]
        async with AsyncExitStack() as stack:
            if through_a_router:
                await stack.enter_async_context(open_session(LinkConfig(listen=[at[0]]), "router"))
                where = LinkConfig(connect=[at[0]], mode="client")
                links = [where, where]
            for number, link in zip(BOTH, links, strict=True):
                robot = await stack.enter_async_context(open_link(link, "a"))

                def answer(_: bytes, __: int, number: int = number) -> bytes:
                    asked.append(number)
                    return pack_stop_answer(StopAnswer(True, "estop", "stopped", number))

                robot.answer(STOP, answer)
                robot.declare_alive("slave", number, [f"room {number}"])
            named = () if everyone else ("a",)
            return await stop_robots(Destination(where, named, "anna"), everyone, within_s=2.0)

    answers = asyncio.run(story())
    assert sorted((answer.instance, answer.done) for answer in answers) == [(1, True), (2, True)]
    assert set(asked) == set(BOTH)


def test_one_of_two_that_shows_itself_and_hangs_is_not_called_stopped() -> None:
    async def story() -> list[RobotAnswer]:
        at = [endpoint(), endpoint()]
        async with (
            open_link(LinkConfig(listen=[at[0]]), "a") as one,
            open_link(LinkConfig(listen=[at[1]]), "a") as other,
        ):
            one.answer(STOP, lambda *_: pack_stop_answer(StopAnswer(True, "estop", "stopped", 1)))
            one.declare_alive("slave", 1, ["room 1"])
            other.declare_alive("slave", 2, ["room 2"])
            return await stop_robots(Destination(LinkConfig(connect=at), ("a",), "anna"), False, within_s=1.0)

    one, other = asyncio.run(story())
    assert (one.done, one.instance) == (True, 1)
    assert (other.done, other.instance) == (False, 2)
    assert "room 2" in other.line
    assert "NOT STOPPED" in other.line
