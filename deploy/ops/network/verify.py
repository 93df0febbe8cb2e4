"""Measure an emulated link from both ends: first at a steady rate, then with more than its rate."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Sequence
from dataclasses import replace

from common.clock import to_ms, to_ns, wall_ns
from common.errors import NetworkError
from common.metrics.tree import from_tree
from deploy.ops.network.figures import Measured, WayMeasured, judge, rate_mbit
from deploy.ops.network.probe import ProbePlan, ProbeResult
from deploy.sim.network.host import EmulatedHost
from deploy.sim.network.network import Network
from deploy.sim.network.profile import Way
from deploy.sim.network.scheduler import LOSS, Counters

RATE_HZ = 200.0
SMALL, FULL = 128, 1400
"""Bytes of an IP packet: about a command's, and of one that fills a link."""
START_S = 0.05
"""From the word to both ends until they begin."""
LINGER_S = 0.5
"""Beyond the link's own delay and queue."""
FLOOD_S, FLOOD_OVER = 1.5, 1.3
"""How long more than the link's rate is sent, and how much more."""
MOST_MBIT = 35.0
"""A faster link is not filled: the probe in Python would be what is measured."""


async def measure(network: Network, seconds: float = 10.0, rate_hz: float = RATE_HZ) -> Measured:
    """Send packets both ways, and judge what arrives. Raises NetworkError where nothing does."""
    hosts, emulation = (network.operator, network.robot), network.emulation
    ways = (network.profile.ways.to_robot, network.profile.ways.to_operator)
    before = emulation.counters()
    count = round(seconds * rate_hz)
    ends = await _run(hosts, ways, (rate_hz, rate_hz), (count, count), SMALL)
    after = emulation.counters()
    both = ((before.to_robot, after.to_robot), (before.to_operator, after.to_operator))
    judged = []
    for number, (way, counters) in enumerate(zip(ways, both, strict=True)):
        sent, arrivals = ends[number].sent, ends[1 - number].arrivals
        drawn = (_mean_ms(*counters), _loss_percent(*counters))
        judged.append(judge(way, sent, arrivals, SMALL, seconds, *drawn))
    to_robot, to_operator = await _fill(network, judged)
    return Measured(network.profile.name, emulation.name, to_robot, to_operator)


async def _fill(network: Network, judged: Sequence[WayMeasured]) -> list[WayMeasured]:
    """With the rate that came through when more was sent, where the link is slow enough to be filled."""
    hosts = (network.operator, network.robot)
    ways = (network.profile.ways.to_robot, network.profile.ways.to_operator)
    limits = [way.rate_mbit if way.rate_mbit and way.rate_mbit <= MOST_MBIT else 0.0 for way in ways]
    if not any(limits):
        return list(judged)
    # packets a second; an end that has nothing to fill sends one packet
    rates = [FLOOD_OVER * limit * 1e6 / (8 * FULL) or 1.0 for limit in limits]
    counts = [round(FLOOD_S * rate) if limit else 1 for rate, limit in zip(rates, limits, strict=True)]
    before = network.emulation.counters()
    ends = await _run(hosts, ways, rates, counts, FULL)
    after = network.emulation.counters()
    both = ((before.to_robot, after.to_robot), (before.to_operator, after.to_operator))
    drawn = [_carried_loss(*counters) for counters in both]
    filled = []
    for number, (way, limit, one) in enumerate(zip(ways, limits, judged, strict=True)):
        if limit:
            came = rate_mbit(ends[1 - number].arrivals, FULL)
            # what is lost has had its time on the link; what comes twice had it once. One burst is much
            # of a short flood: what was drawn counts, where it is known, and not the profile's mean
            known = drawn[number]
            lost = way.loss_percent / 100.0 if known is None else known
            share = (1.0 - lost) * (1.0 + way.duplicate_percent / 100.0)
            one = replace(one, rate_mbit=came, expected_rate_mbit=limit * share)
        filled.append(one)
    return filled


async def _run(
    hosts: Sequence[EmulatedHost],
    ways: Sequence[Way],
    rates_hz: Sequence[float],
    counts: Sequence[int],
    size: int,
) -> list[ProbeResult]:
    last_s = max(count / rate for count, rate in zip(counts, rates_hz, strict=True))
    travel_ms = max(way.delay_ms + 6.0 * way.jitter_ms + way.reorder_ms + way.queue_ms for way in ways)
    plans = [
        ProbePlan(here.address, there.address, rate, count, size, last_s + travel_ms / 1e3 + LINGER_S)
        for here, there, rate, count in zip(hosts, hosts[::-1], rates_hz, counts, strict=True)
    ]
    probes: list[asyncio.subprocess.Process] = []
    try:
        for host, plan in zip(hosts, plans, strict=True):
            probes.append(await _start(host, plan))
        for probe in probes:
            assert probe.stdout is not None
            await probe.stdout.readline()  # "ready", or nothing: then it tells why at its end
        word = f"{wall_ns() + to_ns(START_S)}\n".encode()
        return await asyncio.gather(*(_noted(host, p, word) for host, p in zip(hosts, probes, strict=True)))
    finally:
        for probe in probes:
            if probe.returncode is None:
                probe.kill()
                await probe.wait()


async def _start(host: EmulatedHost, plan: ProbePlan) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        *host.command([sys.executable, "-m", "deploy.ops.network.probe", *plan.arguments()]),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )


async def _noted(host: EmulatedHost, process: asyncio.subprocess.Process, word: bytes) -> ProbeResult:
    output, failed = await process.communicate(word)
    if process.returncode:
        words = failed.decode(errors="replace").strip().splitlines()[-1:]
        raise NetworkError(f"the probe on the {host.name}'s host ended: {' '.join(words)}")
    return from_tree(ProbeResult, json.loads(output))


def _loss_percent(before: Counters, after: Counters) -> float | None:
    """The loss between the two counts, %; None if random losses are not counted separately."""
    packets = after.packets - before.packets
    if LOSS not in after.dropped or not packets:
        return None
    return 100.0 * (after.dropped[LOSS] - before.dropped.get(LOSS, 0)) / packets


def _carried_loss(before: Counters, after: Counters) -> float | None:
    """The share lost by chance of the packets that the queue let on the link; None where it is not known."""
    if LOSS not in after.dropped:
        return None
    refused = sum(after.dropped[why] - before.dropped.get(why, 0) for why in after.dropped if why != LOSS)
    carried = after.packets - before.packets - refused
    return (after.dropped[LOSS] - before.dropped.get(LOSS, 0)) / carried if carried else None


def _mean_ms(before: Counters, after: Counters) -> float | None:
    """The mean delay drawn for the packets between the two; None where the emulation does not report it."""
    count = after.planned - before.planned
    return to_ms(after.planned_ns - before.planned_ns) / count if count else None
