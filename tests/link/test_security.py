"""Who may do what, on every secure transport, directly and through a router: refused, counted and logged.

The one who may stands beside those who may not: each puts a command in turn, and only what the first one put
may arrive. The rules are those of the robot's or the router's process; the others obey none.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

from common.link.config import LinkConfig
from common.link.endpoint import SECURE
from common.wire.topics import CONTROL, STOP
from tests.link.parties import (
    ROBOT,
    Party,
    Process,
    free_port,
    link_toml,
    make_keys,
    open_party,
    reached,
    started,
    tls,
)

pytestmark = pytest.mark.live
COMMANDS = 20
BOTH = {"anna as anna", "carl as carl"}
"""Two operators of one robot: each is heard on the own key alone."""
OF_ANNA = "tandem/robot-1/operator/anna/command"
REFUSED_AT_THE_DOOR = {
    "rogue": "certificate: ",
    "expired": "certificate expired",
    "none": "peer sent no certificates",
}


@pytest.fixture(name="keys", scope="module")
def some_keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder)
    return folder


@asynccontextmanager
async def place(
    transport: str, routed: bool, keys: Path, folder: Path, more: str = ""
) -> AsyncIterator[tuple[str, Process, Process]]:
    """The endpoint where everybody connects, the robot, and who refuses: the router, or the robot itself.

    `more`: further lines of each one's [link].
    """
    endpoint = f"{transport}/127.0.0.1:{free_port(transport)}"
    robot_file, router_file = folder / "robot.toml", folder / "router.toml"
    child = str(Path(__file__).with_name("robot.py"))
    async with AsyncExitStack() as stack:
        if not routed:
            head = f'listen = ["{endpoint}"]\n{more}'
        else:
            router_file.write_text(link_toml(keys, "router-hub", f'listen = ["{endpoint}"]\n{more}'))
            command = ("-m", "deploy", "router", str(router_file), "--metrics", str(folder / "metrics.json"))
            router = await stack.enter_async_context(started(*command, until="routing at"))
            head = f'mode = "client"\nconnect = ["{endpoint}"]\n{more}'
        robot_file.write_text(f'robot = "{ROBOT}"\n' + link_toml(keys, "robot-robot-1", head))
        robot = await stack.enter_async_context(started(child, str(robot_file), until="here"))
        yield endpoint, robot, router if routed else robot


def parties(endpoint: str, keys: Path) -> tuple[dict[str, Party], dict[str, Party]]:
    """Those who have a certificate of this authority, and those who have none that is good."""

    def link(mode: str, folder: Path, who: str) -> LinkConfig:
        security = tls(folder, who, ca=keys / "ca.pem")
        return LinkConfig.model_validate({"connect": [endpoint], "mode": mode, "tls": security})

    names = {
        "anna": "operator-anna", "ben": "operator-ben", "carl": "operator-carl", "robot-2": "robot-robot-2",
        "screen": "observer-screen", "chief": "observer-chief", "stranger": "observer-stranger",
    }  # fmt: skip
    inside = {name: open_party(name, link("client", keys, who)) for name, who in names.items()}
    outside = {
        name: open_party(name, link("peer", keys / name, "operator-anna")) for name in ("rogue", "expired")
    }
    outside["none"] = open_party("none", link("peer", keys, "operator-anna"), certificate=False)
    return inside, outside


@pytest.mark.parametrize("routed", [False, True], ids=["direct", "routed"])
@pytest.mark.parametrize("transport", SECURE)
def test_nobody_does_what_he_may_not(transport: str, routed: bool, keys: Path, tmp_path: Path) -> None:
    async def story() -> None:
        async with place(transport, routed, keys, tmp_path) as (endpoint, robot, guard):
            inside, outside = parties(endpoint, keys)
            everybody = [*outside.values(), *reversed(inside.values())]

            def anna_is_heard() -> bool:
                for party in everybody:
                    party.command(key_of="anna")
                    if party.name != "anna":
                        party.command(key_of="ben")
                inside["carl"].command(key_of="carl")
                fewest = min(robot.heard.get(each, 0) for each in BOTH)
                return fewest >= COMMANDS and inside["anna"].seen >= COMMANDS

            await reached(anna_is_heard, robot, "anna's commands")
            assert set(robot.heard) == BOTH
            assert inside["chief"].seen >= 1
            assert inside["screen"].states >= 1
            may_see = {"anna", "carl", "chief"}
            assert {party.name for party in everybody if party.seen} == may_see
            assert {party.name for party in everybody if party.states} == {*may_see, "screen"}
            for own in ("anna", "carl"):
                control = CONTROL.of(own)
                asking = {p.name for p in inside.values() if await asyncio.to_thread(p.answered, control)}
                assert asking == {own}
            stopping = {p.name for p in inside.values() if await asyncio.to_thread(p.answered, STOP)}
            assert stopping == set(inside) - {"stranger"}
            for who, why in REFUSED_AT_THE_DOOR.items():
                await reached(lambda why=why: guard.said(why), guard, f"the refusal of {who}")
                assert not outside[who].session.info.peers_zid()
            for who, what in (
                ("operator:ben", f"Put {OF_ANNA}"),
                ("operator:carl", f"Put {OF_ANNA}"),
                ("robot:robot-2", f"Put {OF_ANNA}"),
                ("observer:screen", "Declare Subscriber tandem/robot-1/video/head"),
            ):
                await reached(
                    lambda w=who, s=what: guard.said(f"{w} was refused: {s}"), guard, f"{who} {what}"
                )
            assert not guard.said("operator:anna was refused: Put")
            assert guard.said("observer:stranger connected: [link.access] does not name it")
            for party in everybody:
                party.session.close()
            await guard.stop()
            file = tmp_path / "metrics.json"
            counted = (json.loads(file.read_text()) if routed else guard.figures)["refused"]
            put, look = f"Put {OF_ANNA}", "Declare Subscriber tandem/robot-1/video/head"
            puts = {who: kinds.get(put, 0) for who, kinds in counted["messages"].items()}
            assert puts.get("operator:anna", 0) == 0, "anna asked on a key that is not hers, at most"
            assert (
                min(puts[who] for who in ("operator:ben", "operator:carl", "robot:robot-2", "observer:chief"))
                >= COMMANDS
            )
            assert counted["messages"]["observer:stranger"][look] == 1
            assert sorted(counted["handshakes"]) == [
                "invalid peer certificate: BadSignature",
                "invalid peer certificate: certificate expired",
                "peer sent no certificates",
            ]

    asyncio.run(story())
