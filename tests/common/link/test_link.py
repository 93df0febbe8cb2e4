import asyncio
import logging
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import uvloop
import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns
from common.errors import LinkError, LinkTimeoutError
from common.link import Link, LinkSession, open_link, open_session
from common.link.config import LinkConfig, TopicConfig
from common.link.connected import Connected
from common.link.declared import Declarations
from common.link.presence import watch_presence
from common.link.queries import MAX_WAITING, Answerer
from common.metrics.link import TopicCounters
from common.wire.presence import ProcessPresence
from common.wire.stop import pack_stop
from common.wire.topics import CLOCK, COMMAND, CONTROL, STATE, VIDEO, Priority

ROBOT = "robot-1"
DEADLINE_S = 10.0
PROTOCOLS = ["tcp", "udp", "ws", "unixsock-stream"]


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(30):
            await test()

    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(bounded())


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint(protocol: str = "tcp", folder: Path = Path()) -> str:
    if protocol == "unixsock-stream":
        return f"unixsock-stream/{folder}/link"
    kind = socket.SOCK_DGRAM if protocol == "udp" else socket.SOCK_STREAM
    return f"{protocol}/127.0.0.1:{free_port(kind)}"


@asynccontextmanager
async def pair(endpoint: str) -> AsyncIterator[tuple[Link, Link]]:
    """The side that listens and the side that connects, connected."""
    async with (
        open_link(LinkConfig(listen=[endpoint]), ROBOT) as slave,
        open_link(LinkConfig(connect=[endpoint]), ROBOT) as master,
    ):
        await master.connected()
        yield slave, master


async def until(condition: Callable[[], object], again: Callable[[], object] = lambda: None) -> None:
    """Look, and do something, every 5 ms until a condition holds."""
    async with asyncio.timeout(DEADLINE_S):
        while not condition():
            again()
            await asyncio.sleep(0.005)


class Heard:
    """What a subscriber was given."""

    def __init__(self) -> None:
        self.payloads: list[bytes] = []
        self.arrivals: list[int] = []

    def __call__(self, payload: bytes, arrived_ns: int) -> None:
        self.payloads.append(payload)
        self.arrivals.append(arrived_ns)


async def heard_through(publish: Callable[[bytes], None], heard: Heard, payload: bytes) -> None:
    """Put until the subscriber is found and has heard it: what is put before that is lost by design."""
    await until(lambda: payload in heard.payloads, lambda: publish(payload))


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_payloads_and_answers_pass_over_each_protocol(protocol: str, tmp_path: Path) -> None:
    async def test() -> None:
        async with pair(free_endpoint(protocol, tmp_path)) as (slave, master):
            heard = Heard()
            slave.subscribe(COMMAND, heard)
            slave.answer(CLOCK, lambda payload, arrived_ns: payload + b"!")
            publish = master.publish(COMMAND.of("anna"))
            await heard_through(publish, heard, b"first")
            before_ns = monotonic_ns()
            await heard_through(publish, heard, bytes(300))
            assert before_ns <= heard.arrivals[-1] <= monotonic_ns()
            await master.connected(CLOCK)
            assert await master.ask(CLOCK, b"hello") == b"hello!"
            assert slave.counters()["clock"].answered == 1
            assert master.counters()["command"].sent >= len(heard.payloads)
            assert master.counters()["command"].put_errors == 0

    run(test)


FILE_S_OWN = {"command": TopicConfig(priority=Priority.DATA_LOW, express=False)}


