"""Suit, master and slaves as processes on this machine or on two emulated hosts, and an observer."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from types import MappingProxyType

from common.clock import monotonic_ns, to_ns
from common.errors import TandemError
from common.link import Link, LinkSession, open_session
from common.link.roles import Role
from common.skeleton import load_skeleton
from common.wire.control import ask_control, topic_for
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.together import TOGETHER
from deploy.examples.profiles import NURSING, example
from deploy.harness.child import Child
from deploy.harness.endpoints import Endpoints, local_endpoints, network_endpoints
from deploy.harness.keys import MASTER, tls_override
from deploy.harness.keys import ROUTER as ROUTER_NAME
from deploy.harness.observer import Observer
from deploy.sim.network import Network

ROBOT, OPERATOR = "robot-1", "nurse-1"
ROLES = ("slave", "suit", "master")
ROUTER = "router"
"""The role of the router, of a run whose processes reach each other through one."""
RECORD = "record"
"""The role of a recorder beside a process of the run."""
DRIVES = "drives"
"""The role of the simulated drives, of a run whose overrides name them."""


def robot_name(number: int) -> str:
    """The name of the first, second … robot of a run."""
    return f"robot-{number}"


def slave_name(number: int) -> str:
    """The process name of the first, second … robot of a run."""
    return "slave" if number == 1 else f"slave-{number}"


class Rig:
    """The running processes by name, an observer for each robot, and the requests to them."""

    def __init__(
        self,
        folder: Path,
        endpoints: Endpoints,
        overrides: Mapping[str, Sequence[str]],
        session: LinkSession,
        profile: str = NURSING,
        network: Network | None = None,
        options: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        self._options = options
        self.network = network
        """The hosts on which the processes run; None: this machine itself."""
        self._profile = profile
        self.skeleton = load_skeleton(profile)
        self.folder = folder
        """Where the processes' logs lie; it is deleted with the rig."""
        self._overrides = overrides
        self._endpoints = endpoints
        self._session = session
        numbers = range(1, 1 + len(endpoints.robots))
        self.observers = {
            robot: Observer(session.link(robot), self.skeleton) for robot in map(robot_name, numbers)
        }
        self.observer = self.observers[ROBOT]
        """The first robot's observer; the suit publishes the truth under its name."""
        self.slaves = tuple(map(slave_name, numbers))
        children = [Child("slave", folder, name=name) for name in self.slaves]
        others = [*ROLES[1:], *([DRIVES] if DRIVES in overrides else [])]
        others += [ROUTER] if endpoints.router else []
        self.children = {child.name: child for child in (*children, *(Child(r, folder) for r in others))}

    @property
    def can_port(self) -> int:
        """The UDP port of this run's CAN buses."""
        return self._endpoints.can_port

    @property
    def endpoints(self) -> Endpoints:
        """The endpoints at which the processes of this run listen."""
        return self._endpoints

    def link(self, robot: str = ROBOT) -> Link:
        """The link on which a robot is observed and asked."""
        return self._session.link(robot)

    async def start(self, name: str, through: Sequence[str] = ()) -> None:
        """Start one process, or again, on the profile's example file, moved to this run's endpoints.

        `through`: a command that becomes it, such as `unshare`.
        """
        role = self.children[name].role
        before, options = [*self._host(role), *through], self._options.get(role, ())
        await self.children[name].start(self.file(role), self.overrides(name), before, options)

    def file(self, role: str) -> Path:
        """The example file that the processes of a role run on."""
        return example("slave" if role == DRIVES else role, NURSING if role == ROUTER else self._profile)

    def overrides(self, name: str) -> list[str]:
        """What a process's file is changed by: this run's endpoints, and what was asked for."""
        role = self.children[name].role
        theirs = dict.fromkeys((role, name))
        given = [override for each in theirs for override in self._overrides.get(each, ())]
        overrides = [*_local(name, self.slaves, self._endpoints), *given]
        if DRIVES in self.children and role in ("slave", DRIVES):
            overrides += drive_buses(self._endpoints.can_port)
        return overrides

    def _host(self, role: str) -> list[str]:
        """The command by which a process of that role runs on its host."""
        if self.network is None:
            return []
        host = self.network.robot if role in ("slave", DRIVES) else self.network.operator
        return host.command(())

    def check(self) -> None:
        """Raise TandemError where a process has ended by itself."""
        for child in self.children.values():
            child.check()

    async def until_logged(self, name: str, text: str, timeout_s: float) -> None:
        """Wait until a process has logged something. Raises TandemError where it does not."""
        deadline_ns = monotonic_ns() + to_ns(timeout_s)
        while text not in self.children[name].log_text():
            self.children[name].check()
            if monotonic_ns() > deadline_ns:
                raise TandemError(f"the {name} did not start: {self.children[name].last_lines()}")
            await asyncio.sleep(0.05)

    async def control(
        self, action: Action, operator: str = OPERATOR, key: str = "", robot: str = ROBOT
    ) -> ControlReply:
        """Ask a robot."""
        link = self.link(robot)
        if action is Action.ENGAGE and len(self.slaves) > 1:
            key = key or TOGETHER
        request = ControlRequest(robot, action, operator, key)
        return await ask_control(lambda payload: link.ask(topic_for(action, operator), payload), request)

    async def until(
        self,
        reached: Callable[[], bool],
        timeout_s: float,
        what: str,
        each: Callable[[], None] = lambda: None,
    ) -> None:
        """Wait for a condition on what the observer received. Raises TandemError where it takes too long."""
        deadline_ns = monotonic_ns() + to_ns(timeout_s)
        while not reached():
            each()
            if monotonic_ns() > deadline_ns:
                raise TandemError(f"no {what} within {timeout_s:g} s: {self.observer.waiting_for()}")
            await at_most(self.observer.news(), 0.25)

    async def stop(self) -> dict[str, int | None]:
        """Stop all, the master before the robot, which then holds by itself; their exit statuses.

        The recorders come first: one whose process ends would end by itself meanwhile.
        """
        recorders = [child.name for child in self.children.values() if child.role == RECORD]
        first = (*recorders, "master", "suit", *self.slaves)
        others = [name for name in self.children if name not in (*first, ROUTER)]
        last = [ROUTER] if ROUTER in self.children else []
        return {name: await self.children[name].stop() for name in (*first, *others, *last)}


