from __future__ import annotations

import pytest

from common.can.config import BusConfig
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.suit.config import SuitConfig
from master.suit.nodes import NodeConfig
from master.suit.protocol import SuitProtocol


@pytest.fixture(scope="session")
def skeleton() -> Skeleton:
    return load_skeleton("nursing")


@pytest.fixture(scope="session")
def protocol() -> SuitProtocol:
    return SuitProtocol.load()


@pytest.fixture(scope="session")
def config(skeleton: Skeleton) -> SuitConfig:
    """All 36 nodes on one CAN FD bus, calibrated, bottle."""
    return SuitConfig(
        buses=[BusConfig(name="suit", interface="virtual", channel="simulated suit")],
        nodes={name: NodeConfig(id=i + 1, bus="suit") for i, name in enumerate(skeleton.segment_names)},
    )
