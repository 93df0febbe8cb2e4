"""One way over the link beside what lies under it: the same payload through three doors, in turn, in one run.

    tandem    common.link over Zenoh: publish, and a handler on the other side's event loop
    zenoh     a bare Zenoh publisher and callback, same configuration, no event loop on the way
    udp       a bare UDP socket on the event loop

Each figure is half a round trip between two processes, on one clock. At low rates most of it is the waking of
an idle core, which is why only the ratios say something about the code.
"""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import uvloop
import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns, to_ns
from common.codec import encode
from common.config import LinkConfig
from common.errors import LinkError
from common.link import open_link
from common.link.configuration import zenoh_configuration
from common.pacing import TickGrid
from common.runtime import freeze_heap
from common.ticker import ticks
from common.topics import COMMAND, STATE
from deploy.bench.measure import spread_us
from deploy.bench.pipeline import example_command
from deploy.bench.worker import beside, in_worker

DOORS = ("tandem", "zenoh", "udp")
ROBOT = "bench"
THERE, BACK = "bench/there", "bench/back"
TIMEOUT_S = 0.5
CONNECT_S = 10.0
WARM_UP = 3
"""Rounds of each door that are not counted."""

Ping = Callable[[bytes], None]
"""Sends a payload; `on_echo(arrived_ns)` is called on the loop when it is back."""
OnEcho = Callable[[int], None]


def link(seconds: float) -> dict[str, Any]:
    """µs one way by door at the commands' rate, and the ratios of the medians."""
    ports = _free_ports(len(DOORS))
    with beside("link:echo", ports=ports):
        one_way_us = in_worker("link:ping", seconds, ports=ports)
    return {
        "one_way_us": one_way_us,
        "over_bare_zenoh": _ratio(one_way_us, "tandem", "zenoh"),
        "over_bare_udp": _ratio(one_way_us, "tandem", "udp"),
        "bare_zenoh_over_bare_udp": _ratio(one_way_us, "zenoh", "udp"),
    }


def ping(seconds: float, ports: list[int]) -> dict[str, Any]:
    """The side that asks and takes the time."""
    return uvloop.run(_ping(seconds, ports))


def echo(ports: list[int]) -> None:
    """The side that returns whatever comes, until killed."""
    uvloop.run(_echo(ports))


async def _ping(seconds: float, ports: list[int]) -> dict[str, Any]:
    payload = encode(example_command())
    arrived: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    def on_echo(arrived_ns: int) -> None:
        if not arrived.done():
            arrived.set_result(arrived_ns)

    async with AsyncExitStack() as stack:
        openers = (_ping_link, _ping_zenoh, _ping_udp)
        pings = [
            await stack.enter_async_context(opener(port, on_echo))
            for opener, port in zip(openers, ports, strict=True)
        ]

        async def round_trip_ns(send: Ping) -> int | None:
            nonlocal arrived
            arrived = asyncio.get_running_loop().create_future()
            put_ns = monotonic_ns()
            send(payload)
            try:
                return await asyncio.wait_for(arrived, TIMEOUT_S) - put_ns
            except TimeoutError:
                return None

        await _until_all_answer(pings, round_trip_ns)
        freeze_heap()
        trips: dict[str, list[float]] = {door: [] for door in DOORS}
        # each door in turn, each at the rate of the commands
        step_ns = to_ns(1.0 / (COMMAND.rate_hz * len(DOORS)))
        begin_ns = monotonic_ns() + step_ns
        async for due in ticks(TickGrid(begin_ns, step_ns)):
            if due.scheduled_ns - begin_ns >= to_ns(seconds):
                break
            place = due.tick % len(DOORS)
            trip_ns = await round_trip_ns(pings[place])
            if trip_ns is not None:
                trips[DOORS[place]].append(trip_ns / 2)
    return {door: spread_us(halves[WARM_UP:]) for door, halves in trips.items()}