@pytest.mark.parametrize(
    ("topics", "priority", "express"),
    [({}, zenoh.Priority.REAL_TIME, True), (FILE_S_OWN, zenoh.Priority.DATA_LOW, False)],
    ids=["table", "file"],
)
def test_the_quality_of_service_is_that_of_the_table_or_the_file(
    topics: dict[str, TopicConfig], priority: zenoh.Priority, express: bool
) -> None:
    async def test() -> None:
        endpoint = free_endpoint()
        samples: list[zenoh.Sample] = []
        settings = zenoh.Config.from_json5(f'{{mode: "peer", listen: {{endpoints: ["{endpoint}"]}}}}')
        settings.insert_json5("scouting/multicast/enabled", "false")
        with zenoh.open(settings) as raw:
            raw.declare_subscriber(f"tandem/{ROBOT}/**", Callback(samples.append, indirect=False))
            async with open_link(LinkConfig(connect=[endpoint], topics=topics), ROBOT) as link:
                command, state = link.publish(COMMAND.of("anna")), link.publish(STATE)
                await until(
                    lambda: len({str(s.key_expr) for s in samples}) == 2, lambda: (command(b"c"), state(b"s"))
                )
        by_key = {str(s.key_expr): s for s in samples}
        sample = by_key[f"tandem/{ROBOT}/operator/anna/command"]
        assert sample.priority == priority
        assert sample.congestion_control == zenoh.CongestionControl.DROP
        assert sample.express == express
        assert by_key[f"tandem/{ROBOT}/state"].priority == zenoh.Priority.INTERACTIVE_HIGH

    run(test)


def test_a_topic_that_would_block_is_refused() -> None:
    async def test() -> None:
        blocking = type(COMMAND)(
            "bulk", "tandem/{robot}/bulk", 1.0, 0.0, COMMAND.priority, True, False, False
        )
        async with open_link(LinkConfig(listen=[free_endpoint()]), ROBOT) as link:
            with pytest.raises(ValueError, match="stall the loop"):
                link.publish(blocking)

    run(test)


def test_a_link_does_not_hear_itself() -> None:
    async def test() -> None:
        async with pair(free_endpoint()) as (slave, master):
            own, other = Heard(), Heard()
            master.subscribe(COMMAND, own)
            slave.subscribe(COMMAND, other)
            await heard_through(master.publish(COMMAND.of("anna")), other, b"of master")
            await heard_through(slave.publish(COMMAND.of("anna")), own, b"of slave")
            assert set(own.payloads) == {b"of slave"}
            assert set(other.payloads) == {b"of master"}
            master.answer(CONTROL, lambda payload, _: b"own answer")
            with pytest.raises(LinkError, match="no process"):
                await master.ask(CONTROL.of("anna"), b"")

    run(test)


def test_the_newest_payload_wins_and_the_others_are_counted() -> None:
    async def test() -> None:
        async with pair(free_endpoint()) as (slave, master):
            heard = Heard()
            slave.subscribe(COMMAND, heard)
            publish = master.publish(COMMAND.of("anna"))
            await heard_through(publish, heard, b"ready")
            publish(b"fence")  # in order: when it is heard, nothing is under way
            await until(lambda: b"fence" in heard.payloads)
            before, delivered = slave.counters()["command"], len(heard.payloads)
            for i in range(5):
                publish(b"%d" % i)
            # the loop is held here on purpose, until all five are in
            deadline = time.monotonic() + DEADLINE_S
            while slave.counters()["command"].received < before.received + 5:
                assert time.monotonic() < deadline
                time.sleep(0.001)  # noqa: ASYNC251
            await until(lambda: len(heard.payloads) > delivered)
            assert heard.payloads[delivered:] == [b"4"]
            assert slave.counters()["command"].overwritten == before.overwritten + 4

    run(test)


def test_a_command_put_before_the_subscriber_existed_never_reaches_it() -> None:
    async def test() -> None:
        async with pair(free_endpoint()) as (slave, master):
            witness, late = Heard(), Heard()
            slave.subscribe(COMMAND, witness)
            publish = master.publish(COMMAND.of("anna"))
            await heard_through(publish, witness, b"old")
            slave.subscribe(COMMAND, late)
            await heard_through(publish, late, b"new")
            assert set(late.payloads) == {b"new"}

    run(test)


