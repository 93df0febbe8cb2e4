"""Which sizes of message pass to a robot and back: each is tried on a connection of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from common.errors import LinkError, LinkTimeoutError
from common.link import open_session
from common.link.config import LinkConfig
from common.wire.path_probe import probe
from common.wire.topics import PATH
from deploy.client.destination import ROUTER_S

SMALL_BYTES = 64
SIZES = (1100, 1350, 4000, 16_000)
"""Sizes of payloads: what control needs, nearly a full Ethernet packet, statistics, a picture."""
TRIES = 2
"""A lost packet is not a path that swallows it."""


@dataclass(frozen=True, slots=True)
class PathFacts:
    """The largest payload that passed each way, of those tried; None: the robot answers no probe."""

    robot: str
    there_bytes: int | None
    back_bytes: int | None


async def read_path(link: LinkConfig, robot: str, sizes: Sequence[int] = SIZES) -> PathFacts:
    """Try each size there, then each back. A connection that swallowed one carries nothing any more."""
    if await _passes(link, robot, probe(SMALL_BYTES, SMALL_BYTES)) is not True:
        return PathFacts(robot, None, None)
    there = [probe(size, SMALL_BYTES) for size in sizes]
    back = [probe(SMALL_BYTES, size) for size in sizes]
    return PathFacts(
        robot, await _largest(link, robot, sizes, there), await _largest(link, robot, sizes, back)
    )


async def _largest(link: LinkConfig, robot: str, sizes: Sequence[int], questions: Sequence[bytes]) -> int:
    passed = SMALL_BYTES
    for size, question in zip(sizes, questions, strict=True):
        if not await _passes(link, robot, question):
            break
        passed = size
    return passed


async def _passes(link: LinkConfig, robot: str, question: bytes) -> bool | None:
    """None where nobody answers probes there."""
    for _ in range(TRIES):
        async with open_session(link, router_within_s=ROUTER_S) as session:
            asking = session.link(robot)
            try:
                await asking.connected(PATH)
                await asking.ask(PATH, question)
            except LinkTimeoutError:
                continue
            except LinkError:
                return None
            return True
    return False
