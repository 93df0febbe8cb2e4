"""Two paths as one link: the first copy counts, a cut path costs nothing, a question is handled once."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from common.errors import LinkError
from common.link import Link, open_session, opening
from common.link.config import LinkConfig, TwinConfig
from common.link.inbox import Inbox
from common.link.twin import NUMBER, FirstArrivals, TwinQuestions
from common.link.twin_session import TwinTokens
from common.metrics.link import TopicCounters
from common.wire.topics import COMMAND, CONTROL, IN_ORDER, STATE, STOP, VIDEO
from deploy.harness.endpoints import free_port
from tests.tcp_path import TcpPath

ROBOT = "robot-1"


@given(st.lists(st.integers(0, 30), max_size=60), st.lists(st.integers(0, 30), max_size=60))
def test_each_number_is_taken_once_and_only_upwards(first: list[int], second: list[int]) -> None:
    arrivals, taken = FirstArrivals(), []
    for pair in zip(first, second, strict=False):
        for number in pair:
            if arrivals.is_first("key", NUMBER.pack(7, number)):
                taken.append(number)
    assert taken == sorted(set(taken))
    heard = [number for pair in zip(first, second, strict=False) for number in pair]
    assert (max(heard) if heard else None) == (taken[-1] if taken else None)
    assert arrivals.dropped == len(heard) - len(taken)


def test_a_sender_with_one_path_is_always_taken_and_keys_are_apart() -> None:
    arrivals = FirstArrivals()
    for attachment in (None, b"other"):
        assert arrivals.is_first("key", attachment)
        assert arrivals.is_first("key", attachment)
    assert arrivals.is_first("a", NUMBER.pack(1, 1))
    assert arrivals.is_first("b", NUMBER.pack(1, 1))
    assert arrivals.is_first("a", NUMBER.pack(2, 1))
    assert not arrivals.is_first("a", NUMBER.pack(1, 1))


def test_contradictions_are_named() -> None:
    end = "tcp/127.0.0.1:7447"
    for config, key in (
        (LinkConfig(connect=[end], mode="client", twin=TwinConfig(connect=["tcp/1.2.3.4:1"])), "link.twin"),
        (LinkConfig(connect=[end], twin=TwinConfig()), "link.twin"),
        (LinkConfig(connect=[end], twin=TwinConfig(connect=[end])), "link.twin"),
        (LinkConfig(connect=[end], twin=TwinConfig(connect=["tls/1.2.3.4:1"])), "link.twin.connect"),
    ):
        assert [mistake.key for mistake in config.mistakes()] == [key]
    assert LinkConfig(connect=[end], twin=TwinConfig(connect=["tcp/1.2.3.4:1"])).mistakes() == []


def ends_with(heard: list[bytes], number: int) -> bool:
    return bool(heard) and heard[-1] == str(number).encode()


@asynccontextmanager
async def two_hosts(twin: bool = True) -> AsyncIterator[tuple[Link, Link, TcpPath, TcpPath]]:
    """The operator's link, the robot's, and the paths between them."""
    ports = free_port("tcp"), free_port("tcp")
    listen = [f"tcp/127.0.0.1:{port}" for port in ports]
    robot = LinkConfig(listen=listen[:1], twin=TwinConfig(listen=listen[1:]) if twin else None)
    async with (
        TcpPath(ports[0]).open() as first,
        TcpPath(ports[1]).open() as second,
        open_session(robot) as there,
    ):
        ends = [f"tcp/127.0.0.1:{path.port}" for path in (first, second)]
        operator = LinkConfig(connect=ends[:1], twin=TwinConfig(connect=ends[1:]) if twin else None)
        async with open_session(operator) as here:
            await here.link(ROBOT).connected()
            await there.link(ROBOT).connected()
            yield here.link(ROBOT), there.link(ROBOT), first, second


async def until(reached: Callable[[], object], timeout_s: float = 20.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not reached():  # noqa: ASYNC110  # what is waited for comes from Zenoh's threads
            await asyncio.sleep(0.01)


@pytest.mark.live
def test_every_message_comes_once_and_goes_on_when_one_path_is_cut() -> None:
    async def story() -> None:
        async with two_hosts() as (operator, robot, first, second):
            heard: list[bytes] = []
            robot.subscribe(COMMAND, lambda payload, _: heard.append(payload))
            put = operator.publish(COMMAND.of("nurse-1"))
            await until(lambda: put(b"?") or heard)
            heard.clear()
            for number in range(60):
                first.cut = 20 <= number < 40
                second.cut = number >= 45
                put(str(number).encode())
                await until(partial(ends_with, heard, number))
            first.cut = second.cut = False
            assert [each for each in heard if each != b"?"] == [str(n).encode() for n in range(60)]
            assert robot.counters()[COMMAND.name].duplicates > 20

    asyncio.run(story())


@pytest.mark.live
def test_a_single_path_that_is_cut_delivers_nothing() -> None:
    async def story() -> None:
        async with two_hosts(twin=False) as (operator, robot, first, _):
            heard: list[bytes] = []
            robot.subscribe(COMMAND, lambda payload, _: heard.append(payload))
            put = operator.publish(COMMAND.of("nurse-1"))
            await until(lambda: put(b"?") or heard)
            first.cut = True
            heard.clear()
            put(b"0")
            with pytest.raises(TimeoutError):
                await until(lambda: heard, timeout_s=0.5)
            first.cut = False

    asyncio.run(story())


@pytest.mark.live
def test_a_question_on_both_paths_is_handled_once_and_answered_over_what_is_left() -> None:
    async def story() -> None:
        async with two_hosts() as (operator, robot, first, second):
            asked: list[bytes] = []

            def answer(payload: bytes, _: int) -> bytes:
                asked.append(payload)
                return b"answer to " + payload

            robot.answer(CONTROL, answer)
            topic = CONTROL.of("nurse-1")
            await operator.connected(topic)
            for number in range(12):
                first.cut, second.cut = number in (4, 5, 6), number in (8, 9)
                question = str(number).encode()
                assert await operator.ask(topic, question) == b"answer to " + question
            first.cut = second.cut = False
            assert asked == [str(number).encode() for number in range(12)]

    asyncio.run(story())


@pytest.mark.live
def test_a_process_is_there_while_either_path_shows_it() -> None:
    async def story() -> None:
        async with two_hosts() as (operator, robot, first, _):
            seen: list[bool] = []
            operator.watch_presence(lambda _, here: seen.append(here))
            states: list[bytes] = []
            operator.subscribe(STATE, lambda payload, _: states.append(payload))
            robot.declare_alive("slave", 5, ["tcp/x"])
            await until(lambda: seen)
            assert all(seen)
            first.cut = True
            put, before = robot.publish(STATE), len(seen)
            # longer than Zenoh takes to give up the path that is cut
            for number in range(100):
                put(str(number).encode())
                await asyncio.sleep(0.03)
            await until(partial(ends_with, states, 99))
            assert seen[before:] == []
            first.cut = False

    asyncio.run(story())


def test_both_paths_are_named() -> None:
    twin = TwinConfig(listen=["tcp/1.2.3.4:1"], connect=["tcp/1.2.3.4:2"])
    config = LinkConfig(listen=["tcp/1.2.3.5:1"], twin=twin)
    assert config.all_listen == ["tcp/1.2.3.5:1", "tcp/1.2.3.4:1"]
    assert config.all_connect == ["tcp/1.2.3.4:2"]


def test_where_all_are_taken_in_turn_an_overtaken_one_fills_its_gap_once() -> None:
    arrivals = FirstArrivals(behind=4)
    taken = [n for n in (1, 2, 4, 2, 3, 3, 4, 9, 5, 6, 6, 8) if arrivals.is_first("key", NUMBER.pack(7, n))]
    assert taken == [1, 2, 4, 3, 9, 6, 8]


@pytest.mark.live
def test_voice_and_video_come_once_too() -> None:
    async def story() -> None:
        async with two_hosts() as (operator, robot, _, __):
            heard: list[bytes] = []
            operator.subscribe(VIDEO, lambda payload, _: heard.append(payload), in_order=IN_ORDER)
            put = robot.publish(VIDEO)
            await until(lambda: put(b"?") or heard)
            for number in range(20):
                put(str(number).encode())
                await until(partial(ends_with, heard, number))
            await until(lambda: operator.counters()[VIDEO.name].duplicates >= 20)
            assert [each for each in heard if each != b"?"] == [str(n).encode() for n in range(20)]

    asyncio.run(story())


class Said:
    """Stands for a zenoh.ZBytes."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload

    def to_bytes(self) -> bytes:
        return self.payload