@asynccontextmanager
async def open_rig(
    transport: str = "tcp",
    overrides: Mapping[str, Sequence[str]] | None = None,
    profile: str = NURSING,
    robots: int = 1,
    routed: bool = False,
    network: Network | None = None,
    options: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> AsyncIterator[Rig]:
    """Open a rig on free endpoints. No process runs yet but the router; all are stopped at the end.

    `routed`: master and robots meet at a router, which is started at once. A secure transport gets new keys.
    `network`: suit, master and router run on its operator's host, the slaves on its robot's host.
    `overrides`: of the example files, by role or by the process's name.
    `options`: of the processes' command lines, by role.
    Raises ConfigError for an unknown transport or profile.
    """
    load_skeleton(profile)
    async with AsyncExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tandem-")))
        if network is None:
            endpoints = local_endpoints(transport, folder, robots, routed)
        else:
            endpoints = network_endpoints(transport, network, folder, robots, routed)
        session = await stack.enter_async_context(open_session(endpoints.observing))
        rig = Rig(folder, endpoints, overrides or {}, session, profile, network, options)
        stack.push_async_callback(rig.stop)
        if routed:
            await rig.start(ROUTER)
        yield rig


async def at_most(wait: Awaitable[object], seconds: float) -> None:
    """Wait for something, but no longer."""
    try:
        await asyncio.wait_for(wait, seconds)
    except TimeoutError:
        return


def drive_buses(port: int) -> list[str]:
    """The override for the slave's two buses to its drives, at a free port of this host."""
    buses = [
        f'{{ name = "{name}", interface = "udp_multicast", channel = "{group}", fd = false, '
        f"options = {{ port = {port}, hop_limit = 0 }} }}"
        for name, group in (("left", "239.74.163.21"), ("right", "239.74.163.22"))
    ]
    return [f"servos.canopen.buses=[{', '.join(buses)}]"]


def _local(name: str, slaves: Sequence[str], endpoints: Endpoints) -> list[str]:
    bus_options = f"{{ port = {endpoints.can_port}, hop_limit = 0 }}"
    if name in slaves:
        number = slaves.index(name)
        robot = robot_name(1 + number)
        link = _link(endpoints, Role.ROBOT, robot, listen=endpoints.listening(number))
        return [f'robot="{robot}"', *link, 'camera.source="off"']
    if name == ROUTER:
        listen = [endpoints.router, *endpoints.watched]
        return _link(endpoints, Role.ROUTER, ROUTER_NAME, listen, through="")
    if name == DRIVES:
        return []
    if name == "master":
        return [
            f"robots={[robot_name(1 + i) for i in range(len(slaves))]}",
            *_link(endpoints, Role.OPERATOR, MASTER, [endpoints.master], endpoints.robots),
            f"capture.buses.0.options={bus_options}",
            "alarms.off=true",
        ]
    return [f'link.connect=["{endpoints.observer}"]', f"buses.0.options={bus_options}"]


def _link(
    endpoints: Endpoints,
    role: Role,
    name: str,
    listen: Sequence[str],
    connect: Sequence[str] = (),
    through: str | None = None,
) -> list[str]:
    """One party's [link]: where it listens and connects, or the router in place of both."""
    router = endpoints.router if through is None else through
    keys = [tls_override(endpoints.keys, role, name)] if endpoints.keys else []
    if router:
        return ['link.mode="client"', "link.listen=[]", f'link.connect=["{router}"]', *keys]
    return [f"link.listen={list(listen)}", f"link.connect={list(connect)}", *keys]
