"""What 36 free-running nodes cost the master, from the kernel's socket to joint angles.

The yardstick is cantools, which only decodes the same frames: both are measured by turns, so that whatever
else the machine does slows them alike. The bounds are a quarter above what was measured.
"""

from __future__ import annotations

import socket
import struct
import time
import tomllib
from collections import deque
from collections.abc import Callable

import can
import cantools
import numpy as np
import pytest

from common.can.bus import CanBus
from common.can.config import BusConfig
from common.clock import to_ns
from common.config.load import check_config
from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING, example
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading, Sent, sent_by
from master.capture.layout import MappedLayout
from master.config import MasterConfig
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol
from tests.master.capture.conftest import LAYOUTS

BUSES = 4
SECONDS = 3.0
SETTLED_S = 1.0
PERIOD_S = 0.005
ROOM = 1 << 21
SEGMENTS = load_skeleton("nursing").segment_names
Frames = list[tuple[int, bytes, int]]
FRAME = struct.Struct("=IB3x8s")


def place(row: int) -> tuple[str, int]:
    """Bus and number of a segment's node."""
    return f"b{row % BUSES}", 1 + row // BUSES


def pipeline() -> MasterPipeline:
    table = tomllib.loads(example("master", NURSING).read_text("utf-8"))
    layout = tomllib.loads(LAYOUTS.read_text("utf-8"))["layout"]["mti"]
    layout["dbc"] = str(LAYOUTS.with_name("mti.dbc"))
    table["suit"] = {"layout": {"mti": layout}}
    table["capture"]["buses"] = [
        {"name": f"b{k}", "interface": "socketcan", "channel": f"can{k}", "fd": False} for k in range(BUSES)
    ]
    table["nodes"] = {
        name: {"id": place(row)[1], "bus": place(row)[0], "layout": "mti"}
        for row, name in enumerate(SEGMENTS)
    }
    return MasterPipeline(check_config(LAYOUTS, table, MasterConfig), SuitProtocol.load())


def frames_of(layout: MappedLayout, swing: Callable[..., Reading], rates_hz: list[float]) -> list[Sent]:
    random = np.random.default_rng(5)
    nodes: dict[str, list[FreeNode]] = {}
    for row in range(len(SEGMENTS)):
        phase_s, drift_ppm, begins_s = random.uniform([0.0, -100.0, 0.0], [0.01, 100.0, 9.0])
        clock = NodeClock(rates_hz[row % len(rates_hz)], phase_s, drift_ppm, begins_s)
        bus, number = place(row)
        nodes.setdefault(bus, []).append(FreeNode(layout, number, swing(row, rest_s=0.5), clock))
    return list(sent_by(nodes, SECONDS, random, lost_share=0.0025))


def one_by_one(*_: object) -> None:
    raise AssertionError("an ordinary frame came alone")


class Wire(can.BusABC):
    """A datagram socket, which holds what a kernel's CAN socket would."""

    def __init__(self) -> None:
        super().__init__("wire")
        self.far, self._near = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.far.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ROOM)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError

    def opened(self, _: BusConfig) -> can.BusABC:
        """Stands for opening it."""
        return self

    def fileno(self) -> int:
        return self._near.fileno()

    def shutdown(self) -> None:
        super().shutdown()
        self.far.close()
        self._near.close()


class Wires:
    """The master's buses, each on a wire."""

    def __init__(self) -> None:
        self._heard: list[tuple[str, Frames]] = []
        self._at_ns: dict[str, deque[int]] = {f"b{k}": deque() for k in range(BUSES)}
        self._wires = [Wire() for _ in range(BUSES)]
        configs = [
            BusConfig(name=f"b{k}", interface="socketcan", channel=f"can{k}", fd=False) for k in range(BUSES)
        ]
        self._buses = [
            CanBus(
                config, one_by_one, opener=wire.opened, state_of=lambda *_: None,
                in_batches=True, on_frames=self._on_frames,
            )
            for config, wire in zip(configs, self._wires, strict=True)
        ]  # fmt: skip
        for bus in self._buses:
            bus.open()

    def _on_frames(self, bus: str, frames: Frames) -> None:
        self._heard.append((bus, frames))

    def send(self, sent: Sent) -> None:
        frame = sent.frame
        self._at_ns[sent.bus].append(to_ns(sent.at_s))
        self._wires[int(sent.bus[1:])].far.send(FRAME.pack(frame.id, len(frame.data), frame.data))

    def read(self) -> None:
        for bus in self._buses:
            bus.read()

    def heard(self) -> list[tuple[str, Frames]]:
        """What was read, with the times of the simulation in place of this host's."""
        heard, self._heard = self._heard, []
        return [
            (bus, [(frame_id, data, self._at_ns[bus].popleft()) for frame_id, data, _ in frames])
            for bus, frames in heard
        ]

    def close(self) -> None:
        for bus in self._buses:
            bus.close_now()


@pytest.mark.bench
@pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="no datagram sockets of this kind")
@pytest.mark.parametrize(("rates_hz", "most"), [([100.0], 6.6), ([100.0, 200.0, 400.0], 3.7)])
def test_36_nodes_keep_their_budget(
    load: Callable[..., MappedLayout], swing: Callable[..., Reading], rates_hz: list[float], most: float
) -> None:
    layout = load("mti", *range(1, 10))
    sent = frames_of(layout, swing, rates_hz)
    database = cantools.database.can.Database()
    database.add_dbc_file(LAYOUTS.with_name("mti.dbc"))
    pipe = pipeline()
    wires = Wires()
    spent, yardstick, at = [], [], 0
    for tick in range(1, int(SECONDS / PERIOD_S)):
        now_s = tick * PERIOD_S
        new = at
        while new < len(sent) and sent[new].at_s <= now_s:
            wires.send(sent[new])
            new += 1
        frames = [each.frame for each in sent[at:new]]
        at = new
        began_ns = time.thread_time_ns()
        wires.read()
        read_ns = time.thread_time_ns() - began_ns
        heard = wires.heard()
        began_ns = time.thread_time_ns()
        for bus, batch in heard:
            pipe.frames(bus, batch)
        pipe.tick(tick, to_ns(now_s))
        done_ns = time.thread_time_ns()
        for frame in frames:
            database.decode_message(frame.id & 0xFF, frame.data)
        decoded_ns = time.thread_time_ns()
        if now_s > SETTLED_S:
            spent.append(done_ns - began_ns + read_ns)
            yardstick.append(decoded_ns - done_ns)
    wires.close()
    mine, cantools_s = 1e-9 * float(np.mean(spent)), 1e-9 * float(np.mean(yardstick))
    print(  # noqa: T201
        f"\n{len(sent) / SECONDS:.0f} frames/s: {1e6 * mine:.0f} µs a tick, {100 * mine / PERIOD_S:.1f} % of "
        f"a core (a quarter of the ticks below {1e-3 * np.quantile(spent, 0.25):.0f} µs); "
        f"{mine / cantools_s:.2f} of cantools' {1e6 * cantools_s:.0f} µs"
    )
    assert not pipe.poll.summary()["lost_now"]
    assert mine < most * cantools_s