class Asked:
    """Stands for a zenoh.Query."""

    def __init__(self, payload: bytes, number: int, key: str = "tandem/robot-1/stop") -> None:
        self.payload, self.key_expr, self.attachment = Said(payload), key, Said(NUMBER.pack(7, number))
        self.answers: list[bytes] = []
        self.dropped = False

    def __enter__(self) -> Asked:
        return self

    def __exit__(self, *_: object) -> None:
        self.drop()

    def drop(self) -> None:
        self.dropped = True

    def reply(self, key: str, payload: bytes, *, express: bool) -> None:
        self.answers.append(payload)


def test_nobody_can_make_a_stop_count_as_the_copy_of_another_question() -> None:
    handled: list[bytes] = []
    questions = TwinQuestions(lambda query: handled.append(query.payload.to_bytes()))
    questions.on_query(Asked(b"status", 5))  # type: ignore[arg-type]  # who saw the asker's last number
    questions.on_query(Asked(b"stop", 5))  # type: ignore[arg-type]
    questions.on_query(Asked(b"stop", 5, "tandem/robot-1/operator/anna/control"))  # type: ignore[arg-type]
    questions.on_query(Asked(b"stop", 5))  # type: ignore[arg-type]
    assert handled == [b"status", b"stop", b"stop"]


