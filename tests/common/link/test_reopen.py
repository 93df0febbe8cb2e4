"""A session that is opened anew: all that was declared is there again, and who went is said to have gone."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import zenoh

from common.errors import LinkError
from common.link import link_session, open_session
from common.link.config import LinkConfig
from common.link.opening import open_zenoh
from common.wire.presence import ProcessPresence
from common.wire.topics import CLOCK, COMMAND, STATE
from tests.common.link.test_link import ROBOT, Heard, free_endpoint, heard_through, run, until

# another test beside it may take the port between two sessions
pytestmark = pytest.mark.live


def test_everything_is_declared_again_in_the_new_session(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_session, "REOPEN_S", 0.0)

    async def test() -> None:
        endpoint = free_endpoint()
        listening = LinkConfig(listen=[endpoint])
        tries: list[frozenset[str]] = []

        async def open_again(refused: frozenset[str]) -> zenoh.Session:
            tries.append(refused)
            if len(tries) < 3:
                raise LinkError("Address already in use")
            return await open_zenoh(listening)

        async with (
            open_session(listening) as robot,
            open_session(LinkConfig(connect=[endpoint])) as operator,
        ):
            mine, his = robot.link(ROBOT), operator.link(ROBOT)
            commands, states = Heard(), Heard()
            shown: list[tuple[str, bool]] = []
            peers: list[bool] = []

            def on_presence(presence: ProcessPresence, here: bool) -> None:
                if presence.instance:
                    shown.append((presence.role, here))

            mine.subscribe(COMMAND, commands)
            mine.answer(CLOCK, lambda payload, _: payload)
            mine.watch_presence(on_presence)
            robot.watch_peers(lambda *event: peers.append(event[2]))
            put_state = mine.publish(STATE)
            his.subscribe(STATE, states)
            his.declare_alive("master", 7)
            put_command: Callable[[bytes], None] = his.publish(COMMAND.of("anna"))
            await heard_through(put_command, commands, b"before")
            await heard_through(put_state, states, b"before")
            await until(lambda: shown == [("master", True)])

            robot.revoke(frozenset({"operator:ben"}))
            await robot.reopen(open_again)
            assert tries == [frozenset({"operator:ben"})] * 3, "tried until it opened"
            assert robot.refused == {"operator:ben"}
            await heard_through(put_command, commands, b"after")
            await heard_through(put_state, states, b"after")
            await his.connected(CLOCK)
            assert await his.ask(CLOCK, b"again") == b"again"
            await until(lambda: shown == [("master", True), ("master", False), ("master", True)])
            await until(lambda: peers == [True, False, True])
            assert mine.peers == 1

    run(test)


def test_between_two_sessions_what_is_put_is_counted_as_not_sent() -> None:
    async def test() -> None:
        async with open_session(LinkConfig(listen=[free_endpoint()])) as robot:
            link = robot.link(ROBOT)
            put = link.publish(STATE)

            async def open_again(_: frozenset[str]) -> zenoh.Session:
                put(b"meanwhile")
                return await open_zenoh(LinkConfig(listen=[free_endpoint()]))

            await robot.reopen(open_again)
            put(b"after")
            assert link.counters()["state"].put_errors == 1
            assert link.counters()["state"].sent == 1

    run(test)


def test_a_session_that_leads_nowhere_is_replaced_and_one_that_is_not_needed_is_closed() -> None:
    async def test() -> None:
        endpoint = free_endpoint()
        listening = LinkConfig(listen=[endpoint])
        nowhere = LinkConfig(connect=["tcp/127.0.0.1:9"])
        async with open_session(listening) as robot, open_session(nowhere) as operator:
            mine, his = robot.link(ROBOT), operator.link(ROBOT)
            commands, states = Heard(), Heard()
            mine.subscribe(COMMAND, commands)
            his.subscribe(STATE, states)
            put_command: Callable[[bytes], None] = his.publish(COMMAND.of("anna"))
            refused = frozenset({"operator:ben"})
            opened = await open_zenoh(LinkConfig(connect=[endpoint]))
            assert await operator.replace(opened, refused)
            assert operator.refused == refused
            await heard_through(put_command, commands, b"after")
            await heard_through(mine.publish(STATE), states, b"after")
            late = await open_zenoh(LinkConfig(connect=[endpoint]))
            assert not await operator.replace(late, frozenset(), lambda: False)
            assert late.is_closed()
            assert not opened.is_closed()

    run(test)
