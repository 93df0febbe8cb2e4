"""A recorded suit computed again: bit for bit, from any second, and otherwise where the files differ."""

from __future__ import annotations

import itertools
import json
from importlib import resources
from pathlib import Path

import msgpack
import numpy as np
import pytest

from common.config.load import load_config
from common.errors import RecordingError
from deploy.recorded.recompute import Recomputed, Recorded, Replay
from deploy.recorded.recorded_config import recorded_config
from master.config import MasterConfig
from master.journal.calls import FRAMES, MISSING, SNAPSHOT, JournaledPipeline, decode_calls
from master.journal.context import describe
from master.journal.memory import recall, restore
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol
from tests.master.test_pipeline import EXAMPLES, Bench

TROUBLES = (
    'motion="bottle"',
    "faults.corrupt_rate=0.02",
    'faults.lose=[{node="left_forearm", from_s=2.0, until_s=3.5}]',
)


class RecordedBench(Bench):
    """A bench whose pipeline's calls are written down."""

    def __init__(self, *suit: str, master: tuple[str, ...] = ()) -> None:
        super().__init__(*suit, master=master)
        self.config = load_config(EXAMPLES / "master.toml", MasterConfig, master)
        self.raw = self.pipeline
        self.entries: list[Recorded] = []
        self.calls = JournaledPipeline(
            self.raw, lambda topic, data: self.entries.append(Recorded(topic, data))
        )
        self.pipeline = self.calls  # type: ignore[assignment]  # what the bench calls of it, it has

    def snapshot(self) -> None:
        self.calls.begin_again()
        self.entries.append(Recorded(SNAPSHOT, msgpack.packb(recall(self.raw))))


def replayed(bench: RecordedBench, since: int = 0, config: MasterConfig | None = None) -> list[Recomputed]:
    bench.calls.flush()
    replay = Replay(config or bench.config, from_snapshots=config is None)
    return list(replay.pairs(bench.entries[since:]))


@pytest.mark.parametrize("filter_name", ["vqf", "mahony", "ekf"])
def test_every_posture_is_the_same_to_the_last_bit(filter_name: str) -> None:
    bench = RecordedBench(*TROUBLES, master=(f'estimation.filter="{filter_name}"',))
    bench.snapshot()
    angles = bench.run(700)
    pairs = replayed(bench)
    assert len(pairs) == len(angles) > 40
    assert all(pair.identical for pair in pairs)


@pytest.mark.parametrize("begun", [210, 330, 617, 801])
def test_it_begins_at_any_second(begun: int) -> None:
    """In settling, in the zero pose, with a node lost, and with it back."""
    bench = RecordedBench(*TROUBLES)
    bench.run(begun)
    bench.calls.flush()
    before = len(bench.entries)
    bench.snapshot()
    angles = bench.run(240)
    pairs = replayed(bench, before)
    assert len(pairs) == len(angles)
    assert all(pair.identical for pair in pairs)


def test_it_begins_in_a_zero_pose_that_is_being_taken_again_and_after_a_bus_failed() -> None:
    bench = RecordedBench()
    bench.run(800)
    bench.calls.ask_zero_pose("a key", bench.now_ns)
    bench.calls.bus_down("suit")
    bench.run(40)
    before = len(bench.entries)
    bench.snapshot()
    said = [bench.raw.said for _ in range(60) if bench.run(16)]
    assert any(said), "the countdown has been heard"
    pairs = replayed(bench, before)
    assert len(pairs) >= 60
    assert all(pair.identical for pair in pairs)


def changing_rates(bench: RecordedBench) -> list[int]:
    """The deciding ticks while the rate of commands goes up and down, each time between two of them."""
    ticks = []
    for decimation, count in ((16, 323), (8, 86), (4, 42), (16, 85), (4, 61), (8, 60)):
        bench.calls.set_decimation(decimation)
        ticks += [angles.tick for angles in bench.run(count)]
    return ticks


def test_every_posture_is_the_same_where_the_rate_of_commands_changed() -> None:
    bench = RecordedBench(*TROUBLES)
    bench.snapshot()
    ticks = changing_rates(bench)
    pairs = replayed(bench)
    assert [pair.computed.tick for pair in pairs] == ticks
    assert len(ticks) > 60
    assert all(pair.identical for pair in pairs)


@pytest.mark.parametrize("other", [False, True])
def test_a_recording_that_begins_later_knows_the_rate_in_force(other: bool) -> None:
    """Another configuration learns anew, without the snapshot's memory: the rate must stand beside it."""
    bench = RecordedBench('motion="bottle"')
    bench.run(320)
    bench.calls.set_decimation(4)
    bench.run(16)
    before = len(bench.entries)
    bench.snapshot()
    ticks = [angles.tick for angles in bench.run(160)]
    pairs = replayed(bench, before, bench.config if other else None)
    assert [pair.computed.tick for pair in pairs] == ticks
    assert len(ticks) == 40