def test_a_copy_of_a_question_that_was_turned_away_does_not_wait() -> None:
    questions, late = TwinQuestions(lambda query: query.drop()), Asked(b"a", 1)
    questions.on_query(Asked(b"a", 1))  # type: ignore[arg-type]
    questions.on_query(late)  # type: ignore[arg-type]
    assert late.dropped


@given(st.lists(st.tuples(st.integers(0, 1), st.booleans())))
def test_a_token_is_there_while_a_path_shows_it_however_often_each_tells(
    told: list[tuple[int, bool]],
) -> None:
    class Sample:
        key_expr = "tandem/robot-1/alive/slave"

        def __init__(self, alive: bool) -> None:
            self.kind = zenoh.SampleKind.PUT if alive else zenoh.SampleKind.DELETE

    said: list[bool] = []
    tokens = TwinTokens(lambda sample: said.append(sample.kind == zenoh.SampleKind.PUT))
    shown = [False, False]
    for path, alive in told:
        shown[path] = alive
        tokens.on_sample(path, Sample(alive))  # type: ignore[arg-type]
        assert (said[-1] if said else False) == any(shown)
    assert all(one != next_one for one, next_one in pairwise(said))


class Came:
    """Stands for a zenoh.Sample."""

    key_expr = "tandem/robot-1/state"

    def __init__(self, number: int) -> None:
        self.payload, self.attachment = Said(str(number).encode()), Said(NUMBER.pack(7, number))


def test_an_older_message_of_one_path_never_replaces_a_newer_one_of_the_other() -> None:
    """The two sessions call in two threads: between "it is newer" and the mailbox the other may come."""

    class Slow(FirstArrivals):
        def is_first(self, key: str, attachment: bytes | None) -> bool:
            first = super().is_first(key, attachment)
            if attachment == NUMBER.pack(7, 5):
                other.start()
                other.join(0.1)
            return first

    async def story() -> None:
        await asyncio.sleep(0.0)
        inbox._deliver()

    heard: list[bytes] = []
    loop = asyncio.new_event_loop()
    inbox = Inbox("key", lambda key, payload, at_ns: heard.append(payload), loop, TopicCounters())
    inbox._firsts = Slow()
    other = threading.Thread(target=inbox.on_sample, args=(Came(6),))
    inbox.on_sample(Came(5))  # type: ignore[arg-type]
    other.join()
    loop.run_until_complete(story())
    loop.close()
    assert heard[-1] == b"6"


