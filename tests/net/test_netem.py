"""The kernel's own emulation, for correctness: on a slow machine packets are later, never earlier."""

from __future__ import annotations

import asyncio
import json

import pytest

from common.errors import NetworkError
from deploy.ops.network.figures import Measured
from deploy.ops.network.verify import measure
from deploy.sim.network import Network, Profile, load_profile, open_network, profile_names
from deploy.sim.network.namespaces import LINK, ip, make_host, new_run, remove
from deploy.sim.network.netem import has_netem

MIXED = Profile.model_validate(
    {
        "name": "mixed",
        "both": {"loss_percent": 10.0, "burst_packets": 3.0, "rate_mbit": 1.0, "queue_ms": 100.0},
        "to_robot": {"delay_ms": 60.0},
        "to_operator": {"delay_ms": 20.0, "duplicate_percent": 10.0},
    }
)


@pytest.fixture(scope="module", autouse=True)
def _netem() -> None:
    run = new_run()
    try:
        make_host(run, "operator", "198.19.255.250", "198.19.255.249")
        there = has_netem(run)
    finally:
        remove(run)
    if not there:
        pytest.skip("this kernel has no netem: tests/contract/test_on_kernel.py runs these on one that has")


def test_the_link_has_its_profile_and_is_cut_and_counted() -> None:
    async def story() -> None:
        async with open_network(MIXED) as network:
            assert network.emulation.name == "netem"  # by itself: nothing in it that netem does otherwise
            judge(await measure(network, 3.0, rate_hz=100.0))
            await cut(network)
            for name in profile_names():
                network.set(load_profile(name).model_copy(update={"outages": []}))
                taken(network, name)

    asyncio.run(story())


def judge(measured: Measured) -> None:
    there, back = measured.to_robot, measured.to_operator
    assert there.p50_ms > 60.0
    assert 20.0 < back.p50_ms < there.p50_ms
    for way in (there, back):
        assert way.loss_kept, way.tree()
        assert way.loss_percent > 0.0
        assert way.reordered_percent == 0.0
        assert way.rate_mbit is not None
        assert way.rate_mbit < 1.05  # no slow machine makes it faster
    assert there.duplicate_percent == 0.0
    assert 3.0 < back.duplicate_percent < 17.0


async def cut(network: Network) -> None:
    before = network.counters().to_robot
    network.cut()
    with pytest.raises(NetworkError, match="none of 20 packets"):
        await measure(network, 0.2, rate_hz=100.0)
    network.restore()
    after = network.counters().to_robot
    assert after.dropped["outage"] >= 20
    assert after.delivered == before.delivered


def taken(network: Network, name: str) -> None:
    """What the kernel says of itself is what the profile says."""
    ways = load_profile(name).ways
    for host, way in ((network.operator, ways.to_robot), (network.robot, ways.to_operator)):
        told = json.loads(ip("-n", host.namespace, "-j", "qdisc", "show", "dev", LINK, tool="tc"))
        (netem,) = [each["options"] for each in told if each["kind"] == "netem"]
        (bucket,) = [each["options"] for each in told if each["kind"] == "tbf"]
        assert way.rate_mbit is not None
        assert bucket["rate"] == pytest.approx(way.rate_mbit * 1e6 / 8, rel=0.01)
        assert netem["delay"]["delay"] == pytest.approx(way.delay_ms / 1e3, rel=0.01)
