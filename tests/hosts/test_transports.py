"""The same pair by endpoint alone over each transport, and a suit on two buses, one classic and one FD."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from common.link.endpoint import SECURE, TRANSPORTS
from common.metrics.link import AccessMetrics
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.skeleton import load_skeleton
from deploy.harness.host import HostWatch
from deploy.harness.keys import MASTER, access_override
from deploy.harness.rig import ROBOT, open_rig
from deploy.harness.start import start_tracking

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]


@pytest.mark.parametrize("routed", [False, True], ids=["direct", "routed"])
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_the_robot_tracks_over(on_this_host: OnThisHost, transport: str, routed: bool) -> None:
    async def story(host: HostWatch) -> None:
        access = [access_override([ROBOT])] if transport in SECURE else []
        rules = dict.fromkeys(("slave", "master", "router"), access)
        async with open_rig(transport, rules, routed=routed) as rig:
            await start_tracking(rig)
            assert rig.observer.state is not None
            assert rig.observer.state.offset_bound_ns > 0
            statuses = await rig.stop()
            assert set(statuses.values()) == {0}
            slave = rig.children["slave"].metrics(SlaveMetrics)
            assert slave is not None
            guard = rig.children["router"].metrics(AccessMetrics) if routed else slave.access
        if transport in SECURE:
            assert guard is not None
            assert guard.connections[f"operator:{MASTER}"] >= 1
            assert guard.refused is not None
            assert guard.refused.handshakes == {}

    on_this_host(story)


def test_body_nodes_on_classic_can_and_gloves_on_fd(on_this_host: OnThisHost) -> None:
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

    async def story(host: HostWatch) -> None:
        async with open_rig(overrides=overrides) as rig:
            await start_tracking(rig)
            statuses = await rig.stop()
            assert set(statuses.values()) == {0}
            master = rig.children["master"].metrics(MasterMetrics)
            assert master is not None
            counts = master.buses
            # three frames a node and tick on the classic bus, one on the other
            assert counts["body"].received > 8 * 3 * 200
            assert counts["suit"].received > 28 * 200

    on_this_host(story)