class PathAppears:
    """Stands in for a modem: until `here`, the host has no address for the second path."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
        self.here = False
        really = opening._open_off_the_loop

        async def attempt(tree: dict[str, Any]) -> zenoh.Session:
            if missing in json.dumps(tree["listen"]) and not self.here:
                raise zenoh.ZError(f"{missing}: Cannot assign requested address (os error 99)")
            return await really(tree)

        monkeypatch.setattr(opening, "_open_off_the_loop", attempt)
        monkeypatch.setattr(opening, "RETRY_S", 0.01)
        monkeypatch.setattr(opening, "MOST_RETRY_S", 0.01)


@pytest.mark.live
@pytest.mark.timeout(60)
@pytest.mark.parametrize("missing", [0, 1])
def test_a_robot_without_one_of_its_paths_answers_at_once_and_takes_the_path_up_later(
    monkeypatch: pytest.MonkeyPatch, missing: int, caplog: pytest.LogCaptureFixture
) -> None:
    async def story() -> None:
        ports = free_port("tcp"), free_port("tcp")
        listen = [f"tcp/127.0.0.1:{port}" for port in ports]
        modem = PathAppears(monkeypatch, listen[missing])
        robot = LinkConfig(listen=listen[:1], twin=TwinConfig(listen=listen[1:]))
        operator = LinkConfig(connect=listen[:1], twin=TwinConfig(connect=listen[1:]))
        async with open_session(robot) as there:
            asked: list[bytes] = []

            def answer(payload: bytes, _: int) -> bytes:
                asked.append(payload)
                return b"stopped"

            there.link(ROBOT).answer(STOP, answer)
            put_state = there.link(ROBOT).publish(STATE)
            heard: list[bytes] = []
            there.link(ROBOT).subscribe(COMMAND, lambda payload, _: heard.append(payload))
            assert listen[missing] in there.paths
            assert "os error 99" in there.paths
            async with open_session(LinkConfig(connect=[listen[1 - missing]])) as one_path:
                alone = one_path.link(ROBOT)
                await alone.connected(STOP)
                assert await alone.ask(STOP, b"stop") == b"stopped"
            modem.here = True
            await until(lambda: not there.paths)
            async with open_session(operator) as here:
                link = here.link(ROBOT)
                states: list[bytes] = []
                link.subscribe(STATE, lambda payload, _: states.append(payload))
                put = link.publish(COMMAND.of("nurse-1"))
                await link.connected(STOP)
                assert await link.ask(STOP, b"again") == b"stopped"
                await until(lambda: put(b"1") or heard)
                # what was declared before the path came is on that path too: each comes twice, counts once
                await until(lambda: put(b"2") or there.link(ROBOT).counters()[COMMAND.name].duplicates)
                await until(lambda: put_state(b"s") or link.counters()[STATE.name].duplicates)
            assert asked == [b"stop", b"again"]

    with caplog.at_level("INFO"):
        asyncio.run(story())
    assert "both paths are in use" in caplog.text


@pytest.mark.live
def test_a_path_that_comes_after_the_session_was_closed_is_closed_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def story() -> None:
        listen = [f"tcp/127.0.0.1:{free_port('tcp')}" for _ in range(2)]
        PathAppears(monkeypatch, listen[1])
        async with open_session(LinkConfig(listen=listen[:1], twin=TwinConfig(listen=listen[1:]))) as session:
            assert session.paths
        left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        if left:
            await asyncio.wait(left, timeout=5.0)
        assert all(task.done() for task in left), "nobody looks for the path any more"

    asyncio.run(story())


@pytest.mark.parametrize("wrong", [0, 1])
def test_what_no_waiting_mends_is_said_at_the_start(wrong: int) -> None:
    async def story() -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken:
            listen = [f"tcp/127.0.0.1:{free_port('tcp')}"] * 2
            listen[wrong] = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
            config = LinkConfig(listen=listen[:1], twin=TwinConfig(listen=listen[1:]))
            with pytest.raises(LinkError, match="cannot be opened"):
                async with open_session(config):
                    pass

    asyncio.run(story())


def test_without_either_path_it_waits_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        PathAppears(monkeypatch, "127.0.0.1")
        waited: list[str] = []
        listen = [f"tcp/127.0.0.1:{free_port('tcp')}" for _ in range(2)]
        config = LinkConfig(listen=listen[:1], twin=TwinConfig(listen=listen[1:]))
        with pytest.raises(LinkError, match="within 0"):
            async with open_session(config, router_within_s=0.05, waits=waited.append):
                pass
        assert any(listen[0] in words for words in waited)

    asyncio.run(story())