def test_a_failing_handler_is_counted_logged_once_and_survived(caplog: pytest.LogCaptureFixture) -> None:
    failures: list[bytes] = []

    async def test() -> None:
        async with pair(free_endpoint()) as (slave, master):
            heard = Heard()

            def on_payload(payload: bytes, arrived_ns: int) -> None:
                heard(payload, arrived_ns)
                if payload == b"bad":
                    failures.append(payload)
                    raise KeyError("planted")

            slave.subscribe(COMMAND, on_payload)
            publish = master.publish(COMMAND.of("anna"))
            await heard_through(publish, heard, b"bad")
            first = len(heard.payloads)
            await until(lambda: len(heard.payloads) > first, lambda: publish(b"bad"))
            await heard_through(publish, heard, b"good")
            assert slave.counters()["command"].handler_errors == len(failures) >= 2

    with caplog.at_level(logging.ERROR):
        run(test)
    assert 1 <= len(caplog.records) < len(failures)  # at most one a second


def test_a_failing_answer_is_told_to_who_asked_and_the_next_one_passes() -> None:
    async def test() -> None:
        async with pair(free_endpoint()) as (slave, master):

            def handler(payload: bytes, _: int) -> bytes:
                if payload == b"bad":
                    raise KeyError("planted")
                return b"fine"

            slave.answer(CONTROL, handler)
            await master.connected(CONTROL.of("anna"))
            with pytest.raises(LinkError, match="planted") as caught:
                await master.ask(CONTROL.of("anna"), b"bad")
            assert not isinstance(caught.value, LinkTimeoutError)
            assert await master.ask(CONTROL.of("anna"), b"good") == b"fine"
            assert slave.counters()["control"].handler_errors == 1
            asked = master.counters()["control"]
            assert (asked.asked, asked.unanswered, asked.timeouts) == (2, 1, 0)

    run(test)


def test_questions_wait_for_the_loop_only_up_to_a_limit() -> None:
    class Query:
        payload = None
        key_expr = "key"
        refused = ""

        def __enter__(self) -> None: ...

        def __exit__(self, *_: object) -> None: ...

        def reply_err(self, text: str) -> None:
            self.refused = text

        def reply(self, *_: object, **__: object) -> None: ...

    async def test() -> None:
        counters = TopicCounters()
        answerer = Answerer("key", lambda *_: b"", asyncio.get_running_loop(), counters)
        queries: list[Any] = [Query() for _ in range(MAX_WAITING + 1)]
        for query in queries:
            answerer.on_query(query)
        assert [q.refused for q in queries] == [""] * MAX_WAITING + ["busy"]
        stop: Any = Query()
        stop.payload = SimpleNamespace(to_bytes=lambda: pack_stop(ROBOT, "anna"))
        answerer.on_query(stop)
        assert stop.refused == ""  # no flood keeps a person from stopping the robot
        await until(lambda: counters.answered == MAX_WAITING + 1)
        assert counters.refused == 1
        answerer.on_query(queries[0])
        await until(lambda: counters.answered == MAX_WAITING + 2)

    run(test)


def test_a_question_that_nobody_can_answer_fails_at_once() -> None:
    async def test() -> None:
        async with open_link(LinkConfig(connect=[free_endpoint()]), ROBOT) as alone:
            with pytest.raises(LinkError, match="no process") as caught:
                await alone.ask(CONTROL.of("anna"), b"")
            assert not isinstance(caught.value, LinkTimeoutError)
            with pytest.raises(LinkTimeoutError, match="no link to anyone who answers"):
                await alone.connected(CONTROL.of("anna"), timeout_s=0.05)
            with pytest.raises(LinkTimeoutError, match="no link to another session"):
                await alone.connected(timeout_s=0.05)
        async with pair(free_endpoint()) as (_, master):
            with pytest.raises(LinkError, match="no process"):
                await master.ask(CONTROL.of("anna"), b"")

    run(test)


