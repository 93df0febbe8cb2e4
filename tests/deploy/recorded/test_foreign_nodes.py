"""A suit of foreign nodes, on SYNC and free-running, computed again from any instant, bit for bit."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import msgpack
import numpy as np
import pytest
import tomlkit

from common.clock import NS_PER_MS
from common.config.load import load_config
from common.quaternion import Array
from deploy.recorded.recompute import Recorded, Replay
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading, sent_by
from deploy.sim.suit.suit import build_suit
from master.capture.layout import load_layout
from master.capture.mixed import MixedSuit
from master.config import MasterConfig
from master.journal.calls import SNAPSHOT, JournaledPipeline
from master.journal.memory import recall
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol
from tests.master.capture.conftest import LAYOUTS, swinging
from tests.master.test_pipeline import EXAMPLES, PERIOD_NS

FOREIGN = {
    "left_forearm": ("mti", 1), "left_hand": ("mti", 2), "right_forearm": ("bno", 1),
    "right_hand": ("lpms", 1),
}  # fmt: skip
"""By segment, its layout and number; all others answer SYNC."""
SECONDS = 5.5


def mixed_config(folder: Path) -> MasterConfig:
    """The example's suit with four nodes of three other makers on a bus each."""
    table = tomllib.loads((EXAMPLES / "master.toml").read_text("utf-8"))
    layouts = tomllib.loads(LAYOUTS.read_text("utf-8"))["layout"]
    for dbc in LAYOUTS.parent.glob("*.dbc"):
        shutil.copy(dbc, folder)
    table["suit"] = {**table.get("suit", {}), "layout": layouts}
    table["capture"]["dbc"] = str((EXAMPLES / table["capture"]["dbc"]).resolve())
    bus = table["capture"]["buses"][0]
    for segment, (layout, number) in FOREIGN.items():
        table["nodes"][segment] = {"id": number, "bus": f"of_{segment}", "layout": layout}
        table["capture"]["buses"].append({**bus, "name": f"of_{segment}", "fd": layout != "mti"})
    path = folder / "master.toml"
    path.write_text(tomlkit.dumps(table), "utf-8")
    return load_config(path, MasterConfig)


def noisy(reading: Reading, seed: int) -> Reading:
    """As a real sensor: one that never varies is taken for frozen."""
    random = np.random.default_rng(seed)
    sd = np.repeat([0.02, 0.003, 0.4], 3)

    def read(time_s: float) -> tuple[Array, Array]:
        values, q = reading(time_s)
        return values + random.normal(size=9) * sd, q

    return read


class MixedBench:
    """Its pipeline, written down, and what all nodes send."""

    def __init__(self, folder: Path) -> None:
        self.config = mixed_config(folder)
        protocol = SuitProtocol.load(self.config.capture.dbc)
        self.raw = MasterPipeline(self.config, protocol)
        assert isinstance(self.raw.poll, MixedSuit)
        self.entries: list[Recorded] = []
        self.calls = JournaledPipeline(
            self.raw, lambda topic, data: self.entries.append(Recorded(topic, data))
        )
        calm = ('motion="calibration_pose"',)
        self._suit = build_suit(load_config(EXAMPLES / "suit.toml", SuitConfig, calm), protocol)
        random = np.random.default_rng(3)
        nodes = {}
        for place, (segment, (name, number)) in enumerate(FOREIGN.items()):
            layout = load_layout(name, self.config.suit.layout[name], [number])
            clock = NodeClock((100.0, 200.0, 100.0, 400.0)[place], 0.003 * place, 40.0 * place - 60.0, 2.0)
            reading = noisy(swinging(place, rest_s=4.0), place)
            nodes[f"of_{segment}"] = [FreeNode(layout, number, reading, clock)]
        self._sent = list(sent_by(nodes, SECONDS, random, lost_share=0.01))
        self.tick = 0

    def run(self, ticks: int) -> int:
        """So many ticks; how many postures came of them."""
        found = 0
        for _ in range(ticks):
            self.tick += 1
            now_ns = self.tick * PERIOD_NS
            heard: dict[str, list[tuple[int, bytes, int]]] = {}
            while self._sent and self._sent[0].at_s * 1e9 <= now_ns:
                one = self._sent.pop(0)
                frame = (one.frame.id, one.frame.data, round(one.at_s * 1e9))
                heard.setdefault(one.bus, []).append(frame)
            for bus, frames in heard.items():
                self.calls.frames(bus, frames)
            sync, late = self.calls.tick(self.tick, now_ns)
            found += late is not None
            done = [
                self.calls.frame(bus, frame.id, frame.data, now_ns + NS_PER_MS)
                for bus, frame, _ in self._suit.on_sync(int.from_bytes(sync.data, "little"), now_ns).frames
            ]
            if any(done):
                found += self.calls.close(now_ns + NS_PER_MS) is not None
        return found

    def snapshot(self) -> int:
        """Take one; where it stands."""
        self.calls.flush()
        self.entries.append(Recorded(SNAPSHOT, msgpack.packb(recall(self.raw))))
        return len(self.entries) - 1


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> tuple[MixedBench, list[int], list[int]]:
    """A run with a snapshot at its begin and at odd ticks; where they stand, and the postures since each."""
    made = MixedBench(tmp_path_factory.mktemp("mixed"))
    places, postures = [made.snapshot()], []
    for ticks in (311, 333, 190, 240):
        postures.append(made.run(ticks))
        places.append(made.snapshot())
    made.calls.flush()
    return made, places[:-1], postures


@pytest.mark.parametrize("begun", [0, 2, 3])
def test_every_posture_is_the_same_from_any_snapshot(
    bench: tuple[MixedBench, list[int], list[int]], begun: int
) -> None:
    made, places, postures = bench
    pairs = list(Replay(made.config).pairs(made.entries[places[begun] :]))
    assert len(pairs) == sum(postures[begun:]) > 12
    assert all(pair.identical for pair in pairs)
    known = np.array([pair.recorded.valid for pair in pairs])
    assert known[-1].all(), "the nodes are heard, or nothing would be shown"


def test_without_its_memory_it_differs(bench: tuple[MixedBench, list[int], list[int]]) -> None:
    """The snapshot matters: else the test above would prove nothing."""
    made, places, _ = bench
    pairs = list(Replay(made.config, from_snapshots=False).pairs(made.entries[places[2] :]))
    assert pairs
    assert not all(pair.identical for pair in pairs)