def test_between_two_commands_no_more_than_the_slower_rate_s_time_passes() -> None:
    bench = RecordedBench()
    bench.run(320)
    rng = np.random.default_rng(7)
    decided: list[int] = []
    for _ in range(60):
        bench.calls.set_decimation(int(rng.choice([4, 8, 16])))
        decided += [angles.tick for angles in bench.run(int(rng.integers(1, 30)))]
    apart = [after - before for before, after in itertools.pairwise(decided)]
    assert max(apart) <= 16
    bench.calls.set_decimation(4)
    bench.run(16)
    for decimation in (8, 16):
        bench.calls.set_decimation(decimation)
        decided = [angles.tick for angles in bench.run(67)]
        assert {tick % decimation for tick in decided[1:]} == {0}
        assert decided[0] % decimation == 0, "none comes out of turn where the rate falls"


def test_without_the_snapshot_the_first_seconds_differ() -> None:
    """What the snapshot is for: else the test above would prove nothing."""
    bench = RecordedBench('motion="bottle"')
    bench.run(600)
    before = len(bench.entries)
    bench.snapshot()
    bench.run(320)
    pairs = replayed(bench, before, bench.config)
    assert not any(pair.identical for pair in pairs)


def test_another_filter_gives_other_angles_and_says_how_far() -> None:
    bench = RecordedBench('motion="bottle"')
    bench.snapshot()
    bench.run(480)
    other = load_config(EXAMPLES / "master.toml", MasterConfig, ('estimation.filter="mahony"',))
    apart = np.abs([pair.apart_rad for pair in replayed(bench, config=other)[-10:]])
    assert 1e-6 < apart.max() < 0.3


def test_one_changed_byte_of_a_frame_is_seen() -> None:
    bench = RecordedBench('motion="bottle"')
    bench.snapshot()
    bench.run(480)
    bench.calls.flush()
    place = [i for i, entry in enumerate(bench.entries) if entry.topic == FRAMES][300]
    calls = [list(call) for call in decode_calls(bench.entries[place].payload)]
    frame = next(call for call in calls if len(call) == 5)
    data = frame[3]
    assert isinstance(data, bytes)
    frame[3] = bytes([data[0] ^ 1, *data[1:]])
    bench.entries[place] = Recorded(FRAMES, msgpack.packb((1, calls)))
    pairs = replayed(bench)
    first = next(pair for pair in pairs if not pair.identical)
    assert pairs[0].identical
    assert first.recorded.tick >= 300


def test_after_missing_messages_it_goes_on_at_the_next_snapshot() -> None:
    bench = RecordedBench('motion="bottle"')
    bench.snapshot()
    bench.run(320)
    bench.calls.flush()
    bench.entries.append(Recorded(MISSING, b""))
    bench.run(160)
    bench.snapshot()
    bench.run(160)
    bench.calls.flush()
    replay = Replay(bench.config)
    pairs = list(replay.pairs(bench.entries))
    assert all(pair.identical for pair in pairs)
    assert len(pairs) == 31  # the first tick decides too
    assert replay.skipped == 10


def test_the_configuration_and_its_files_come_back_without_the_link(tmp_path: Path) -> None:
    config = load_config(EXAMPLES / "master.toml", MasterConfig)
    metadata = describe(config)
    assert "tcp/" not in json.dumps(metadata)
    with recorded_config(metadata, "x.mcap") as back:
        assert back.capture.dbc.read_bytes() == config.capture.dbc.read_bytes()
        assert back.capture.dbc != config.capture.dbc
        assert back.estimation == config.estimation
        assert back.nodes.keys() == config.nodes.keys()


def test_a_robot_s_own_profile_is_in_the_recording(tmp_path: Path) -> None:
    """The folder of the profile is gone, or is another one, where the recording is computed again."""
    shipped = resources.files("common.skeleton").joinpath("nursing.toml").read_text("utf-8")
    own = tmp_path / "mine.toml"
    own.write_text(shipped.replace('name = "nursing"', 'name = "mine"', 1))
    config = load_config(EXAMPLES / "master.toml", MasterConfig, (f'profile="{own}"',))
    metadata = describe(config)
    own.unlink()
    with recorded_config(metadata, "x.mcap") as back:
        assert back.skeleton.name == "mine"
        assert back.skeleton.joint_names == config.skeleton.joint_names


def test_a_recording_without_a_configuration_says_what_to_do() -> None:
    with pytest.raises(RecordingError, match="--tap"), recorded_config({}, "x.mcap"):
        pass


def test_a_snapshot_of_another_shape_is_refused() -> None:
    pipeline = Bench().pipeline
    for nonsense in (["object", 0, "os:system", []], ["object", 0, "master.app:nothing", []], ["vqf", 1, []]):
        with pytest.raises(RecordingError):
            restore(pipeline, nonsense)  # type: ignore[arg-type]


def test_a_snapshot_names_classes_of_the_project_only() -> None:
    """A file from a stranger must not be able to make anything else."""
    pipeline = MasterPipeline(
        load_config(EXAMPLES / "master.toml", MasterConfig),
        SuitProtocol.load(load_config(EXAMPLES / "master.toml", MasterConfig).capture.dbc),
    )
    for name in ("subprocess:Popen", "builtins:eval", "master.app:asyncio.Runner"):
        with pytest.raises(RecordingError, match="does not have"):
            restore(pipeline, ["object", 0, name, []])
