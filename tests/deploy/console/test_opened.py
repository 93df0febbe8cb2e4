"""The console's list, over real sessions: robots that appear are listed, opened, taken, and closed unseen."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

import pytest

from common.clock import monotonic_ns
from common.link import LinkSession, open_session
from common.link.config import LinkConfig
from common.link.roster import Roster
from common.wire.messages import Action
from common.wire.presence import ProcessPresence
from common.wire.summary import HomeCall, RobotSummary, encode_summary
from common.wire.together import TOGETHER
from common.wire.topics import STATE, SUMMARY, VIDEO
from common.wire.video import encode_frame
from deploy.client.roster_view import roster_rows
from deploy.console.acts import ActRefusedError, read_act
from deploy.console.hearing import Hearing
from deploy.console.hub import Hub
from deploy.console.model.robot import RobotModel, Side, Whose
from deploy.console.opened import KEPT_S, MOST_OPEN, OpenedRobots
from deploy.console.session import Access, PageRole, Person
from deploy.console.stopping import RobotStopper
from tests.common.link.test_link import free_endpoint, until
from tests.deploy.console.robots import SKELETON, frame

NURSE = Person(PageRole.OPERATOR, "nurse-1")
S = 1_000_000_000


@dataclass
class Desk:
    opened: OpenedRobots
    hearing: Hearing
    stoppers: dict[str, RobotStopper]
    home: LinkSession
    """Of the robots."""
    wanted: list[bool]
    """Whether the home's robot had somebody who heard its states, each time that changed."""
    roster: Roster


@asynccontextmanager
async def desk(profile: str = "nursing", robots: int = 1) -> AsyncIterator[Desk]:
    door = free_endpoint()
    async with (
        open_session(LinkConfig(listen=[door])) as session,
        open_session(LinkConfig(connect=[door])) as home,
    ):
        hearing, roster, stoppers = Hearing({}), Roster(), dict[str, RobotStopper]()
        session.watch_roster(roster)

        def make(robot: str) -> tuple[RobotModel, RobotStopper]:
            model = RobotModel(robot, SKELETON, Whose("nurse-1", Side.ELSEWHERE))
            return model, RobotStopper(session.link(robot), model, "nurse-1")

        opened = OpenedRobots(
            roster, hearing, stoppers,
            session=session, profile=SKELETON.name, operator="nurse-1", make=make,
        )  # fmt: skip
        wanted: list[bool] = []
        announce(home, robots, profile, wanted)
        await until(lambda: len(opened.rows(monotonic_ns()).robots) == robots)
        yield Desk(opened, hearing, stoppers, home, wanted, roster)


def announce(home: LinkSession, robots: int, profile: str, wanted: list[bool]) -> None:
    for number in range(robots):
        link = home.link(f"ward-{number}")
        link.publish(STATE, wanted.append)
        link.declare_alive("slave", 1 + number, ["home"], profile)


def test_a_robot_of_the_list_is_opened_and_heard_and_closed_when_no_page_shows_it() -> None:
    async def story() -> None:
        async with desk() as one:
            assert one.opened.open("nobody") == "no robot nobody is there"
            assert one.opened.open("ward-0") == ""
            assert one.opened.open("ward-0") == "", "twice is once"
            await until(lambda: one.wanted[-1])
            assert set(one.hearing.models) == set(one.stoppers) == {"ward-0"}
            await one.opened.close_unseen({"ward-0"}, S)
            await one.opened.close_unseen((), 2 * S)
            await one.opened.close_unseen((), 2 * S + round(KEPT_S * S))
            assert one.hearing.models, "a page that loads again finds it open"
            await one.opened.close_unseen((), 2 * S + round(KEPT_S * S) + 1)
            assert not one.hearing.models
            assert not one.stoppers
            await until(lambda: not one.wanted[-1])
            assert one.opened.open("ward-0") == ""
            await until(lambda: one.wanted[-1])

    asyncio.run(story())


def test_a_robot_that_is_being_stopped_is_not_closed() -> None:
    async def story() -> None:
        async with desk() as one:
            assert one.opened.open("ward-0") == ""
            one.stoppers["ward-0"].stop("a test")
            for second in range(60):
                await one.opened.close_unseen((), second * S)
            assert "ward-0" in one.hearing.models
            await one.stoppers["ward-0"].close()

    asyncio.run(story())


def test_what_this_console_cannot_show_is_not_opened() -> None:
    async def story() -> None:
        async with desk(profile="hand") as one:
            assert "profile hand" in one.opened.open("ward-0")
        async with desk(robots=MOST_OPEN + 1) as one:
            for number in range(MOST_OPEN):
                assert one.opened.open(f"ward-{number}") == ""
            assert "open already" in one.opened.open(f"ward-{MOST_OPEN}")

    asyncio.run(story())


