"""What the contract sends over every bus is what four makers' nodes send, and is decoded to what they read.

`tests/contract/other_makers.txt` has the frames, so that the contract needs no numpy on an emulated kernel.
To write it anew: `python -m tests.master.capture.test_on_bus`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.can.frame import EXTENDED
from common.clock import to_ns
from common.quaternion import angle_between
from deploy.sim.suit.free_running import FreeNode, NodeClock, Sent, sent_by
from master.capture.layout import load_layout
from master.capture.mixed import MixedSuit
from master.suit.doubt import Weight
from master.suit.nodes import NodeConfig
from master.suit.protocol import SuitProtocol
from tests.contract.other_makers import OtherMakers
from tests.master.capture.conftest import suit_section, swinging

FILE = Path(__file__).parents[2] / "contract" / "other_makers.txt"
NODES = (("mti", 1), ("mti", 2), ("lpms", 1), ("bno", 1), ("bno", 2), ("muxed", 1), ("muxed", 2))
RATES_HZ = (100.0, 200.0, 100.0, 125.0, 125.0, 100.0, 50.0)
SECONDS = 1.0
PERIOD_S = 0.005
SLOW_HZ = 0.2
"""Of the nodes' swing: between two samples of 50 Hz it is a straight line."""

NUMBERS = {name: [number for layout, number in NODES if layout == name] for name, _ in NODES}
LAYOUTS = {name: load_layout(name, suit_section().layout[name], numbers) for name, numbers in NUMBERS.items()}


def frames() -> list[Sent]:
    """What all nodes send on one bus."""
    nodes = [
        FreeNode(LAYOUTS[name], number, swinging(row, SLOW_HZ), NodeClock(RATES_HZ[row], 0.001 * row))
        for row, (name, number) in enumerate(NODES)
    ]
    return list(sent_by({"bus": nodes}, SECONDS, np.random.default_rng(2)))


def test_the_file_has_what_the_nodes_send() -> None:
    kept = OtherMakers.read(FILE)
    sent = frames()
    assert [(frame.id, frame.data) for frame in kept.frames] == [(s.frame.id, s.frame.data) for s in sent]
    assert np.allclose([1e-9 * at for at in kept.at_ns], [each.at_s for each in sent], atol=1e-6)
    assert {frame.id & EXTENDED for frame in kept.frames} == {0, EXTENDED}


@pytest.mark.parametrize("together", [False, True])
def test_four_makers_nodes_on_one_bus_are_read_as_what_they_measured(together: bool) -> None:
    configs = [NodeConfig(id=number, bus="bus", layout=name) for name, number in NODES]
    suit = MixedSuit(configs, SuitProtocol.load(), LAYOUTS, 20, {"bus": False})
    kept = OtherMakers.read(FILE)
    waiting = list(zip(kept.at_ns, kept.frames, strict=True))
    judged = 0
    for tick in range(1, int(SECONDS / PERIOD_S)):
        now_ns = to_ns(tick * PERIOD_S)
        heard: list[tuple[int, bytes, int]] = []
        while waiting and waiting[0][0] <= now_ns:
            at_ns, frame = waiting.pop(0)
            if together:
                heard.append((frame.id, frame.data, at_ns))
            else:
                suit.on_frame("bus", frame.id, frame.data, at_ns)
        if together:
            suit.on_frames("bus", [*heard, (0x7FF, b"", now_ns)])
        suit.open_window(tick, now_ns)
        sweep = suit.close_window(now_ns)
        if tick < 0.7 * SECONDS / PERIOD_S:
            continue
        assert sweep.fresh.all()
        assert sweep.q_world_from_sensor is not None
        for row, (name, _) in enumerate(NODES):
            # a sample seems as late as the least delayed frame, 0.2 ms and some jitter
            true, q = swinging(row, SLOW_HZ)(1e-9 * sweep.sampled_ns - 4e-4)
            assert np.abs(sweep.acc_m_s2[row] - true[:3]).max() < 0.05, name
            assert np.degrees(np.abs(sweep.gyr_rad_s[row] - true[3:6]).max()) < 1.5, name
            if name in ("mti", "muxed"):
                assert np.abs(sweep.mag_ut[row] - true[6:]).max() < 0.3, name
            else:
                assert np.degrees(angle_between(sweep.q_world_from_sensor[row], q)) < 0.3, name
            judged += 1
    assert judged >= 50 * len(NODES)
    assert all(doubt.weight is Weight.NOTED for doubt in suit.doubts().values())
    assert not suit.summary()["incomplete"]
    assert suit.bus_health["bus"].unknown_id == (tick if together else 0)


if __name__ == "__main__":
    OtherMakers([to_ns(each.at_s) for each in frames()], [each.frame for each in frames()]).write(FILE)