def test_a_question_that_is_not_answered_times_out() -> None:
    async def test() -> None:
        endpoint = free_endpoint()
        kept: list[zenoh.Query] = []
        settings = zenoh.Config.from_json5(f'{{mode: "peer", listen: {{endpoints: ["{endpoint}"]}}}}')
        settings.insert_json5("scouting/multicast/enabled", "false")
        with zenoh.open(settings) as raw:
            raw.declare_queryable(CLOCK.key_for(ROBOT), Callback(kept.append, indirect=False))
            async with open_link(LinkConfig(connect=[endpoint]), ROBOT) as link:
                await link.connected(CLOCK)
                begun_ns = monotonic_ns()
                with pytest.raises(LinkTimeoutError, match=r"no answer within 1 s"):
                    await link.ask(CLOCK, b"")
                assert monotonic_ns() - begun_ns >= 0.9e9
                assert link.counters()["clock"].timeouts == 1
        for query in kept:
            query.drop()

    run(test)


def test_either_side_may_start_first_and_come_back() -> None:
    async def test() -> None:
        endpoint = free_endpoint()
        async with open_link(LinkConfig(connect=[endpoint]), ROBOT) as master:
            publish = master.publish(COMMAND.of("anna"))
            publish(b"to nobody")
            for life in (b"first", b"second"):
                async with open_link(LinkConfig(listen=[endpoint]), ROBOT) as slave:
                    heard = Heard()
                    slave.subscribe(COMMAND, heard)
                    await heard_through(publish, heard, life)
                    assert set(heard.payloads) == {life}

    run(test)


def test_an_observer_hears_both_sides_through_two_endpoints() -> None:
    async def test() -> None:
        of_slave, of_master = free_endpoint(), free_endpoint()
        async with (
            open_link(LinkConfig(listen=[of_slave]), ROBOT) as slave,
            open_link(LinkConfig(listen=[of_master], connect=[of_slave]), ROBOT) as master,
            open_link(LinkConfig(connect=[of_slave, of_master]), ROBOT) as observer,
        ):
            commands, states = Heard(), Heard()
            observer.subscribe(COMMAND, commands)
            observer.subscribe(STATE, states)
            await heard_through(master.publish(COMMAND.of("anna")), commands, b"command")
            await heard_through(slave.publish(STATE), states, b"state")
            assert observer.peers == 2

    run(test)


def test_a_link_that_cannot_be_opened_says_why_in_one_line() -> None:
    async def test() -> None:
        taken = free_endpoint()
        async with open_link(LinkConfig(listen=[taken]), ROBOT):
            await refused(LinkConfig(listen=[taken]), "Address already in use")
        await refused(LinkConfig(listen=[free_endpoint("tls")]), "private key")
        await refused(LinkConfig(), "set `listen` or `connect`")
        await refused(LinkConfig(listen=[taken]), "expected a name", robot="a/**")

    async def refused(config: LinkConfig, why: str, robot: str = ROBOT) -> None:
        with pytest.raises(LinkError, match=why) as caught:
            async with open_link(config, robot):
                pass
        assert "\n" not in str(caught.value)
        assert ".rs:" not in str(caught.value)

    run(test)


def test_a_put_after_the_end_is_counted_and_a_question_refused() -> None:
    async def test() -> None:
        async with open_link(LinkConfig(listen=[free_endpoint()]), ROBOT) as link:
            publish = link.publish(COMMAND.of("anna"))
        publish(b"late")
        assert link.counters()["command"].put_errors == 1
        assert link.peers == 0
        with pytest.raises(LinkError, match="closed"):
            await link.ask(CLOCK, b"")

    run(test)


class HangingSession:
    """A session on a link that leads nowhere."""

    def close(self) -> None:
        time.sleep(60)


