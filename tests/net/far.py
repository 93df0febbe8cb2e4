"""A robot in a home behind address translation, a nurse, and routers between them, as processes."""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import cast

from common.clock import monotonic_ns
from common.link import open_session
from common.link.endpoint import SECURE
from common.link.roles import Role
from common.wire.messages import RobotState
from deploy.examples.profiles import NURSING, example
from deploy.harness.child import Child
from deploy.harness.endpoints import CAN_PORT, MANAGEMENT_PORT, Endpoints, keys_for
from deploy.harness.keys import ROUTER as ROUTER_NAME
from deploy.harness.keys import tls_override
from deploy.harness.rig import ROUTER, Rig
from deploy.sim.network import Network
from tests.net.homes import CALLER, NURSE, ROUTERS, Homes

DOOR = 7448
"""Where each router listens."""


def doors(homes: Homes, transport: str = "tcp") -> list[str]:
    """The routers' endpoints."""
    return [f"{transport}/{ROUTERS[number]}:{DOOR}" for number in range(len(homes.routers))]


def each_links_to_those_before(ends: Sequence[str]) -> list[list[str]]:
    """Whom each router connects to, so that any two of them are linked."""
    return [list(ends[:number]) for number in range(len(ends))]


@asynccontextmanager
async def far_apart(
    homes: Homes,
    folder: Path,
    overrides: Mapping[str, Sequence[str]],
    *,
    transport: str = "tcp",
    watched: int = 0,
) -> AsyncIterator[tuple[Rig, list[Child]]]:
    """The rig, of which nothing runs yet, and the routers, which do. The observer listens at one of them."""
    ends = doors(homes, transport)
    master = f"{'tls' if transport in SECURE else 'tcp'}/{NURSE}:{MANAGEMENT_PORT}"
    keys = keys_for(transport, folder, [*ends, master], 1)
    tls = [tls_override(keys, Role.ROUTER, ROUTER_NAME)] if keys else []
    endpoints = Endpoints(
        robots=("tcp/192.0.2.1:1",),  # nobody connects to a robot here
        master=master,
        observer=f"tcp/{CALLER}:{MANAGEMENT_PORT}",
        can_port=CAN_PORT,
        router=ends[0],
        keys=keys,
        watched=(ends[watched],),
    )
    async with AsyncExitStack() as stack:
        routers = []
        for number, (host, others) in enumerate(
            zip(homes.routers, each_links_to_those_before(ends), strict=True)
        ):
            child = Child(ROUTER, folder, name=f"router-{number}")
            stack.push_async_callback(child.stop)
            own = [
                f'name="router-{number}"',
                f'link.listen=["{ends[number]}"]',
                f"link.connect={others}",
                *tls,
            ]
            await child.start(example(ROUTER, NURSING), own, host.command(()))
            routers.append(child)
        session = await stack.enter_async_context(open_session(endpoints.observing))
        rig = Rig(folder, endpoints, overrides, session, NURSING, cast("Network", homes))
        stack.push_async_callback(rig.stop)
        yield rig, routers


class Flow:
    """When the newest command that a robot accepted changed, as a watcher of its states sees it."""

    def __init__(self, rig: Rig) -> None:
        self.news_ns: list[int] = []
        self.states: list[tuple[int, RobotState]] = []
        self._last: object = None
        rig.observer.listeners.append(self._hear)

    def _hear(self, message: object) -> None:
        if not isinstance(message, RobotState):
            return
        now_ns = monotonic_ns()
        self.states.append((now_ns, message))
        if message.echo != self._last:
            self._last = message.echo
            self.news_ns.append(now_ns)

    def gap_s(self, since_ns: int) -> float:
        """The longest time without an accepted command from then on."""
        times = [since_ns, *(at_ns for at_ns in self.news_ns if at_ns > since_ns)]
        return max((after - before) / 1e9 for before, after in pairwise(times))
