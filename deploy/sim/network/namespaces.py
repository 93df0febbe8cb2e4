"""Hosts as network namespaces: made, named so that those of a dead run are recognised, and removed."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from common.errors import NetworkError

HOSTS = OPERATOR, ROBOT = ("operator", "robot")
LINK = "emulated"
"""The emulated link's interface, in both hosts."""
MANAGEMENT = "management"
LINK_NETWORK = "198.18.0"
"""A network in the range for tests (RFC 2544): no other interface of a machine has it."""
MANAGEMENT_NETWORK = "198.19"
"""Slots of eight addresses: each run takes one, as the caller's namespace is shared by runs."""
MULTICAST = "239.0.0.0/8"
CAP_NET_ADMIN, CAP_SYS_ADMIN = 12, 21
_RUN = re.compile(r"tandem-(\d+)-(\d+)-([0-9a-f]{6})")


@dataclass(frozen=True, slots=True)
class NetworkRun:
    """One network's name: which process made it, when that began, and a random part."""

    pid: int
    started: int
    token: str

    @property
    def name(self) -> str:
        """The prefix of the names of all that the run makes."""
        return f"tandem-{self.pid}-{self.started}-{self.token}"

    @property
    def short(self) -> str:
        """An interface's name has 15 characters."""
        return f"td{self.token}"

    def namespace(self, host: str) -> str:
        """The name of a host's namespace."""
        return f"{self.name}-{host}"

    @property
    def alive(self) -> bool:
        """Whether the process that made it still runs; another may have its number."""
        return _started(self.pid) == self.started


def new_run() -> NetworkRun:
    """A new run of this process."""
    pid = os.getpid()
    return NetworkRun(pid, _started(pid) or 0, secrets.token_hex(3))


def parse_run(name: str) -> NetworkRun | None:
    """The run of a namespace or interface, by its name or alias; None for what is not ours."""
    match = _RUN.match(name)
    return NetworkRun(int(match[1]), int(match[2]), match[3]) if match else None


def why_not() -> str | None:
    """Why this process cannot make hosts, and what to do; None where it can."""
    if shutil.which("ip") is None:
        return "`ip` is missing: install iproute2"
    status = Path("/proc/self/status").read_text("utf-8")
    effective = int(re.findall(r"^CapEff:\s*(\w+)", status, re.MULTILINE)[0], 16)
    if not effective >> CAP_NET_ADMIN & 1 or not effective >> CAP_SYS_ADMIN & 1:
        return "network namespaces need root, or CAP_NET_ADMIN and CAP_SYS_ADMIN: try sudo"
    return None


def ip(*arguments: str, tool: str = "ip") -> str:
    """Run iproute2. Raises NetworkError with its words."""
    try:
        done = subprocess.run(
            [tool, *arguments],
            capture_output=True,
            text=True,
            timeout=20,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except FileNotFoundError:
        raise NetworkError(f"`{tool}` is missing: install iproute2") from None
    except subprocess.TimeoutExpired:
        raise NetworkError(f"{tool} {' '.join(arguments)}: did not end") from None
    if done.returncode:
        reason = done.stderr.strip().removeprefix("RTNETLINK answers: ")
        raise NetworkError(f"{tool} {' '.join(arguments)}: {reason}")
    return done.stdout


def link_addresses(run: NetworkRun) -> Iterator[tuple[str, str, str]]:
    """Each host's namespace, its own address on the emulated link, and the other's."""
    ours, theirs = f"{LINK_NETWORK}.1", f"{LINK_NETWORK}.2"
    yield run.namespace(OPERATOR), ours, theirs
    yield run.namespace(ROBOT), theirs, ours


CONGESTION_CONTROLS = ("cubic", "reno")
"""TCP's congestion control on every emulated host: the first that the kernel permits. A namespace
inherits the machine's, which decides how tcp fares on a long line: on 380 ms bbr is silent
six times a minute, these never."""
_PERMITTED = Path("/proc/sys/net/ipv4/tcp_allowed_congestion_control")


def congestion_control() -> str:
    """What emulated hosts use on this machine. Raises NetworkError where none is permitted."""
    permitted = _PERMITTED.read_text("ascii").split()
    chosen = next((name for name in CONGESTION_CONTROLS if name in permitted), None)
    if chosen is None:
        needed = " or ".join(CONGESTION_CONTROLS)
        raise NetworkError(f"{_PERMITTED} permits {', '.join(permitted)}; add {needed}")
    return chosen


def make_host(run: NetworkRun, host: str, management: str, caller: str) -> None:
    """A namespace with loopback, multicast on it, and a veth to the caller. Raises NetworkError."""
    name, veth = run.namespace(host), f"{run.short}{host[0]}"
    ip("netns", "add", name)
    choice = f"echo {congestion_control()} > /proc/sys/net/ipv4/tcp_congestion_control"
    ip("netns", "exec", name, "sh", "-c", choice)
    ip("-n", name, "link", "set", "lo", "up", "multicast", "on")
    # python-can's udp_multicast: the suit's bus stays within its host
    ip("-n", name, "route", "add", MULTICAST, "dev", "lo")
    ip("link", "add", veth, "type", "veth", "peer", "name", MANAGEMENT, "netns", name)
    ip("link", "set", veth, "alias", run.name)
    ip("link", "set", veth, "addrgenmode", "none")
    ip("-n", name, "link", "set", MANAGEMENT, "addrgenmode", "none")
    ip("address", "add", f"{caller}/30", "dev", veth)
    ip("-n", name, "address", "add", f"{management}/30", "dev", MANAGEMENT)
    ip("link", "set", veth, "up")
    ip("-n", name, "link", "set", MANAGEMENT, "up")


def free_slot() -> list[str]:
    """Four addresses that no interface of this namespace has: caller and host, for each of two hosts."""
    taken = {a.get("local", "") for i in json.loads(ip("-j", "address")) for a in i.get("addr_info", [])}
    while True:
        high, low = secrets.randbelow(256), 8 * secrets.randbelow(32)
        slot = [f"{MANAGEMENT_NETWORK}.{high}.{low + offset}" for offset in (1, 2, 5, 6)]
        if not taken.intersection(slot):
            return slot


def remove(run: NetworkRun) -> None:
    """Remove all of a run: the processes in its namespaces, its veths, its namespaces."""
    for namespace in _namespaces():
        if parse_run(namespace) == run:
            with suppress(NetworkError):
                for pid in ip("netns", "pids", namespace).split():
                    with suppress(ProcessLookupError):
                        os.kill(int(pid), signal.SIGKILL)
    for link in json.loads(ip("-j", "link", "show", "type", "veth") or "[]"):
        if parse_run(link.get("ifalias", "")) == run:
            with suppress(NetworkError):  # gone with its namespace
                ip("link", "delete", link["ifname"])
    for namespace in _namespaces():
        if parse_run(namespace) == run:
            with suppress(NetworkError):  # another run removes it too
                ip("netns", "delete", namespace)


def remove_dead() -> list[str]:
    """Remove what dead runs left behind; returns their names."""
    names = [*_namespaces(), *(i.get("ifalias", "") for i in json.loads(ip("-j", "link")))]
    dead = {run for name in names if (run := parse_run(name)) is not None and not run.alive}
    for run in dead:
        remove(run)
    return sorted(run.name for run in dead)


def _namespaces() -> list[str]:
    return [line.split()[0] for line in ip("netns", "list").splitlines() if line.strip()]


def _started(pid: int) -> int | None:
    """When a process began, clock ticks since boot; None where there is none."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text("utf-8", errors="replace")
    except OSError:
        return None
    return int(stat.rpartition(")")[2].split()[19])
