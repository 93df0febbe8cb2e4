"""A small internet of namespaces: routers and a nurse on public addresses, a home behind two translations.

    robot 192.168.7.2 ── home's box ── 100.64.7.0/24 ── carrier ── 198.18.77.0/24 ── routers, nurse
                         masquerades                   masquerades    (a bridge)     and the caller

The boxes let nothing in that the home did not begin, as a home's and a carrier's do.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache

from common.errors import NetworkError
from deploy.sim.network.host import EmulatedHost
from deploy.sim.network.janitor import Janitor
from deploy.sim.network.namespaces import NetworkRun, ip, new_run, remove_dead, why_not

PUBLIC, CARRIER, HOME = "198.18.77", "100.64.7", "192.168.7"
CALLER, NURSE, TRANSLATED, MOVED = (f"{PUBLIC}.{number}" for number in (100, 21, 31, 32))
ROUTERS = tuple(f"{PUBLIC}.{11 + number}" for number in range(3))
_RULES = """
table ip homes {{
  chain after {{
    type nat hook postrouting priority 100;
    oifname "{wan}" masquerade
  }}
  chain through {{
    type filter hook forward priority 0;
    iifname "{wan}" ct state new,invalid drop
  }}
  chain cut {{
    type filter hook prerouting priority -300;
  }}
}}
"""


@cache
def why_no_homes() -> str | None:
    """Why this host has no address translation for namespaces; None where it has."""
    reason = why_not()
    if reason is not None:
        return reason
    if shutil.which("nft") is None:
        return "`nft` is missing: install nftables"
    probe = "table ip probe {\nchain after {\ntype nat hook postrouting priority 100;\nmasquerade\n}\n}\n"
    command = ["unshare", "--net", "nft", "-f", "-"]
    done = subprocess.run(command, input=probe, capture_output=True, text=True, timeout=20, check=False)
    return f"this kernel has no masquerading: {done.stderr.strip()[:120]}" if done.returncode else None


@dataclass(frozen=True, slots=True)
class Homes:
    """The hosts, and what can be done to the line between them."""

    run: NetworkRun
    robot: EmulatedHost
    nurse: EmulatedHost
    routers: Sequence[EmulatedHost]

    @property
    def operator(self) -> EmulatedHost:
        """As a rig calls it."""
        return self.nurse

    def cut(self) -> None:
        """Nothing passes the home's box any more, and nobody is told: neither box sees the line in use."""
        self._nft("box", "add rule ip homes cut drop")

    def restore(self) -> None:
        """It does again."""
        self._nft("box", "flush chain ip homes cut")

    def forget_after(self, seconds: int) -> None:
        """Both boxes forget a mapping that is idle for so long, TCP and UDP."""
        base = "/proc/sys/net/netfilter/nf_conntrack"
        names = ("tcp_timeout_established", "tcp_timeout_unacknowledged", "udp_timeout", "udp_timeout_stream")
        for box in ("carrier", "box"):
            for name in names:
                self._in(box, "sh", "-c", f"echo {seconds} > {base}_{name}")

    def mappings(self, port: int) -> int:
        """How many mappings to a port the carrier remembers."""
        seen = self._in("carrier", "cat", "/proc/net/nf_conntrack")
        return sum(f"dport={port} " in line for line in seen.splitlines())

    def move(self) -> None:
        """The carrier gives the home another public address."""
        ip("-n", self._name("carrier"), "address", "flush", "dev", "wan")
        ip("-n", self._name("carrier"), "address", "add", f"{MOVED}/24", "dev", "wan")

    def unplug(self, router: int) -> None:
        """A router's host is gone at once, without a word."""
        ip("-n", self.routers[router].namespace, "link", "set", "wan", "down")

    def _name(self, host: str) -> str:
        return self.run.namespace(host)

    def _in(self, host: str, *command: str) -> str:
        return ip("netns", "exec", self._name(host), *command)

    def _nft(self, host: str, rule: str) -> None:
        self._in(host, "nft", *rule.split())