async def _until_all_answer(
    pings: list[Ping], round_trip_ns: Callable[[Ping], Awaitable[int | None]]
) -> None:
    deadline_ns = monotonic_ns() + to_ns(CONNECT_S)
    for door, send in zip(DOORS, pings, strict=True):
        while await round_trip_ns(send) is None:
            if monotonic_ns() > deadline_ns:
                raise LinkError(f"{door}: no echo within {CONNECT_S:g} s")


async def _echo(ports: list[int]) -> None:
    async with AsyncExitStack() as stack:
        link = await stack.enter_async_context(open_link(LinkConfig(listen=[_endpoint(ports[0])]), ROBOT))
        back = link.publish(STATE)
        link.subscribe(COMMAND, lambda payload, _: back(payload))

        session = _open_zenoh(LinkConfig(listen=[_endpoint(ports[1])]))
        put = _publisher(session, BACK)

        def on_sample(sample: zenoh.Sample) -> None:
            put(sample.payload.to_bytes())

        udp = asyncio.get_running_loop().create_datagram_endpoint(
            _UdpEcho, local_addr=("127.0.0.1", ports[2])
        )
        # both held: they end with their last reference
        held = session.declare_subscriber(THERE, Callback(on_sample, indirect=False)), await udp
        await asyncio.Event().wait()
        del held


@asynccontextmanager
async def _ping_link(port: int, on_echo: OnEcho) -> AsyncIterator[Ping]:
    async with open_link(LinkConfig(connect=[_endpoint(port)]), ROBOT) as link:
        link.subscribe(STATE, lambda _, arrived_ns: on_echo(arrived_ns))
        yield link.publish(COMMAND)


@asynccontextmanager
async def _ping_zenoh(port: int, on_echo: OnEcho) -> AsyncIterator[Ping]:
    loop = asyncio.get_running_loop()

    def on_sample(sample: zenoh.Sample) -> None:
        arrived_ns = monotonic_ns()
        sample.payload.to_bytes()
        loop.call_soon_threadsafe(on_echo, arrived_ns)

    session = await asyncio.to_thread(_open_zenoh, LinkConfig(connect=[_endpoint(port)]))
    held = session.declare_subscriber(BACK, Callback(on_sample, indirect=False))
    yield _publisher(session, THERE)
    # the session is not closed: that can hang on a peer that is gone, and the worker ends without it
    del held


@asynccontextmanager
async def _ping_udp(port: int, on_echo: OnEcho) -> AsyncIterator[Ping]:
    transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
        lambda: _UdpPing(on_echo), remote_addr=("127.0.0.1", port)
    )
    yield transport.sendto
    transport.close()


class _UdpPing(asyncio.DatagramProtocol):
    def __init__(self, on_echo: OnEcho) -> None:
        self._on_echo = on_echo

    def datagram_received(self, data: bytes, addr: object) -> None:
        self._on_echo(monotonic_ns())

    def error_received(self, exc: Exception) -> None:
        """The other side is not up yet: the ping is asked again."""


class _UdpEcho(asyncio.DatagramProtocol):
    def connection_made(self, transport: Any) -> None:
        # uvloop's transport is a DatagramTransport in all but its bases
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._transport.sendto(data, addr)


def _open_zenoh(config: LinkConfig) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(zenoh_configuration(config))))


def _publisher(session: zenoh.Session, key: str) -> Ping:
    publisher = session.declare_publisher(
        key,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
        express=True,
        reliability=zenoh.Reliability.BEST_EFFORT,
    )
    put: Ping = publisher.put
    return put


def _endpoint(port: int) -> str:
    return f"tcp/127.0.0.1:{port}"


def _free_ports(count: int) -> list[int]:
    # all held at once, so that they differ
    probes = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def _ratio(figures: dict[str, Any], above: str, below: str) -> float | None:
    one, other = figures[above].get("median"), figures[below].get("median")
    return round(one / other, 3) if one is not None and other else None
