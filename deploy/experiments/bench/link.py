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
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import uvloop
import zenoh
from zenoh.handlers import Callback

from common.clock import monotonic_ns, to_ns
from common.errors import LinkError
from common.link import open_link
from common.link.config import LinkConfig
from common.link.configuration import zenoh_configuration
from common.process.heap import freeze_heap
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.codec import encode
from common.wire.topics import COMMAND, STATE
from deploy.experiments.bench.pipeline import example_command
from deploy.experiments.bench.worker import beside, in_worker
from deploy.measure.timing import Figures, spread_us

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
        "over_bare_zenoh": ratio(one_way_us, "tandem", "zenoh"),
        "over_bare_udp": ratio(one_way_us, "tandem", "udp"),
        "bare_zenoh_over_bare_udp": ratio(one_way_us, "zenoh", "udp"),
    }


def ping(seconds: float, ports: list[int]) -> dict[str, Any]:
    """The side that asks and takes the time."""
    return uvloop.run(_ping(seconds, ports))


def echo(ports: list[int]) -> None:
    """The side that returns whatever comes, until killed."""
    uvloop.run(_echo(ports))


async def _ping(seconds: float, ports: list[int]) -> dict[str, Any]:
    async with AsyncExitStack() as stack:
        stagger = Stagger()
        tandem, bare, udp = ports
        doors = (
            ping_link(LinkConfig(connect=[_endpoint(tandem)]), stagger.on_echo),
            ping_zenoh(LinkConfig(connect=[_endpoint(bare)]), stagger.on_echo),
            _ping_udp(udp, stagger.on_echo),
        )
        for name, door in zip(DOORS, doors, strict=True):
            stagger.doors[name] = await stack.enter_async_context(door)
        return await stagger.measure(seconds)


class Stagger:
    """Takes the time of several doors in one run: each in turn, each at the rate of the commands."""

    def __init__(self) -> None:
        self.doors: dict[str, Ping] = {}
        self._payload = encode(example_command())
        self._arrived: asyncio.Future[int] | None = None

    def on_echo(self, arrived_ns: int) -> None:
        """What was sent last is back."""
        if self._arrived is not None and not self._arrived.done():
            self._arrived.set_result(arrived_ns)

    async def measure(self, seconds: float) -> dict[str, Figures]:
        """µs one way by door: half of each round trip. Raises LinkError for a door that gives no echo."""
        await self._until_all_answer()
        freeze_heap()
        names = list(self.doors)
        trips: dict[str, list[float]] = {name: [] for name in names}
        step_ns = to_ns(1.0 / (COMMAND.rate_hz * len(names)))
        begin_ns = monotonic_ns() + step_ns
        async for due in ticks(TickGrid(begin_ns, step_ns)):
            if due.scheduled_ns - begin_ns >= to_ns(seconds):
                break
            name = names[due.tick % len(names)]
            trip_ns = await self._round_trip_ns(self.doors[name])
            # an echo that never came took at least so long: left out, a link that loses would be the faster
            trips[name].append((to_ns(TIMEOUT_S) if trip_ns is None else trip_ns) / 2)
        return {name: spread_us(halves[WARM_UP:]) for name, halves in trips.items()}

    async def _round_trip_ns(self, send: Ping) -> int | None:
        self._arrived = asyncio.get_running_loop().create_future()
        put_ns = monotonic_ns()
        send(self._payload)
        try:
            return await asyncio.wait_for(self._arrived, TIMEOUT_S) - put_ns
        except TimeoutError:
            return None

    async def _until_all_answer(self) -> None:
        deadline_ns = monotonic_ns() + to_ns(CONNECT_S)
        for name, send in self.doors.items():
            while await self._round_trip_ns(send) is None:
                if monotonic_ns() > deadline_ns:
                    raise LinkError(f"{name}: no echo within {CONNECT_S:g} s")


async def _echo(ports: list[int]) -> None:
    async with AsyncExitStack() as stack:
        await echo_link(stack, LinkConfig(listen=[_endpoint(ports[0])]))
        bare = echo_zenoh(LinkConfig(listen=[_endpoint(ports[1])]))
        udp = asyncio.get_running_loop().create_datagram_endpoint(
            _UdpEcho, local_addr=("127.0.0.1", ports[2])
        )
        # both held: they end with their last reference
        held = bare, await udp
        await asyncio.Event().wait()
        del held


async def echo_link(stack: AsyncExitStack, config: LinkConfig) -> None:
    """Return what comes through tandem's own link, until the stack closes."""
    link = await stack.enter_async_context(open_link(config, ROBOT))
    back = link.publish(STATE)
    link.subscribe(COMMAND, lambda payload, _: back(payload))


def echo_zenoh(config: LinkConfig) -> object:
    """Return what comes through bare Zenoh, as long as the result is held."""
    session = _open_zenoh(config)
    put = _publisher(session, BACK)

    def on_sample(sample: zenoh.Sample) -> None:
        put(sample.payload.to_bytes())

    return session, session.declare_subscriber(THERE, Callback(on_sample, indirect=False))


@asynccontextmanager
async def ping_link(config: LinkConfig, on_echo: OnEcho) -> AsyncIterator[Ping]:
    """Send through tandem's own link."""
    async with open_link(config, ROBOT) as link:
        link.subscribe(STATE, lambda _, arrived_ns: on_echo(arrived_ns))
        yield link.publish(COMMAND)


@asynccontextmanager
async def ping_zenoh(config: LinkConfig, on_echo: OnEcho) -> AsyncIterator[Ping]:
    """Send through bare Zenoh."""
    loop = asyncio.get_running_loop()

    def on_sample(sample: zenoh.Sample) -> None:
        arrived_ns = monotonic_ns()
        sample.payload.to_bytes()
        loop.call_soon_threadsafe(on_echo, arrived_ns)

    session = await asyncio.to_thread(_open_zenoh, config)
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


def ratio(figures: dict[str, Any], above: str, below: str, of: str = "median") -> float | None:
    """One door's figure over another's; None where either is missing."""
    one, other = figures[above].get(of), figures[below].get(of)
    return round(one / other, 3) if one is not None and other else None
