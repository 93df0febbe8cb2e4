"""An operator's host and a robot's host on this machine, and the emulated link between them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Literal, ParamSpec, TypeVar

from common.errors import NetworkError
from deploy.sim.network.emulation import Emulation, LinkCounters
from deploy.sim.network.host import EmulatedHost
from deploy.sim.network.janitor import Janitor
from deploy.sim.network.namespaces import (
    HOSTS,
    NetworkRun,
    free_slot,
    link_addresses,
    make_host,
    new_run,
    remove_dead,
    why_not,
)
from deploy.sim.network.netem import Netem, faithful, has_netem
from deploy.sim.network.profile import Outage, Profile, load_profile
from deploy.sim.network.tun import Forwarder

Args = ParamSpec("Args")
Result = TypeVar("Result")
Backend = Literal["auto", "forwarder", "netem"]


class Network:
    """The two hosts, and the link as it is now. `set`, `cut` and `counters` block for some 0.2 ms."""

    def __init__(self, hosts: Sequence[EmulatedHost], emulation: Emulation, profile: Profile) -> None:
        self.operator, self.robot = hosts
        self.profile = profile
        self.emulation = emulation
        """What emulates the link: the forwarder, or netem."""
        self._cut = False
        self._outages = 0
        self._script: asyncio.Task[None] | None = None
        self._follow(profile)

    def set(self, profile: Profile | str | Path) -> None:
        """Change the link to another profile; its scripted outages count from now."""
        profile = profile if isinstance(profile, Profile) else load_profile(profile)
        self.emulation.set(profile)
        self.profile = profile
        self._follow(profile)

    def cut(self) -> None:
        """Let nothing pass, either way, until `restore`."""
        self._cut = True
        self._apply()

    def restore(self) -> None:
        """End a `cut`; an outage that is under way goes on."""
        self._cut = False
        self._apply()

    async def outage(self, seconds: float) -> None:
        """Let nothing pass for some time; return when the link is back."""
        self._outages += 1
        try:
            self._apply()
            await asyncio.sleep(seconds)
        finally:
            self._outages -= 1
            self._apply()

    def counters(self) -> LinkCounters:
        """Packets and bytes each way since the network was opened, and what was dropped by cause."""
        return self.emulation.counters()

    def _apply(self) -> None:
        self.emulation.cut(self._cut or self._outages > 0)

    def _follow(self, profile: Profile) -> None:
        if self._script is not None:
            self._script.cancel()
        self._script = asyncio.create_task(self._play(profile.outages)) if profile.outages else None

    async def _play(self, outages: Sequence[Outage]) -> None:
        clock = asyncio.get_running_loop().time
        begun = clock()
        for outage in outages:
            await asyncio.sleep(begun + outage.at_s - clock())
            await self.outage(begun + outage.at_s + outage.for_s - clock())

    async def end_script(self) -> None:
        """Cancel the scripted outages that are still to come."""
        if self._script is not None:
            self._script.cancel()
            with suppress(asyncio.CancelledError, NetworkError):
                await self._script


@asynccontextmanager
async def open_network(
    profile: Profile | str | Path = "lan", *, seed: int = 1, backend: Backend = "auto"
) -> AsyncIterator[Network]:
    """Make two hosts and a link between them; all is removed at the end, even if this process is killed.

    A profile is given by name, by path, or as such. `auto` takes the kernel's netem where there is one and
    the profile has nothing that it does otherwise (`netem.py`), else the forwarder. Raises ConfigError for a
    profile that there is not, and NetworkError where this process may not make hosts.
    """
    profile = profile if isinstance(profile, Profile) else load_profile(profile)
    reason = why_not()
    if reason is not None:
        raise NetworkError(reason)
    run = new_run()
    async with AsyncExitStack() as stack:
        janitor = Janitor(run)
        stack.push_async_callback(asyncio.to_thread, janitor.remove)
        hosts = await _whole(_make_hosts, run)
        emulation = await _whole(_emulate, run, profile, seed, backend)
        stack.callback(emulation.close)
        network = Network(hosts, emulation, profile)
        stack.push_async_callback(network.end_script)
        yield network


async def _whole(function: Callable[Args, Result], *args: Args.args, **named: Args.kwargs) -> Result:
    """Run it in a thread. If cancelled, wait for its end all the same: the janitor must run after it."""
    task = asyncio.ensure_future(asyncio.to_thread(function, *args, **named))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait({task})
        raise


def _emulate(run: NetworkRun, profile: Profile, seed: int, backend: Backend) -> Emulation:
    if backend == "netem" or (backend == "auto" and faithful(profile) and has_netem(run)):
        return Netem(run, profile)
    return Forwarder(run, profile, seed)


def _make_hosts(run: NetworkRun) -> list[EmulatedHost]:
    remove_dead()
    slot = free_slot()
    hosts = []
    for name, (namespace, address, _), caller, management in zip(
        HOSTS, link_addresses(run), slot[::2], slot[1::2], strict=True
    ):
        make_host(run, name, management, caller)
        hosts.append(EmulatedHost(name, namespace, address, management, caller))
    return hosts
