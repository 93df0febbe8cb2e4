"""Whoever connects looks at whom it has found: an impostor at the robot's address is not heard."""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import pytest
import zenoh

from common.link import open_link
from common.link.config import LinkConfig
from common.link.endpoint import SECURE
from common.link.roles import Role
from common.link.zenoh_config import zenoh_configuration
from common.wire.topics import STATE
from deploy.certificates.folder import read_authority, stem, write_pair
from deploy.certificates.make import new_authority, new_identity
from tests.link.parties import DAY, HERE, ROBOT, free_port, make_keys, tls

STATES = 20


@pytest.fixture(name="keys", scope="module")
def some_keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder)
    now = datetime.now(UTC)
    rogue = new_authority("clinic", now, DAY)
    authority = read_authority(folder)
    name = stem(Role.ROBOT, ROBOT)
    write_pair(folder / "rogue", name, new_identity(rogue, Role.ROBOT, ROBOT, HERE, now, DAY))
    elsewhere = new_identity(authority, Role.ROBOT, ROBOT, ["127.0.0.9"], now, DAY)
    write_pair(folder / "elsewhere", name, elsewhere)
    return folder


def listener(at: str, keys: Path, folder: Path) -> zenoh.Session:
    """A robot's session that takes any certificate of the true authority, and checks nothing of its own."""
    config = LinkConfig(listen=[at], tls=tls(folder, "robot-robot-1", ca=keys / "ca.pem"))
    return zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_configuration(config))))


@pytest.mark.parametrize("transport", SECURE)
def test_only_the_robot_itself_is_heard(transport: str, keys: Path) -> None:
    async def story() -> None:
        folders = {"rogue": keys / "rogue", "elsewhere": keys / "elsewhere", "itself": keys}
        ends = {who: f"{transport}/127.0.0.1:{free_port(transport)}" for who in folders}
        robots = {who: listener(ends[who], keys, folder) for who, folder in folders.items()}
        heard: Counter[str] = Counter()
        config = LinkConfig(connect=list(ends.values()), tls=tls(keys, "operator-anna"))
        async with asyncio.timeout(30), open_link(config, ROBOT) as link:
            link.subscribe(STATE, lambda payload, _: heard.update([payload.decode()]))
            while heard["itself"] < STATES:
                for who, session in robots.items():
                    session.put(STATE.key_for(ROBOT), who.encode())
                await asyncio.sleep(0.01)
            assert set(heard) == {"itself"}
            assert link.peers == 1
        for session in robots.values():
            session.close()

    asyncio.run(story())