def test_closing_is_bounded_and_off_the_loop() -> None:
    async def test() -> None:
        session: Any = HangingSession()
        link = LinkSession(session, asyncio.get_running_loop())
        turns = 0

        async def other_work() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0.001)

        work = asyncio.create_task(other_work())
        closed: Awaitable[bool] = link.close(timeout_s=0.05)
        assert await closed is False
        assert turns > 3
        work.cancel()
        assert await link.close() is True  # once is enough

    run(test)


def test_one_session_serves_many_robots_and_keeps_them_apart() -> None:
    async def test() -> None:
        ends = {f"robot-{i}": free_endpoint() for i in (1, 2)}
        seen: list[tuple[str, bool]] = []
        async with (
            open_link(LinkConfig(listen=[ends["robot-1"]]), "robot-1") as first,
            open_session(LinkConfig(connect=list(ends.values()))) as session,
        ):
            session.watch_presence(lambda process, alive: seen.append((process.robot, alive)))
            links = {robot: session.link(robot) for robot in ends}
            assert session.link("robot-1") is links["robot-1"]
            heard = {robot: Heard() for robot in ends}
            first.subscribe(COMMAND, heard["robot-1"])
            first.declare_alive("slave")
            await heard_through(links["robot-1"].publish(COMMAND.of("anna")), heard["robot-1"], b"for 1")
            async with open_link(LinkConfig(listen=[ends["robot-2"]]), "robot-2") as second:
                second.subscribe(COMMAND, heard["robot-2"])
                second.answer(CONTROL, lambda payload, _: b"robot-2")
                second.declare_alive("slave")
                await heard_through(links["robot-2"].publish(COMMAND.of("anna")), heard["robot-2"], b"for 2")
                await links["robot-2"].connected(CONTROL.of("anna"))
                assert await links["robot-2"].ask(CONTROL.of("anna"), b"") == b"robot-2"
                with pytest.raises(LinkError, match="no process"):
                    await links["robot-1"].ask(CONTROL.of("anna"), b"")
                await until(lambda: len(seen) == 2)
                assert session.peers == 2
            await until(lambda: len(seen) == 3)
            # the other went, this one goes on
            await heard_through(
                links["robot-1"].publish(COMMAND.of("anna")), heard["robot-1"], b"again for 1"
            )
        assert set(heard["robot-2"].payloads) == {b"for 2"}
        assert seen == [("robot-1", True), ("robot-2", True), ("robot-2", False)]

    run(test)


def test_a_client_waits_for_its_router_and_tries_each_in_turn(caplog: pytest.LogCaptureFixture) -> None:
    async def test() -> None:
        dead, late = free_endpoint(), free_endpoint()
        config = LinkConfig(mode="client", connect=[dead, late])
        async with AsyncExitStack() as stack:
            opening = asyncio.create_task(stack.enter_async_context(open_link(config, ROBOT)))
            await until(lambda: "no router answered" in caplog.text)
            assert not opening.done()
            router = await stack.enter_async_context(open_session(LinkConfig(listen=[late]), "router"))
            link = await opening
            await until(lambda: router.peers == link.peers == 1)

    run(test)


def test_a_client_that_gives_up_waiting_leaves_nothing_behind(caplog: pytest.LogCaptureFixture) -> None:
    async def test() -> None:
        config = LinkConfig(mode="client", connect=[free_endpoint()])
        opening = asyncio.create_task(open_link(config, ROBOT).__aenter__())
        await until(lambda: "no router answered" in caplog.text)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening

    run(test)


