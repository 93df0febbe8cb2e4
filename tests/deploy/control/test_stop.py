"""An e-stop is repeated until it is acknowledged; who was not reached is said."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from common.codec import decode, encode
from common.config import LinkConfig
from common.errors import LinkError, LinkTimeoutError
from common.link import open_link, open_session
from common.messages import Action, ControlReply, ControlRequest
from common.topics import STOP
from deploy.control.ask import Answer
from deploy.control.reach import Reach
from deploy.control.stop import repeat_until_stopped, stop_robots

REQUEST = ControlRequest("robot-1", Action.ESTOP, "anna")
ACKNOWLEDGED = ControlReply(True, "estop", "stopped")


class Road:
    """The way to a robot on which the first questions are lost, or hang, or come back wrong."""

    def __init__(self, *lost: Exception | str | ControlReply) -> None:
        self.lost = list(lost)
        self.asked = 0

    async def ask(self, payload: bytes) -> bytes:
        assert decode(payload, ControlRequest) == REQUEST
        self.asked += 1
        if not self.lost:
            return encode(ACKNOWLEDGED)
        trouble = self.lost.pop(0)
        if isinstance(trouble, Exception):
            raise trouble
        if isinstance(trouble, ControlReply):
            return encode(trouble)
        if trouble == "garbage":
            return b"garbage"
        await asyncio.Event().wait()
        raise AssertionError


@pytest.mark.parametrize(
    "lost",
    [
        [],
        [LinkError("nobody"), LinkError("nobody")],
        [LinkTimeoutError("late")],
        ["hangs", "hangs", "hangs"],
        ["garbage"],
        [ControlReply(False, "track", "no")],
        [ControlReply(True, "track", "somebody else's answer")],
    ],
    ids=lambda lost: (
        "-".join(type(x).__name__ if isinstance(x, Exception) else str(x)[:14] for x in lost) or "none"
    ),
)
def test_it_is_repeated_until_the_robot_says_that_it_is_stopped(
    lost: list[Exception | str | ControlReply],
) -> None:
    road = Road(*lost)
    reply = asyncio.run(repeat_until_stopped(road.ask, REQUEST, within_s=20.0, repeat_s=0.01))
    assert reply == ACKNOWLEDGED
    assert road.asked == len(lost) + 1


@pytest.mark.parametrize("trouble", ["hangs", LinkError("nobody")])
def test_it_ends_when_nobody_ever_answers(trouble: Exception | str) -> None:
    road = Road(*[trouble] * 10_000)
    assert asyncio.run(repeat_until_stopped(road.ask, REQUEST, within_s=0.1, repeat_s=0.01)) is None
    assert 2 <= road.asked <= 11


def test_a_late_acknowledgement_of_an_early_question_counts() -> None:
    class Slow(Road):
        async def ask(self, payload: bytes) -> bytes:
            self.asked += 1
            if self.asked > 1:
                await asyncio.Event().wait()
            await asyncio.sleep(0.05)
            return encode(ACKNOWLEDGED)

    road = Slow()
    assert asyncio.run(repeat_until_stopped(road.ask, REQUEST, within_s=20.0, repeat_s=0.01)) == ACKNOWLEDGED
    assert road.asked >= 3


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
                request = decode(payload, ControlRequest)
                asked[name].append(f"{request.action} by {request.operator}")
                return encode(ACKNOWLEDGED)

            link.answer(STOP, answer)
            link.declare_alive("slave")
        yield asked


def stop(
    at: dict[str, str], there: dict[str, str], named: tuple[str, ...], everyone: bool
) -> tuple[list[Answer], dict[str, list[str]]]:
    async def story() -> tuple[list[Answer], dict[str, list[str]]]:
        async with robots(**there) as asked:
            where = Reach(LinkConfig(connect=list(at.values())), named, "anna")
            told: list[Answer] = []
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


def test_a_robot_that_does_not_answer_does_not_hold_up_the_others_and_is_said() -> None:
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


def test_through_routers_one_that_answers_is_enough_and_none_is_an_error_in_time() -> None:
    dead, router = endpoint(), endpoint()

    async def story() -> list[Answer]:
        def through(*routers: str) -> LinkConfig:
            return LinkConfig(mode="client", connect=list(routers))

        with pytest.raises(LinkError, match=f"no router answered at {dead}"):
            await stop_robots(Reach(through(dead), ("a",), "anna"), False, within_s=0.2)
        async with (
            open_session(LinkConfig(listen=[router]), "router"),
            open_link(through(router), "a") as robot,
        ):
            robot.answer(STOP, lambda _payload, _ns: encode(ACKNOWLEDGED))
            robot.declare_alive("slave")
            return await stop_robots(Reach(through(dead, router), (), "anna"), True, within_s=5.0)

    answers = asyncio.run(story())
    assert [(answer.robot, answer.done) for answer in answers] == [("a", True)]
