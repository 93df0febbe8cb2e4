"""Two operators with good certificates at one real slave, directly and through a router.

One cannot claim as the other, write on the other's key or use the other's lease; both can stop the robot. The
keys are made by `tandem keys`. The robot is handed over, and its new operator's certificate is revoked.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.errors import LinkError
from common.link import Link, open_link
from common.link.config import LinkConfig
from common.metrics.slave import SlaveMetrics
from common.skeleton import load_skeleton
from common.wire.codec import decode, encode
from common.wire.control import ask_control, topic_for
from common.wire.messages import (
    Action,
    Command,
    CommandStamps,
    ControlReply,
    ControlRequest,
    RobotState,
    Statistics,
)
from common.wire.topics import COMMAND, CONTROL, STATE, STATISTICS
from deploy.cli import app
from tests.link.parties import ROBOT, Process, free_port, link_toml, reached, started, tls

pytestmark = pytest.mark.live
JOINTS = len(load_skeleton("nursing").joints)
NAMES = ("robot:robot-1", "operator:anna", "operator:carl", "router:hub")


@pytest.fixture(name="keys", scope="module")
def some_keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    for arguments in (
        ["authority", str(folder)],
        *(["make", str(folder), who, "--host", "127.0.0.1"] for who in NAMES),
    ):
        made = CliRunner().invoke(app, ["keys", *arguments])
        assert made.exit_code == 0, made.output
    (folder / "revoked.txt").write_text("")
    return folder


class Person:
    """An operator's session: what it hears of the robot, and what it sends on any key it likes."""

    def __init__(self, name: str, link: Link) -> None:
        self.name = name
        self.link = link
        self.state: RobotState | None = None
        self.metrics: SlaveMetrics | None = None
        self.stolen = 0
        self.overheard: list[bytes] = []
        link.subscribe(STATE, self._on_state)
        link.subscribe(STATISTICS, self._on_statistics)
        link.subscribe(COMMAND, lambda payload, _: self.overheard.append(payload))
        self._put = {of: link.publish(COMMAND.of(of)) for of in ("anna", "carl")}

    def _on_state(self, payload: bytes, _: int) -> None:
        self.state = decode(payload, RobotState, JOINTS)

    def _on_statistics(self, payload: bytes, _: int) -> None:
        metrics = decode(payload, Statistics).metrics
        if isinstance(metrics, SlaveMetrics):
            self.metrics = metrics

    def command(self, lease: int, on_key_of: str) -> None:
        zeros, stamps = np.zeros(JOINTS), CommandStamps(1, 1, 1, 1)
        valid = np.ones(JOINTS, np.bool_)
        self._put[on_key_of](encode(Command(ROBOT, lease, 1, 1, stamps, True, valid, zeros, zeros)))

    def dropped(self, gate: str) -> int:
        return 0 if self.metrics is None else self.metrics.guard.dropped.get(gate, 0)

    async def ask(self, action: Action, named: str = "", on_key_of: str = "", key: str = "") -> ControlReply:
        own = on_key_of or self.name
        request = ControlRequest(ROBOT, action, named or self.name, key)
        topic = topic_for(action, own) if action is Action.ESTOP else CONTROL.of(own)
        return await ask_control(lambda payload: self.link.ask(topic, payload), request)


@asynccontextmanager
async def scene(routed: bool, keys: Path, folder: Path) -> AsyncIterator[tuple[Process, Person, Person]]:
    """The robot's process, and both operators connected."""
    endpoint = f"tls/127.0.0.1:{free_port('tls')}"
    listen, revoked = f'listen = ["{endpoint}"]', f'revoked = "{keys}/revoked.txt"'
    async with AsyncExitStack() as stack:
        if routed:
            file = folder / "router.toml"
            file.write_text(link_toml(keys, "router-hub", f"{listen}\n{revoked}"))
            await stack.enter_async_context(started("-m", "deploy", "router", str(file), until="routing at"))
            listen = f'mode = "client"\nconnect = ["{endpoint}"]'
        file = folder / "slave.toml"
        link = link_toml(keys, "robot-robot-1", f"{listen}\n{revoked}")
        guard = "[guard]\nlease_timeout_s = 60.0\n"
        backend = '[servos]\nbackend = "mujoco"\n'
        file.write_text(f'robot = "{ROBOT}"\nprofile = "nursing"\n{link}{backend}{guard}')
        slave = await stack.enter_async_context(
            started("-m", "slave", str(file), until="waiting for a master")
        )
        people = []
        for name in ("anna", "carl"):
            own = LinkConfig(connect=[endpoint], mode="client", tls=tls(keys, f"operator-{name}"))
            opened = await stack.enter_async_context(open_link(own, ROBOT))
            await opened.connected(CONTROL.of(name), timeout_s=10.0)
            people.append(Person(name, opened))
        yield slave, people[0], people[1]