def test_who_only_asks_does_not_wait_for_a_router_for_ever() -> None:
    async def test() -> None:
        dead = free_endpoint()
        with pytest.raises(LinkError, match=f"no router answered at {dead} within 0.2 s"):
            async with open_session(LinkConfig(mode="client", connect=[dead]), router_within_s=0.2):
                raise AssertionError("there is no router")

    run(test)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_two_clients_meet_through_a_router(protocol: str, tmp_path: Path) -> None:
    async def test() -> None:
        endpoint = free_endpoint(protocol, tmp_path)
        through = LinkConfig(mode="client", connect=[endpoint])
        async with (
            open_session(LinkConfig(listen=[endpoint]), "router"),
            open_link(through, ROBOT) as slave,
            open_link(through, ROBOT) as master,
        ):
            heard, alive = Heard(), dict[str, bool]()
            slave.subscribe(COMMAND, heard)
            slave.answer(CLOCK, lambda payload, _: payload)
            slave.declare_alive("slave")
            master.watch_presence(lambda process, here: alive.update({process.role: here}))
            await heard_through(master.publish(COMMAND.of("anna")), heard, b"command")
            await master.connected(CLOCK)
            assert await master.ask(CLOCK, b"hello") == b"hello"
            await until(lambda: alive == {"slave": True})

    run(test)


class Links:
    """Stands for Zenoh's session as far as it tells of links."""

    def __init__(self) -> None:
        self.info = self

    def declare_link_events_listener(self, handler: Any, history: bool) -> object:
        self.handler = handler
        return history

    def tell(
        self,
        session_id: str,
        here: bool,
        name: str | None = None,
        reliability: str = "reliable",
        port: int = 1,
    ) -> None:
        kind = zenoh.SampleKind.PUT if here else zenoh.SampleKind.DELETE
        link = SimpleNamespace(
            zid=session_id, auth_identifier=name, src="tcp/here:7447", dst=f"tcp/there:{port}",
            reliability=reliability,
        )  # fmt: skip
        self.handler(SimpleNamespace(kind=kind, link=link))


def test_who_goes_is_named_as_he_came_and_forgotten_then() -> None:
    heard: list[tuple[str, str, bool]] = []

    async def test() -> None:
        links = Links()
        session = LinkSession(links, asyncio.get_running_loop())  # type: ignore[arg-type]
        session.watch_peers(lambda *change: heard.append(change))
        links.tell("a", True, "operator:anna")
        links.tell("a", True, "operator:anna", "best effort")  # a second link, as quic-datagram has
        links.tell("a", True, "operator:anna", port=2)  # and one of another path
        links.tell("b", True)
        for reliability in ("reliable", "best effort"):
            links.tell("a", False, reliability=reliability)
        links.tell("b", False)
        links.tell("a", False, port=2)
        await until(lambda: len(heard) == 8)

    run(test)
    anna = "operator:anna"
    assert heard == [
        ("a", anna, True), ("a", anna, True), ("a", anna, True), ("b", "", True),
        ("a", anna, False), ("a", anna, False), ("b", "", False), ("a", anna, False),
    ]  # fmt: skip


def test_a_link_of_which_zenoh_tells_twice_is_one_link() -> None:
    """Told while the listener was declared and again by its history: who has gone stayed for ever."""
    connected = Connected()
    heard: list[bool] = []

    async def test() -> None:
        links = Links()
        session = LinkSession(links, asyncio.get_running_loop())  # type: ignore[arg-type]

        def on_change(*change: *tuple[str, str, bool]) -> None:
            heard.append(change[2])
            connected.on_change(*change)

        session.watch_peers(on_change)
        for here in (True, True, False, False, True, False):
            links.tell("a", here, "operator:anna")
        await until(lambda: len(heard) == 4)

    run(test)
    assert heard == [True, False, True, False]
    assert not connected.names


class Tokens:
    """Stands for Zenoh's session as far as it tells of liveliness tokens."""

    def liveliness(self) -> Any:
        return self

    def declare_subscriber(self, keys: str, handler: Any, history: bool) -> object:
        self.handler = handler.callback
        return history

    def tell(self, key: str, here: bool) -> None:
        kind = zenoh.SampleKind.PUT if here else zenoh.SampleKind.DELETE
        self.handler(SimpleNamespace(kind=kind, key_expr=key))


