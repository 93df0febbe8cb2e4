"""What each robot answers, how long that takes, how far its clock is, and which software it runs."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from common.clock import monotonic_ns, to_ms
from common.clock_sync import MasterExchange
from common.clock_sync.config import ClockConfig
from common.clock_sync.services import TimeServices
from common.errors import CodecError, LinkError
from common.link import Link, open_session
from common.link.config import LinkConfig
from common.metrics.parts import Software
from common.metrics.slave import GuardTimes
from common.wire.codec import decode, encode
from common.wire.messages import Action, ClockReference, ClockReply
from common.wire.presence import several_bear
from common.wire.topics import CLOCK
from deploy.client.ask import ask
from deploy.client.destination import ROUTER_S, Destination
from deploy.client.heard import HeardOfAll

EXCHANGES = 20
PAUSE_S = 0.02
"""Between two exchanges: a robot that works is not to be flooded."""
LISTEN_S = 2.5
"""Figures come once a second."""


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """One robot as this host reaches it."""

    name: str
    guard: str
    """The guard's state; empty where the robot did not answer."""
    text: str
    """The robot's answer, or the reason for its silence."""
    round_trips_ms: tuple[float, ...] = ()
    asked: int = 0
    """Exchanges begun: those that were not answered are missing in `round_trips_ms`."""
    offset_ms: float = 0.0
    """Its clock minus ours."""
    bound_ms: float = 0.0
    clock_words: str = ""
    """What bounds that, and why."""
    clock_refuted: bool = False
    """Whether a time service contradicted the round trip."""
    software: Software | None = None
    """None where it did not tell."""
    times: GuardTimes | None = None
    """Its guard's times in force."""


async def read_robots(
    link: LinkConfig, robots: Sequence[str], operator: str, clock: ClockConfig | None = None
) -> list[RobotFacts]:
    """Ask each, side by side. Raises LinkError where no session can be opened at all.

    It only asks: it claims nothing, and listens at no endpoint, so a running master is not disturbed.
    """
    where = Destination(
        link.model_copy(update={"listen": [], "twin": None, "access": None, "revoked": None}),
        tuple(robots),
        operator,
    )
    async with open_session(where.link, router_within_s=ROUTER_S) as session:
        services = TimeServices(clock or ClockConfig(source="round_trip"))
        await asyncio.to_thread(services.read)
        own = services.track.reference(monotonic_ns())
        return await asyncio.gather(*(_read(session.link(robot), where, own) for robot in robots))


async def _read(link: Link, where: Destination, own: ClockReference | None) -> RobotFacts:
    all_heard = HeardOfAll(link)
    answers = await ask(link, where, Action.STATUS)
    if len(answers) > 1:
        places = [f"{each.place} (instance {each.instance:08x})" for each in answers]
        return RobotFacts(link.robot, "", several_bear(link.robot, places))
    answer = answers[0]
    heard = all_heard.of(answer.instance)
    if not answer.guard:
        return RobotFacts(link.robot, "", answer.text)
    exchange = MasterExchange(asker=1 + secrets.randbelow((1 << 63) - 1))
    exchange.tell(own, 0)
    round_trips = [trip async for trip in _exchanges(link, exchange)]
    with suppress(TimeoutError):
        await asyncio.wait_for(heard.all.wait(), LISTEN_S)
    offset = exchange.estimate(monotonic_ns())
    return RobotFacts(
        link.robot,
        answer.guard,
        answer.text,
        tuple(round_trips),
        EXCHANGES,
        to_ms(offset.offset_ns) if round_trips else 0.0,
        to_ms(offset.bound_ns) if round_trips else 0.0,
        exchange.best.words,
        exchange.best.contradictions > 0,
        heard.metrics.software if heard.metrics else None,
        heard.metrics.times if heard.metrics else None,
    )


async def _exchanges(link: Link, exchange: MasterExchange) -> AsyncIterator[float]:
    for _ in range(EXCHANGES):
        query = exchange.query(monotonic_ns())
        with suppress(LinkError, CodecError):
            payload, arrived_ns = await link.ask_stamped(CLOCK, encode(query))
            reply = decode(payload, ClockReply)
            if exchange.on_reply(reply, arrived_ns):
                held_ns = reply.replied_ns - reply.received_ns
                yield to_ms(arrived_ns - reply.asked_ns - held_ns)
        await asyncio.sleep(PAUSE_S)
