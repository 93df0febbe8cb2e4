"""A stop is asked again and again until the robot says so; what is not known is said."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from common.clock import monotonic_ns
from common.errors import LinkTimeoutError
from common.link.queries import Answered
from common.wire.presence import ProcessPresence
from common.wire.stop import StopAnswer, pack_stop_answer, read_stop
from deploy.client.stop import OnAnswer
from deploy.console import stopping
from deploy.console.model.robot import TAP
from deploy.console.stopping import GIVEN_UP, NOT_STOPPED, ONE_SILENT, RobotStopper
from tests.deploy.console.robots import OPERATOR, ROBOT, heard, state


class Asked:
    """A link whose robot answers the stop after so many questions."""

    def __init__(self, silent: int) -> None:
        self.silent = silent
        self.questions: list[bytes] = []

    async def ask_all(self, topic: object, payload: bytes, on_answer: OnAnswer) -> list[Answered]:
        self.questions.append(payload)
        if len(self.questions) <= self.silent:
            raise LinkTimeoutError("no answer")
        answer = Answered(pack_stop_answer(StopAnswer(True, "estop", "stopped by nurse-1", 5)), 0, "session")
        on_answer(answer)
        return [answer]


def stopper(link: Any) -> RobotStopper:
    return RobotStopper(link, heard(), OPERATOR)


async def until(condition: Any) -> None:
    async with asyncio.timeout(10.0):
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.005)


def test_a_stop_is_asked_until_the_robot_acknowledges() -> None:
    async def story() -> None:
        link = Asked(silent=2)
        one = stopper(link)
        shown = one.stop("nurse-1")
        assert shown.robot_ns is None
        assert one.stop("somebody else") is shown, "the same stop goes on"
        await until(lambda: shown.robot_ns is not None)
        assert len(link.questions) == 3
        assert {read_stop(payload) for payload in link.questions} == {OPERATOR}
        assert (shown.text, shown.failed) == ("stopped by nurse-1", "")
        await until(lambda: one._task is not None and one._task.done())
        one.stop("again")
        await until(lambda: len(link.questions) == 4)
        await one.close()

    asyncio.run(story())


def test_each_process_of_that_name_must_acknowledge() -> None:
    async def story() -> None:
        link = Asked(silent=0)
        one = stopper(link)
        other = ProcessPresence(ROBOT, "slave", 9, place="other host")
        one._on_presence(other, True)
        one.stop("nurse-1")
        await until(lambda: len(link.questions) > 2)
        assert one._task is not None
        assert not one._task.done(), "another robot of that name has said nothing"
        await one.close()

    asyncio.run(story())


def test_without_an_answer_it_is_said_and_in_the_end_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        monkeypatch.setattr(stopping, "UNANSWERED_S", 0.01)
        monkeypatch.setattr(stopping, "GIVE_UP_S", 0.5)
        link = Asked(silent=1000)
        one = stopper(link)
        shown = one.stop("nurse-1")
        await until(lambda: shown.failed == NOT_STOPPED)
        await until(lambda: shown.failed == GIVEN_UP)
        assert len(link.questions) >= 2
        link.silent = 0
        again = one.stop("nurse-1")
        assert again is not shown
        await until(lambda: again.robot_ns is not None)
        assert again.failed == ""
        await one.close()

    asyncio.run(story())


def test_one_who_presses_again_still_reads_that_nobody_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        monkeypatch.setattr(stopping, "UNANSWERED_S", 0.01)
        one = stopper(Asked(silent=1000))
        shown = one.stop("nurse-1")
        await until(lambda: shown.failed == NOT_STOPPED)
        assert one.stop("nurse-1").failed == NOT_STOPPED, "the robot is being asked all the time"
        one._model.stop = None  # it was reset by somebody else meanwhile
        anew = one.stop("nurse-1")
        assert anew.failed == ""
        await until(lambda: anew.failed == NOT_STOPPED)
        await one.close()

    asyncio.run(story())


def test_a_second_robot_of_that_name_that_says_nothing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        monkeypatch.setattr(stopping, "UNANSWERED_S", 0.01)
        link = Asked(silent=0)
        one = stopper(link)
        one._on_presence(ProcessPresence(ROBOT, "slave", 9, place="other host"), True)
        shown = one.stop("nurse-1")
        now_ns = monotonic_ns()
        one._model.on_state(state(at_s=now_ns / 1e9, guard="estop"), now_ns, TAP)
        await until(lambda: shown.failed == ONE_SILENT)
        await one.close()

    asyncio.run(story())


def test_a_robot_that_says_that_it_is_stopped_did_not_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        monkeypatch.setattr(stopping, "monotonic_ns", lambda: 10**9)
        monkeypatch.setattr(stopping, "UNANSWERED_S", 0.01)
        link = Asked(silent=1000)
        one = stopper(link)
        shown = one.stop("nurse-1")
        one._model.on_state(state(at_s=1.0, guard="estop"), 10**9, TAP)
        await until(lambda: len(link.questions) == 2)
        assert shown.failed == ""
        await one.close()

    asyncio.run(story())


def test_a_second_robot_that_appears_during_the_stop_is_waited_for() -> None:
    async def story() -> None:
        link = Asked(silent=1)
        one = stopper(link)
        shown = one.stop("nurse-1")
        await until(lambda: len(link.questions) == 1)
        one._on_presence(ProcessPresence(ROBOT, "slave", 9, place="other host"), True)
        await until(lambda: len(link.questions) > 3)
        assert shown.robot_ns is None, "only one of the two has acknowledged"
        assert one.under_way
        await one.close()

    asyncio.run(story())