def test_who_goes_in_a_session_that_was_replaced_has_not_gone_in_the_new_one() -> None:
    """One that leads nowhere closes long after another is in use; nobody would come a second time in that."""
    linked: list[bool] = []
    shown: list[bool] = []

    async def test() -> None:
        loop = asyncio.get_running_loop()
        before, after = Links(), Links()
        session = LinkSession(before, loop)  # type: ignore[arg-type]
        session.watch_peers(lambda *change: linked.append(change[2]))
        session._declared.move(after)  # type: ignore[arg-type]
        after.tell("router", True)
        before.tell("router", False)

        old, new = Tokens(), Tokens()
        of_tokens, key = Declarations(old), ProcessPresence(ROBOT, "slave", 7, 6).key  # type: ignore[arg-type]
        watch_presence(of_tokens, loop, ROBOT, lambda _, here: shown.append(here))
        of_tokens.move(new)  # type: ignore[arg-type]
        new.tell(key, True)
        old.tell(key, False)
        new.tell(key, False)
        await until(lambda: len(shown) == 2)

    run(test)
    assert linked == [True]
    assert shown == [True, False]


class Topics:
    """Stands for Zenoh's session as far as it hears messages and questions and tells who listens."""

    def __init__(self) -> None:
        self.handlers: dict[str, Callable[[Any], None]] = {}
        self.matching_status = False

    def declare_subscriber(self, key: str, handler: Any) -> None:
        self.handlers[key] = handler.callback

    def declare_queryable(self, key: str, handler: Any, complete: bool) -> None:
        self.handlers[key] = handler.callback

    def declare_publisher(self, key: str, **_: object) -> Any:
        return self

    def put(self, payload: bytes) -> None: ...

    def declare_matching_listener(self, changed: Any) -> None:
        self.handlers["matching"] = changed.callback


class Bytes(bytes):
    """Stands for a zenoh.ZBytes."""

    def to_bytes(self) -> bytes:
        return bytes(self)


class Question:
    """Stands for a zenoh.Query."""

    def __init__(self, key: str, payload: bytes) -> None:
        self.key_expr, self.payload = key, Bytes(payload)
        self.answers: list[bytes] = []
        self.dropped = False

    def __enter__(self) -> object:
        return self

    def __exit__(self, *_: object) -> None: ...

    def drop(self) -> None:
        self.dropped = True

    def reply(self, key: str, payload: bytes, *, express: bool) -> None:
        self.answers.append(payload)


def test_a_session_that_was_replaced_may_do_nothing_but_stop() -> None:
    """It may live on for long, and lets in whom the new one's rules refuse."""
    heard: list[bytes] = []
    wanted: list[bool] = []
    key, questions = STATE.key_for(ROBOT), "tandem/robot-1/operator/anna/control"

    async def test() -> None:
        old, new = Topics(), Topics()
        declared = Declarations(old)  # type: ignore[arg-type]
        link = Link(declared, ROBOT, asyncio.get_running_loop())
        link.subscribe(STATE, lambda payload, _: heard.append(payload))
        link.answer(CONTROL, lambda payload, _: b"done")
        link.publish(VIDEO, on_wanted=wanted.append)
        declared.move(new)  # type: ignore[arg-type]
        asked: list[Question] = []
        for session, words in ((old, b"revoked"), (new, b"here")):
            sample = SimpleNamespace(attachment=None, key_expr=key, payload=Bytes(words))
            session.handlers[key](sample)
            for payload in (b"engage", pack_stop(ROBOT, "anna")):
                asked.append(Question(questions, payload))
                session.handlers[CONTROL.key_for(ROBOT)](asked[-1])
        new.handlers["matching"](True)
        old.handlers["matching"](False)
        await until(lambda: heard and asked[-1].answers)
        assert [bool(one.answers) for one in asked] == [False, True, True, True]
        assert [one.dropped for one in asked] == [True, False, False, False], "the asker need not wait"

    run(test)
    assert heard == [b"here"]
    assert wanted[-1], "somebody looks at the pictures, whatever the old session still tells"
