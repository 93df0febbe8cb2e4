"""A suit of a few nodes on one bus, asked window by window; every clock here is a number."""

from __future__ import annotations

import numpy as np
import pytest

from common.can.frame import CanFrame
from master.suit.health import NodeHealth
from master.suit.nodes import NodeConfig
from master.suit.number import number_of
from master.suit.poll import Poll
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

PROTOCOL = SuitProtocol.load()
LOST_AFTER = 3


def raw(seed: int) -> np.ndarray:
    """Nine counts that tell the seed, none of them the reserved one."""
    return (np.arange(9) + 10 * seed + 1).astype(np.int16)


class Suit:
    """Nodes 1..n on one bus named `arm`, with windows of 5 ms from tick 1."""

    protocol = PROTOCOL
    lost_after = LOST_AFTER
    raw = staticmethod(raw)

    def __init__(self, fd: bool, count: int = 3, magnetometer: bool = True) -> None:
        self.fd = fd
        self.nodes = [NodeConfig(id=i + 1, bus="arm", magnetometer=magnetometer) for i in range(count)]
        self.poll = Poll(self.nodes, PROTOCOL, LOST_AFTER, {"arm": fd})
        self.tick = 0
        self.complete: list[bool] = []

    def answer(self, node_id: int, tick: int, seed: int = 0, status: int = 0) -> list[CanFrame]:
        return PROTOCOL.encode_sample(node_id, raw(seed), number_of(tick), status, self.fd)

    def answers(self, tick: int, seed: int = 0, without: tuple[int, ...] = ()) -> list[CanFrame]:
        return [f for n in self.nodes if n.id not in without for f in self.answer(n.id, tick, seed)]

    def window(self, frames: list[CanFrame]) -> Sweep:
        """Ask for the next tick and take these frames as what came."""
        self.open()
        return self.close(frames)

    def open(self) -> None:
        self.tick += 1
        assert self.poll.open_window(self.tick, self.tick * 5_000_000) == PROTOCOL.sync(number_of(self.tick))

    def close(self, frames: list[CanFrame]) -> Sweep:
        start = self.tick * 5_000_000
        self.complete = [
            self.poll.on_frame("arm", f.id, f.data, start + 1000 * k) for k, f in enumerate(frames, 1)
        ]
        return self.poll.close_window(start + 4_000_000)

    def settle(self) -> None:
        """One window that all answer, with seed 0."""
        assert self.window(self.answers(self.tick + 1)).fresh.all()

    def health(self, node_id: int) -> NodeHealth:
        return self.poll.health[node_id - 1]

    @staticmethod
    def holds(sweep: Sweep, index: int, seed: int) -> bool:
        """Whether a node's values are those of that seed, in SI units."""
        counts = raw(seed)
        return bool(
            sweep.acc_m_s2[index].tolist() == (counts[:3] * PROTOCOL.acc_scale).tolist()
            and sweep.gyr_rad_s[index].tolist() == (counts[3:6] * PROTOCOL.gyr_scale).tolist()
            and sweep.mag_ut[index].tolist() == (counts[6:] * PROTOCOL.mag_scale).tolist()
        )


@pytest.fixture(scope="session")
def new_suit() -> type[Suit]:
    """Makes suits; one for the session, so that hypothesis may use it."""
    return Suit


@pytest.fixture(params=[True, False], ids=["fd", "classic"], scope="session")
def fd(request: pytest.FixtureRequest) -> bool:
    """Both kinds of bus."""
    return bool(request.param)


@pytest.fixture
def suit(fd: bool) -> Suit:
    """Three nodes."""
    return Suit(fd)