@contextmanager
def open_homes(routers: int = 1) -> Iterator[Homes]:
    """Make it; all is removed at the end, even if this process is killed. Raises NetworkError."""
    remove_dead()
    run = new_run()
    janitor = Janitor(run)
    try:
        yield _made(run, routers)
    finally:
        janitor.remove()


def _made(run: NetworkRun, routers: int) -> Homes:
    names = [f"router{number}" for number in range(routers)]
    for host in ("internet", "carrier", "box", "robot", "nurse", *names):
        ip("netns", "add", run.namespace(host))
        ip("-n", run.namespace(host), "link", "set", "lo", "up", "multicast", "on")
        ip("-n", run.namespace(host), "route", "add", "239.0.0.0/8", "dev", "lo")
    ip("-n", run.namespace("internet"), "link", "add", "public", "type", "bridge", "forward_delay", "0")
    ip("-n", run.namespace("internet"), "link", "set", "public", "up")
    addresses = {"nurse": NURSE, "carrier": TRANSLATED, **dict(zip(names, ROUTERS, strict=False))}
    for host, address in addresses.items():
        _plug(run, host, address)
    _plug_caller(run)
    _join(run, ("carrier", "lan", f"{CARRIER}.1"), ("box", "wan", f"{CARRIER}.2"))
    _join(run, ("box", "lan", f"{HOME}.1"), ("robot", "wan", f"{HOME}.2"))
    for box in ("carrier", "box"):
        name = run.namespace(box)
        ip("netns", "exec", name, "sh", "-c", "echo 1 > /proc/sys/net/ipv4/ip_forward")
        rules = _RULES.format(wan="wan")
        command = ["ip", "netns", "exec", name, "nft", "-f", "-"]
        done = subprocess.run(command, input=rules, capture_output=True, text=True, timeout=20, check=False)
        if done.returncode:
            raise NetworkError(f"nft: {done.stderr.strip()}")
    ip("-n", run.namespace("box"), "route", "add", "default", "via", f"{CARRIER}.1")
    ip("-n", run.namespace("robot"), "route", "add", "default", "via", f"{HOME}.1")
    return Homes(
        run, _host(run, "robot", f"{HOME}.2"), _host(run, "nurse", NURSE),
        [_host(run, name, address) for name, address in zip(names, ROUTERS, strict=False)],
    )  # fmt: skip


def _host(run: NetworkRun, name: str, address: str) -> EmulatedHost:
    return EmulatedHost(name, run.namespace(name), address, address, CALLER)


def _plug(run: NetworkRun, host: str, address: str) -> None:
    """A host's interface `wan` into the bridge."""
    internet, name = run.namespace("internet"), run.namespace(host)
    ip(
        "-n",
        internet,
        "link",
        "add",
        "name",
        f"to-{host}",
        "type",
        "veth",
        "peer",
        "name",
        "wan",
        "netns",
        name,
    )
    ip("-n", internet, "link", "set", f"to-{host}", "master", "public", "up")
    ip("-n", name, "address", "add", f"{address}/24", "dev", "wan")
    ip("-n", name, "link", "set", "wan", "up")


def _plug_caller(run: NetworkRun) -> None:
    """The caller's own namespace, so that an observer hears as any other host does."""
    veth, internet = f"{run.short}c", run.namespace("internet")
    ip("link", "add", veth, "type", "veth", "peer", "name", "caller", "netns", internet)
    ip("link", "set", veth, "alias", run.name)
    ip("-n", internet, "link", "set", "caller", "master", "public", "up")
    ip("address", "add", f"{CALLER}/24", "dev", veth)
    ip("link", "set", veth, "up")


def _join(run: NetworkRun, one: tuple[str, str, str], other: tuple[str, str, str]) -> None:
    """A wire between two hosts: namespace, interface and address of each."""
    (host, interface, address), (far, far_interface, far_address) = one, other
    name, far_name = run.namespace(host), run.namespace(far)
    ip("-n", name, "link", "add", interface, "type", "veth", "peer", "name", far_interface, "netns", far_name)
    for where, what, its in ((name, interface, address), (far_name, far_interface, far_address)):
        ip("-n", where, "address", "add", f"{its}/24", "dev", what)
        ip("-n", where, "link", "set", what, "up")
