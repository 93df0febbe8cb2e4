"""One way through the whole link over each transport, beside bare Zenoh over tcp, in turn, in one run.

Secure transports have keys made for the run, and rules, as docs/security.md sets hosts up.
"""

from __future__ import annotations

import asyncio
import tempfile
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import uvloop

from common.link.config import AccessConfig, LinkConfig
from common.link.endpoint import SECURE, TRANSPORTS
from common.link.listening import hear_refusals
from common.link.roles import Role
from deploy.experiments.bench.link import ROBOT, Stagger, echo_link, echo_zenoh, ping_link, ping_zenoh, ratio
from deploy.experiments.bench.worker import beside, in_worker
from deploy.harness.endpoints import local_endpoints
from deploy.harness.keys import MASTER, make_keys, tls_of

BARE = "bare zenoh"
"""Over tcp, with nothing of ours on the way but the configuration."""


def transports(seconds: float) -> dict[str, Any]:
    """µs one way by transport at the commands' rate; medians over tcp's; tcp over bare Zenoh."""
    with tempfile.TemporaryDirectory(prefix="tandem-bench-") as name:
        folder = Path(name)
        ends = {BARE: local_endpoints("tcp", folder).robots[0]}
        for transport in TRANSPORTS:
            (folder / transport).mkdir()
            ends[transport] = local_endpoints(transport, folder / transport).robots[0]
        make_keys(folder, ends.values(), [ROBOT])
        with beside("transports:echo", ends=ends, keys=str(folder / "keys")):
            one_way_us = in_worker("transports:ping", seconds, ends=ends, keys=str(folder / "keys"))
    over_tcp = {transport: ratio(one_way_us, transport, "tcp") for transport in TRANSPORTS}
    secure = [over_tcp[transport] for transport in SECURE]
    return {
        "one_way_us": one_way_us,
        "over_tcp": over_tcp,
        "worst_secure_over_tcp": max((each for each in secure if each is not None), default=None),
        "tcp_over_bare_zenoh": ratio(one_way_us, "tcp", BARE),
        "tcp_p99_over_bare_zenoh": ratio(one_way_us, "tcp", BARE, of="p99"),
    }


def ping(seconds: float, ends: dict[str, str], keys: str) -> dict[str, Any]:
    """The side that asks and takes the time."""
    hear_refusals(messages=False)  # as the services do, of whom only the robot has a door
    return uvloop.run(_ping(seconds, ends, Path(keys)))


def echo(ends: dict[str, str], keys: str) -> None:
    """The side that returns whatever comes, until killed."""
    hear_refusals()
    uvloop.run(_echo(ends, Path(keys)))


async def _ping(seconds: float, ends: dict[str, str], keys: Path) -> dict[str, Any]:
    async with AsyncExitStack() as stack:
        stagger = Stagger()
        for name, end in ends.items():
            config = _config(name, keys, Role.OPERATOR, MASTER, connect=[end])
            door = (ping_zenoh if name == BARE else ping_link)(config, stagger.on_echo)
            stagger.doors[name] = await stack.enter_async_context(door)
        return {**await stagger.measure(seconds)}


async def _echo(ends: dict[str, str], keys: Path) -> None:
    held = []
    async with AsyncExitStack() as stack:
        for name, end in ends.items():
            config = _config(name, keys, Role.ROBOT, ROBOT, listen=[end])
            if name == BARE:
                held.append(echo_zenoh(config))
            else:
                await echo_link(stack, config)
        await asyncio.Event().wait()
    del held


def _config(transport: str, keys: Path, role: Role, name: str, **ends: list[str]) -> LinkConfig:
    if transport not in SECURE:
        return LinkConfig.model_validate(ends)
    access = AccessConfig(operators={MASTER: [ROBOT]})
    return LinkConfig.model_validate({**ends, "tls": tls_of(keys, role, name), "access": access})
