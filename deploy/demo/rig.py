"""Suit, master and slave as processes on one machine, and an observer beside them: for demo and tests."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

from common.clock import monotonic_ns, to_ns
from common.control import ask_control
from common.errors import TandemError
from common.link import Link, open_link
from common.messages import Action, ControlReply, ControlRequest
from common.skeleton import load_skeleton
from common.topics import CONTROL
from deploy.demo.child import Child
from deploy.demo.endpoints import Endpoints, local_endpoints
from deploy.demo.observer import Observer
from deploy.profiles import NURSING, example

ROBOT, OPERATOR = "robot-1", "nurse-1"
ROLES = ("slave", "suit", "master")


class Rig:
    """The running processes by role, what the observer hears, and the way to ask the robot."""

    def __init__(
        self,
        folder: Path,
        endpoints: Endpoints,
        overrides: Mapping[str, Sequence[str]],
        link: Link,
        profile: str = NURSING,
    ) -> None:
        self.skeleton = load_skeleton(profile)
        self._overrides = overrides
        self._endpoints = endpoints
        self._link = link
        self.observer = Observer(link, self.skeleton)
        self.children = {role: Child(role, folder) for role in ROLES}

    async def start(self, role: str) -> None:
        """Start one process on the profile's example file, moved to this run's endpoints."""
        overrides = [*_local(role, self._endpoints), *self._overrides.get(role, ())]
        await self.children[role].start(example(role, self.skeleton.name), overrides)

    async def control(self, action: Action, operator: str = OPERATOR, key: str = "") -> ControlReply:
        """Ask the robot."""
        request = ControlRequest(ROBOT, action, operator, key)
        return await ask_control(lambda payload: self._link.ask(CONTROL, payload), request)

    async def until(
        self,
        reached: Callable[[], bool],
        timeout_s: float,
        what: str,
        each: Callable[[], None] = lambda: None,
    ) -> None:
        """Wait for a condition on what the observer hears. Raises TandemError when it does not come."""
        deadline_ns = monotonic_ns() + to_ns(timeout_s)
        while not reached():
            each()
            if monotonic_ns() > deadline_ns:
                raise TandemError(f"no {what} within {timeout_s:g} s: {self.observer.waiting_for()}")
            await at_most(self.observer.news(), 0.25)

    async def stop(self) -> dict[str, int | None]:
        """Stop all, the master first, so that the robot shows that it holds by itself; exit statuses."""
        return {role: await self.children[role].stop() for role in ("master", "suit", "slave")}


@asynccontextmanager
async def open_rig(
    transport: str = "tcp", overrides: Mapping[str, Sequence[str]] | None = None, profile: str = NURSING
) -> AsyncIterator[Rig]:
    """Open a rig on free local endpoints; nothing is started yet, everything is stopped at the end.

    Raises ConfigError for a transport or a profile that there is not.
    """
    load_skeleton(profile)
    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-")))
        endpoints = local_endpoints(transport, folder)
        link = await stack.enter_async_context(open_link(endpoints.observing, ROBOT))
        rig = Rig(folder, endpoints, overrides or {}, link, profile)
        stack.push_async_callback(rig.stop)
        yield rig


async def at_most(wait: Awaitable[object], seconds: float) -> None:
    """Wait for something, but no longer."""
    try:
        await asyncio.wait_for(wait, seconds)
    except TimeoutError:
        return


def _local(role: str, endpoints: Endpoints) -> list[str]:
    bus_options = f"{{ port = {endpoints.can_port}, hop_limit = 0 }}"
    if role == "slave":
        return [f'link.listen=["{endpoints.robot}"]', 'camera.source="off"']
    if role == "master":
        return [
            f'link.connect=["{endpoints.robot}"]',
            f'link.listen=["{endpoints.master}"]',
            f"capture.buses.0.options={bus_options}",
        ]
    return [f'link.connect=["{endpoints.observer}"]', f"buses.0.options={bus_options}"]
