"""The same pair by endpoint alone over each transport, and a suit on two buses, one classic and one FD."""

from __future__ import annotations

import asyncio
import socket

import pytest

from common.messages import Action
from common.skeleton import load_skeleton
from deploy.rig.endpoints import TRANSPORTS
from deploy.rig.rig import ROLES, Rig, open_rig

pytestmark = pytest.mark.hosts


async def tracks(rig: Rig) -> None:
    for role in ROLES:
        await rig.start(role)
    await rig.until(lambda: rig.observer.ready, 30.0, "readiness")
    reply = await rig.control(Action.ENGAGE)
    assert reply.done, reply.text
    await rig.until(lambda: rig.observer.guard == "track", 20.0, "track")


@pytest.mark.parametrize("transport", [t for t in TRANSPORTS if t != "tcp"])
def test_the_robot_tracks_over(transport: str) -> None:
    async def story() -> None:
        async with open_rig(transport) as rig:
            await tracks(rig)
            assert rig.observer.state is not None
            assert rig.observer.state.offset_bound_ns > 0

    asyncio.run(story())


def test_body_nodes_on_classic_can_and_gloves_on_fd() -> None:
    def bus(name: str, fd: bool) -> str:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        return (
            f'{{ name = "{name}", interface = "udp_multicast", channel = "239.74.163.2", '
            f"fd = {str(fd).lower()}, options = {{ port = {port}, hop_limit = 0 }} }}"
        )

    buses = f"[{bus('suit', True)}, {bus('body', False)}]"
    body = load_skeleton("nursing").segment_names[:8]
    nodes = [f'nodes.{name}.bus="body"' for name in body]
    overrides = {"master": [f"capture.buses={buses}", *nodes], "suit": [f"buses={buses}", *nodes]}

    async def story() -> None:
        async with open_rig(overrides=overrides) as rig:
            await tracks(rig)
            statuses = await rig.stop()
            assert set(statuses.values()) == {0}
            counts = rig.children["master"].figures()["buses"]
            # three frames a node and tick on the classic bus, one on the other
            assert counts["body"]["received"] > 8 * 3 * 200
            assert counts["suit"]["received"] > 28 * 200

    asyncio.run(story())
