"""The kernel's own emulation of the same profiles: `tc netem` at each end of a veth.

It draws every packet's delay by itself. A rate makes it keep their order, so that with jitter those behind
wait for the slowest ahead, and the mean grows with the packet rate; what is reordered is not held back but
sent at once. Profiles without either are the same here and there.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

from common.errors import NetworkError
from deploy.sim.network.emulation import LinkCounters
from deploy.sim.network.loss import gilbert_elliott
from deploy.sim.network.namespaces import LINK, NetworkRun, ip, link_addresses
from deploy.sim.network.profile import PACKET_BITS, Profile, Way
from deploy.sim.network.scheduler import OUTAGE, Counters

ORDER_MBIT = 10_000.0
"""Only with a rate netem keeps the order; the link's own rate and its queue in bytes are a child's."""
MOST_PACKETS = 10_000
BURST_S = 0.001
"""A kernel's timers are not finer than this: so much may pass at once."""
NETEM = "netem"
"""The kernel counts what it drops together: by chance and by a full queue."""


def faithful(profile: Profile) -> bool:
    """Whether netem emulates every key of the profile as the profile defines it."""
    ways = (profile.ways.to_robot, profile.ways.to_operator)
    return not any(way.jitter_ms or way.reorder_percent or way.largest_bytes for way in ways)


def has_netem(run: NetworkRun) -> bool:
    """Whether this kernel has it; tried on a host's loopback."""
    host = next(link_addresses(run))[0]
    try:
        ip("-n", host, "qdisc", "add", "dev", "lo", "root", "netem", tool="tc")
        ip("-n", host, "qdisc", "delete", "dev", "lo", "root", tool="tc")
    except NetworkError:
        return False
    return True


def netem_arguments(way: Way) -> list[str]:
    """The arguments of `tc qdisc … netem` for one direction, without the rate."""
    # its limit is in packets, whatever their size: no bound for a queue, so none of this link's
    arguments = ["limit", str(MOST_PACKETS), "delay", f"{way.delay_ms:g}ms"]
    if way.jitter_ms:
        arguments += [f"{way.jitter_ms:g}ms", "distribution", "normal"]
    if way.loss_percent:
        arguments += _loss(way)
    if way.duplicate_percent:
        arguments += ["duplicate", f"{way.duplicate_percent:g}%"]
    if way.reorder_percent:
        arguments += ["reorder", f"{way.reorder_percent:g}%"]
    return [*arguments, "rate", f"{ORDER_MBIT:g}mbit"]


def child_arguments(way: Way) -> list[str]:
    """The queue behind: a token bucket where the link has a rate, bounded in bytes."""
    if way.rate_mbit is None:
        return ["pfifo", "limit", str(MOST_PACKETS)]
    burst = round(max(2 * PACKET_BITS, way.rate_mbit * 1e6 * BURST_S) / 8)
    return ["tbf", "rate", f"{way.rate_mbit:g}mbit", "burst", str(burst), "limit", str(way.queue_bytes)]


def _loss(way: Way) -> list[str]:
    if way.burst_packets is None:
        return ["loss", "random", f"{way.loss_percent:g}%"]
    model = gilbert_elliott(way)
    chances = (model.to_bad, model.to_good, model.lost_in_bad, model.lost_in_good)
    return ["loss", "gemodel", *(f"{100.0 * chance:.6g}%" for chance in chances)]


class Netem:
    """An emulation by the kernel. What it does blocks for as long as `tc` runs, some 5 ms."""

    name = "netem"

    def __init__(self, run: NetworkRun, profile: Profile) -> None:
        """Raises NetworkError where this kernel has no netem."""
        self._run = run
        self._profile = profile
        self._cut = False
        self._handle = 1
        self._totals = {host: Counters(dropped={}) for host, _, _ in link_addresses(run)}
        self._seen = dict.fromkeys(self._totals, (0, 0, 0))
        """Packets, bytes and drops that the kernel's own counters showed last."""
        (ours, _, _), (theirs, _, _) = link_addresses(run)
        # the pair is made in its place: no name of it is ever in the caller's namespace
        ip("-n", ours, "link", "add", LINK, "type", "veth", "peer", "name", LINK, "netns", theirs)
        for host, address, peer in link_addresses(run):
            ip("-n", host, "link", "set", LINK, "addrgenmode", "none")
            ip("-n", host, "address", "add", address, "peer", peer, "dev", LINK)
            ip("-n", host, "link", "set", LINK, "up")
        self._apply()

    def set(self, profile: Profile) -> None:
        """Change the link to this profile; packets under way arrive as planned."""
        self._profile = profile
        self._apply()

    def cut(self, cut: bool) -> None:
        """Let nothing pass, or let it pass again; packets under way are lost."""
        if cut == self._cut:
            return
        self._count()
        self._cut = cut
        self._apply()
        if cut:
            # another handle is another qdisc: what is under way goes with the old one, which lets no more in
            for host in self._totals:
                waiting, total = self._count_one(host), self._totals[host]
                total.packets += waiting
                total.dropped[OUTAGE] = total.dropped.get(OUTAGE, 0) + waiting
                self._seen[host] = (0, 0, 0)
            self._handle += 1
            self._apply()

    def counters(self) -> LinkCounters:
        """Packets and bytes each way so far, as the kernel counts them."""
        self._count()
        to_robot, to_operator = (replace(one, dropped=dict(one.dropped)) for one in self._totals.values())
        return LinkCounters(to_robot, to_operator)

    def close(self) -> None:
        """It ends with its hosts."""

    def _apply(self) -> None:
        for host, way in self._ways():
            what = ["loss", "100%"] if self._cut else netem_arguments(way)
            handle = ["root", "handle", f"{self._handle:x}:"]
            ip("-n", host, "qdisc", "replace", "dev", LINK, *handle, "netem", *what, tool="tc")
            child = ["parent", f"{self._handle:x}:1"]
            ip("-n", host, "qdisc", "replace", "dev", LINK, *child, *child_arguments(way), tool="tc")

    def _ways(self) -> Iterator[tuple[str, Way]]:
        ways = self._profile.ways
        hosts = [host for host, _, _ in link_addresses(self._run)]
        return zip(hosts, (ways.to_robot, ways.to_operator), strict=True)

    def _count(self) -> None:
        for host in self._totals:
            self._count_one(host)

    def _count_one(self, host: str) -> int:
        """Add what has happened since it was last asked; returns how many packets are under way."""
        qdiscs = json.loads(ip("-n", host, "-s", "-j", "qdisc", "show", "dev", LINK, tool="tc"))
        (qdisc,) = [each for each in qdiscs if each["kind"] == "netem"]
        now = (qdisc["packets"], qdisc["bytes"], qdisc["drops"])
        sent, size, dropped = (new - old for new, old in zip(now, self._seen[host], strict=True))
        self._seen[host] = now
        total, why = self._totals[host], OUTAGE if self._cut else NETEM
        total.packets += sent + dropped
        total.bytes += size
        total.delivered += sent
        total.delivered_bytes += size
        total.dropped[why] = total.dropped.get(why, 0) + dropped
        return int(qdisc.get("qlen", 0))
