"""Rules by pattern for a region of 1000 robots and 50 nurses, enforced by a real router."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from common.link.config import LinkConfig
from common.wire.topics import CONTROL, STOP
from tests.link.parties import (
    ROBOT,
    Party,
    free_port,
    link_toml,
    make_keys,
    open_party,
    reached,
    started,
    tls,
)

pytestmark = pytest.mark.live
ROBOTS = ", ".join(f'"robot-{number}"' for number in [1, *range(3, 1002)])
NURSES = "\n".join(f'nurse-{number} = ["robot-*"]' for number in range(47))
ACCESS = f"""
[link.access]
robots = [{ROBOTS}, "ward-1"]
observers = {{ screen = ["robot-*"] }}
viewers = {{ chief = ["ward-*"] }}
routers = ["hub"]
[link.access.operators]
anna = ["robot-*"]
carl = ["*"]
ben = ["ward-*"]
{NURSES}
"""
"""Everybody of `parties` is named but the stranger and robot-2, which bears a name that `robot-*` fits."""
COMMANDS = 20
WHO = {
    "anna": "operator-anna", "ben": "operator-ben", "carl": "operator-carl", "robot-2": "robot-robot-2",
    "screen": "observer-screen", "chief": "observer-chief", "stranger": "observer-stranger",
}  # fmt: skip


def test_a_stranger_is_refused_and_nobody_uses_the_key_of_another(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    make_keys(keys)
    endpoint = f"tls/127.0.0.1:{free_port('tls')}"
    robot_file, router_file = tmp_path / "robot.toml", tmp_path / "router.toml"
    router_file.write_text(link_toml(keys, "router-hub", f'listen = ["{endpoint}"]', ACCESS))
    head = f'mode = "client"\nconnect = ["{endpoint}"]'
    robot_file.write_text(f'robot = "{ROBOT}"\n' + link_toml(keys, "robot-robot-1", head, ACCESS))

    def party(name: str, who: str) -> Party:
        security = tls(keys, who, ca=keys / "ca.pem")
        return open_party(
            name, LinkConfig.model_validate({"connect": [endpoint], "mode": "client", "tls": security})
        )

    async def story() -> None:
        async with AsyncExitStack() as stack:
            command = ("-m", "deploy", "router", str(router_file))
            router = await stack.enter_async_context(started(*command, until="routing at"))
            child = str(Path(__file__).with_name("robot.py"))
            robot = await stack.enter_async_context(started(child, str(robot_file), until="here"))
            inside = {name: party(name, who) for name, who in WHO.items()}

            def they_are_heard() -> bool:
                for each in reversed(inside.values()):
                    for key_of in ("anna", "carl", each.name):
                        each.command(key_of)
                return min(robot.heard.get(own, 0) for own in ("anna as anna", "carl as carl")) >= COMMANDS

            await reached(they_are_heard, robot, "the commands of anna and carl")
            assert set(robot.heard) == {"anna as anna", "carl as carl"}
            await reached(lambda: inside["screen"].states > 0 < inside["anna"].seen, robot, "the state")
            assert {who for who, each in inside.items() if each.seen} == {"anna", "carl"}
            assert {who for who, each in inside.items() if each.states} == {"anna", "carl", "screen"}
            for own in ("anna", "carl", "ben"):
                control = CONTROL.of(own)
                asking = {w for w, each in inside.items() if await asyncio.to_thread(each.answered, control)}
                assert asking == ({own} - {"ben"})
            stopping = {w for w, each in inside.items() if await asyncio.to_thread(each.answered, STOP)}
            assert stopping == set(inside) - {"stranger", "robot-2"}
            for who in ("observer:stranger", "robot:robot-2"):
                said = f"{who} connected: [link.access] does not name it"
                await reached(lambda said=said: router.said(said), router, said)
            for each in inside.values():
                each.session.close()

    asyncio.run(story())
