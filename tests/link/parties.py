"""The parties of a security test: whoever has which certificate, and the processes that refuse them."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import zenoh
from zenoh.handlers import Callback

from common.link.config import LinkConfig, TlsConfig
from common.link.roles import Role
from common.link.zenoh_config import zenoh_configuration
from common.wire.topics import COMMAND, STATE, VIDEO, Topic
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import Pair, new_authority, new_identity

ROBOT = "robot-1"
DAY = timedelta(days=1)
HERE = ["127.0.0.1"]
ACCESS = """
[link.access]
operators = { anna = ["robot-1"], ben = ["robot-2"], carl = ["robot-1"] }
observers = { screen = ["robot-1"] }
viewers = { chief = ["robot-1"] }
routers = ["hub"]
"""


def make_keys(folder: Path) -> None:
    """One authority's certificates, those of a rogue one with the same name, and an expired one."""
    now = datetime.now(UTC)
    old = now - 5 * DAY
    authority = new_authority("clinic", old, 30 * DAY)
    rogue = new_authority("clinic", old, 30 * DAY)
    write_pair(folder, "ca", authority)
    write_pair(folder, "rogue-ca", rogue)
    people = [
        (Role.ROBOT, ROBOT), (Role.ROBOT, "robot-2"), (Role.OPERATOR, "anna"), (Role.OPERATOR, "ben"),
        (Role.OPERATOR, "carl"),
        (Role.OBSERVER, "screen"), (Role.OBSERVER, "chief"), (Role.OBSERVER, "stranger"),
        (Role.ROUTER, "hub"),
    ]  # fmt: skip
    for role, name in people:
        write_pair(folder, stem(role, name), new_identity(authority, role, name, HERE, now, DAY))
    for folder_name, by, since in (("rogue", rogue, now), ("expired", authority, old)):
        _anna_of(folder / folder_name, by, since)


def _anna_of(folder: Path, authority: Pair, since: datetime) -> None:
    write_pair(
        folder,
        stem(Role.OPERATOR, "anna"),
        new_identity(authority, Role.OPERATOR, "anna", HERE, since, DAY),
    )


def tls(keys: Path, who: str, ca: Path | None = None) -> TlsConfig:
    return TlsConfig(ca=ca or keys / "ca.pem", certificate=keys / f"{who}.pem", key=keys / f"{who}.key")


def free_port(transport: str) -> int:
    kind = socket.SOCK_DGRAM if transport in ("udp", "quic", "quic-datagram") else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def link_toml(keys: Path, who: str, head: str, access: str = ACCESS) -> str:
    return (
        f'[link]\n{head}\n[link.tls]\nca = "{keys}/ca.pem"\ncertificate = "{keys}/{who}.pem"\n'
        f'key = "{keys}/{who}.key"\n{access}'
    )


@dataclass
class Process:
    """A process that enforces the rules: what it logs, and what it heard."""

    process: asyncio.subprocess.Process
    log: list[str] = field(default_factory=list)
    heard: dict[str, int] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    news: asyncio.Event = field(default_factory=asyncio.Event)

    async def read_log(self) -> None:
        assert self.process.stderr is not None
        async for line in self.process.stderr:
            self.log.append(line.decode())
            self.news.set()

    async def read_heard(self) -> None:
        assert self.process.stdout is not None
        async for line in self.process.stdout:
            tree = json.loads(line)
            self.heard, self.figures = tree["heard"], tree["access"]
            self.news.set()

    async def stop(self) -> None:
        if self.process.returncode is None:
            self.process.terminate()
        await self.process.wait()

    def said(self, text: str) -> bool:
        return any(text in line for line in self.log)


@asynccontextmanager
async def started(*command: str, until: str) -> AsyncIterator[Process]:
    """A running process that has logged `until`; it is gone afterwards."""
    pipe = asyncio.subprocess.PIPE
    child = await asyncio.create_subprocess_exec(sys.executable, *command, stdout=pipe, stderr=pipe)
    running = Process(child)
    tasks = [asyncio.create_task(running.read_log()), asyncio.create_task(running.read_heard())]
    try:
        await reached(lambda: running.said(until), running, until)
        yield running
    finally:
        await running.stop()
        await asyncio.gather(*tasks)


async def reached(condition: Any, process: Process, what: str, timeout_s: float = 20.0) -> None:
    """Look whenever the process says something."""
    try:
        async with asyncio.timeout(timeout_s):
            while not condition():
                process.news.clear()
                if process.process.returncode is not None:
                    break
                await process.news.wait()
    except TimeoutError:
        pass
    assert condition(), f"{what} did not come; it heard {process.heard} and said {''.join(process.log)}"


class Party:
    """Somebody with some certificate, or none, who obeys no rules of his own."""

    def __init__(self, name: str, session: zenoh.Session) -> None:
        self.name = name
        self.session = session
        self.seen = 0
        self.states = 0
        key = VIDEO.key_for(ROBOT)
        self._held = [
            session.declare_subscriber(key, Callback(self._on_video, indirect=False)),
            session.declare_subscriber(STATE.key_for(ROBOT), Callback(self._on_state, indirect=False)),
        ]

    def _on_video(self, _: zenoh.Sample) -> None:
        self.seen += 1

    def _on_state(self, _: zenoh.Sample) -> None:
        self.states += 1

    def answered(self, topic: Topic) -> bool:
        """Whether a question to the robot on a key is answered."""
        replies = self.session.get(topic.key_for(ROBOT), payload=b"", timeout=topic.timeout_s)
        return any(reply.ok is not None for reply in replies)

    def command(self, key_of: str) -> None:
        """Put a command on the key of an operator."""
        key = COMMAND.of(key_of).key_for(ROBOT)
        self.session.put(key, self.name.encode(), allowed_destination=zenoh.Locality.REMOTE)


def open_party(name: str, link: LinkConfig, certificate: bool = True) -> Party:
    """A session without checks of one's own keys, and without access rules."""
    settings = json.loads(json.dumps(zenoh_configuration(link)))
    if not certificate:
        block = settings["transport"]["link"]["tls"]
        for key in [key for key in block if key.startswith(("listen_", "connect_"))]:
            del block[key]
        block["enable_mtls"] = False
    return Party(name, zenoh.open(zenoh.Config.from_json5(json.dumps(settings))))