def test_the_list_shows_who_waits_first() -> None:
    roster = Roster()
    for number, name in enumerate(("a", "b", "c")):
        roster.on_presence(ProcessPresence(name, "slave", 1 + number, 4, "1.0", "home", "nursing"), True, 0)
        call = {"b": HomeCall(5.0, "help"), "c": HomeCall(60.0)}.get(name)
        summary = RobotSummary(name, 1 + number, 1, "hold", "", call=call)
        roster.on_summary(SUMMARY.key_for(name), encode_summary(summary), S)
    assert [row.robot for row in roster_rows(roster, S).robots] == ["c", "b", "a"]


def test_a_robot_that_follows_its_operator_is_known_though_no_page_shows_it() -> None:
    """Else the suit could be calibrated while a robot of `robots = "*"` follows it."""

    async def story() -> None:
        async with desk() as one:
            hub = Hub(
                one.hearing.models,
                Access([], secure=False, stranger=PageRole.NOBODY),
                one.stoppers,
                opened=one.opened,
            )

            def tells(sequence: int, guard: str, operator: str) -> list[str]:
                told = encode_summary(RobotSummary("ward-0", 1, sequence, guard, "", operator))
                one.roster.on_summary(SUMMARY.key_for("ward-0"), told, monotonic_ns())
                return hub.engaged_robots

            assert tells(1, "hold", "nurse-1") == []
            assert tells(2, "track", "nurse-1") == ["ward-0"]
            assert tells(3, "track", "nurse-2") == [], "it follows another one's suit"

    asyncio.run(story())


def test_a_listed_robot_may_be_taken_and_given_back_and_nothing_else() -> None:
    def read(act: str, robot: str, **more: object) -> Action:
        return read_act({"act": act, "robot": robot, **more}, ("here",), NURSE, {"there"}.__contains__).action

    assert read("take", "there") is Action.TAKE
    assert read("release", "there") is Action.RELEASE
    assert read("take", "here") is Action.TAKE
    for act, robot in (("engage", "there"), ("take", "nowhere"), ("reset", "there")):
        with pytest.raises(ActRefusedError):
            read(act, robot, key="x")
    with pytest.raises(ActRefusedError):
        read_act({"act": "take", "robot": "here"}, ("here",), Person(PageRole.VIEWER))


@pytest.mark.parametrize(("together", "key"), [(True, TOGETHER), (False, ""), ("yes", ""), (None, "")])
def test_only_a_held_modifier_moves_several(together: object, key: str) -> None:
    body = {"act": "engage", "robot": "here", "together": together, "key": TOGETHER}
    assert read_act(body, ("here",), NURSE).key == key


def test_a_stop_opens_a_robot_that_was_closed_while_its_page_was_away() -> None:
    async def story() -> None:
        async with desk() as one:
            access = Access(["here"], secure=False, stranger=PageRole.NOBODY)
            hub = Hub(one.hearing.models, access, one.stoppers, opened=one.opened)
            assert hub.stopper("nobody") is None
            stopper = hub.stopper("ward-0")
            assert stopper is not None
            assert stopper.stop("a test").kept
            await one.opened.close_unseen((), S)
            assert one.stoppers == {"ward-0": stopper}, "it is asked, whoever looks"
            await stopper.close()

    asyncio.run(story())


def test_a_stop_opens_a_robot_however_many_are_open() -> None:
    async def story() -> None:
        async with desk(robots=MOST_OPEN + 1) as one:
            for number in range(MOST_OPEN):
                assert one.opened.open(f"ward-{number}") == ""
            assert one.opened.open(f"ward-{MOST_OPEN}", to_stop=True) == ""

    asyncio.run(story())


def test_each_picture_of_an_opened_robot_is_heard() -> None:
    """One of H.264 cannot be shown without the one before it: the newest alone would not do."""

    async def story() -> None:
        async with desk() as one:
            assert one.opened.open("ward-0") == ""
            numbers: list[int] = []
            one.hearing.on_picture = lambda model, camera: numbers.append(
                model.pictures.newest[camera].frame.number
            )
            put = one.home.link("ward-0").publish(VIDEO)
            await until(lambda: one.wanted[-1])
            await asyncio.sleep(0.2)
            for number in range(1, 6):
                put(encode_frame(frame(number, 1.0)))
            time.sleep(0.3)  # noqa: ASYNC251  # this loop is late, and all of them wait for it
            await until(lambda: bool(numbers) and numbers[-1] == 5)
            assert numbers == [1, 2, 3, 4, 5]

    asyncio.run(story())