async def until(condition: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
    async with asyncio.timeout(20.0):
        while not condition():
            each()
            await asyncio.sleep(0.05)


@pytest.mark.parametrize("routed", [False, True], ids=["direct", "routed"])
def test_each_commands_in_the_own_name_alone(routed: bool, keys: Path, tmp_path: Path) -> None:
    (keys / "revoked.txt").write_text("")

    async def story() -> None:
        async with scene(routed, keys, tmp_path) as (slave, anna, carl):
            # carl cannot claim as anna: not on her key, not in her name
            with pytest.raises(LinkError):
                await carl.ask(Action.CLAIM, named="anna", on_key_of="anna")
            said = await carl.ask(Action.CLAIM, named="anna")
            assert (said.done, said.text) == (False, "the request is in the name of anna, but came from carl")
            lease = (await anna.ask(Action.CLAIM)).lease
            assert lease
            said = await carl.ask(Action.CLAIM)
            assert (said.done, said.text) == (False, "anna holds the lease")

            # hers arrive (and fail later, at a clock that was never measured); he overhears the lease
            def of_hers() -> None:
                anna.command(lease, "anna")

            await until(lambda: bool(anna.dropped("clock") and carl.overheard), of_hers)
            stolen = decode(carl.overheard[-1], Command, JOINTS).lease
            assert stolen == lease

            # on his key it is worth nothing; on her key nothing of his arrives
            await until(lambda: carl.dropped("operator") >= 3, lambda: carl.command(stolen, "carl"))
            before = carl.metrics
            assert before is not None
            hers = before.guard.dropped["clock"]
            for _ in range(20):
                carl.command(stolen, "anna")
                await asyncio.sleep(0.02)
            await until(lambda: carl.metrics is not before)
            await until(lambda: (last := carl.metrics) is not None and last is not before)
            assert carl.dropped("clock") == hers, "what he put on her key came through"
            for action in (Action.RELEASE, Action.DISENGAGE, Action.HANDOVER):
                assert (await carl.ask(action, key="carl")).text == "anna holds the lease"

            # she hands over, he takes it with the claim that was refused before
            assert (await anna.ask(Action.HANDOVER, key="ben")).text.startswith(
                "ben may not command this robot"
            )
            assert (await anna.ask(Action.HANDOVER, key="carl")).done
            taken = await carl.ask(Action.CLAIM)
            assert taken.done
            assert taken.lease != lease
            await until(lambda: anna.state is not None and anna.state.operator == "carl")
            assert (await anna.ask(Action.RELEASE)).text == "carl holds the lease"

            # anybody stops it
            assert (await carl.ask(Action.ESTOP)).guard == "estop"
            assert (await anna.ask(Action.ESTOP)).guard == "estop"

            # his certificate is revoked: the lease ends while the robot runs, and she may claim
            made = CliRunner().invoke(app, ["keys", "revoke", str(keys), "operator:carl"])
            assert made.exit_code == 0, made.output
            await reached(lambda: slave.said("revoked now: operator:carl"), slave, "the revocation")
            claimed = ControlReply(False, "", "")

            async def claim() -> bool:
                nonlocal claimed
                try:
                    claimed = await anna.ask(Action.CLAIM)
                except LinkError:  # the link is opened anew
                    await asyncio.sleep(0.1)
                return claimed.done

            async with asyncio.timeout(20.0):
                while not await claim():
                    pass
            assert replace(claimed, lease=1).text == "anna holds the lease now; engage to move"

            async def cut_off() -> bool:
                try:
                    refused = await carl.ask(Action.CLAIM)
                except LinkError:
                    return True
                assert (refused.done, refused.text) == (False, "the certificate of carl is revoked")
                await asyncio.sleep(0.1)
                return False

            # by name at once, by the rules as soon as the one that he is connected to has read the list
            async with asyncio.timeout(20.0):
                while not await cut_off():
                    pass

    asyncio.run(story())
