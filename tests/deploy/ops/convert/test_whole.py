"""Parquet, LeRobot and BIDS exports, read back by pyarrow, PyAV and plain tables; by lerobot where it is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.errors import RecordingError, TandemError
from common.recording import Entry, McapRecorder
from common.skeleton import load_skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState
from deploy import cli
from deploy.ops.convert.whole import WholeOptions, write_whole
from deploy.recorded.held import HeldFrames
from deploy.sim.world.world import VirtualWorld
from tests.deploy.recorded.virtual import RecordedRun, record_run

pytestmark = pytest.mark.long  # all of them stand on one run that takes 8 s
pytest.importorskip("pyarrow")
pytest.importorskip("av")
NURSING = load_skeleton("nursing")
FPS = 25


def follow_twice(world: VirtualWorld) -> None:
    """Two stretches of following, with a hold in between."""
    world.engage()
    world.run(2.0)
    from common.wire.messages import Action

    world.ask(Action.DISENGAGE)
    world.run(0.5)
    world.engage()
    world.run(1.5)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return record_run(tmp_path_factory.mktemp("whole"), follow_twice, with_pictures=True)


def export(run: RecordedRun, out: Path, *arguments: str) -> Path:
    result = CliRunner().invoke(cli.app, ["export", str(run.slave), "--out", str(out), *arguments])
    if result.exception is not None:
        raise result.exception
    return out


@pytest.fixture(scope="module")
def dataset(run: RecordedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("learn") / "care"
    return export(run, out, "--to", "lerobot", "--task", "hand over a cup")


def states(run: RecordedRun) -> list[tuple[Entry, RobotState]]:
    from common.recording import RecordingStream

    return [
        (e, decode(e.payload, RobotState, 25))
        for e in RecordingStream(run.slave)
        if e.topic.endswith("/state")
    ]


def test_each_instant_holds_the_newest_that_had_arrived_and_nothing_later(run: RecordedRun) -> None:
    from common.recording import RecordingStream

    heard = states(run)
    arrived_ns = np.array([entry.monotonic_ns for entry, _ in heard])
    first_ns = next(iter(RecordingStream(run.slave))).monotonic_ns
    frames = list(HeldFrames(NURSING, FPS).of(RecordingStream(run.slave)))
    assert len(frames) > 100
    for frame in frames[::7]:
        at_ns = first_ns + round(frame.time_s * 1e9)
        newest = heard[int(np.searchsorted(arrived_ns, at_ns, side="right")) - 1][1]
        np.testing.assert_array_equal(frame.encoder_rad, newest.position_rad)
        assert frame.guard == newest.guard


def test_what_fell_silent_has_no_values(run: RecordedRun) -> None:
    """From 0.5 s after its last message; the newest before that would be taken for a standing robot."""
    from common.recording import RecordingStream

    entries = list(RecordingStream(run.slave))
    begun_ns = entries[0].monotonic_ns
    gap_ns = (begun_ns + 1_000_000_000, begun_ns + 3_000_000_000)
    spoken = [
        entry
        for entry in entries
        if entry.topic.rpartition("/")[2] not in ("state", "command")
        or not gap_ns[0] < entry.monotonic_ns < gap_ns[1]
    ]
    frames = list(HeldFrames(NURSING, FPS).of(spoken))
    before = [frame for frame in frames if 1.0 < frame.time_s < 1.4]
    during = [frame for frame in frames if 1.55 < frame.time_s < 2.95]
    assert before
    assert during
    for frame in before:
        assert frame.fresh
        assert frame.guard
        assert np.isfinite(frame.setpoint_rad).all()
    for frame in during:
        assert not frame.fresh
        assert not frame.guard
        for values in (frame.encoder_rad, frame.setpoint_rad, frame.operator_rad, frame.effort_nm):
            assert np.isnan(values).all()


@pytest.mark.parametrize(
    ("topics", "refuses"),
    [
        (("tandem/a/state", "tandem/b/state"), ("foxglove", "parquet", "lerobot", "bids")),
        (("tandem/a/operator/x/command", "tandem/a/operator/y/command"), ("parquet", "lerobot", "bids")),
    ],
)
def test_two_robots_or_operators_are_not_mixed(
    tmp_path: Path, topics: tuple[str, str], refuses: tuple[str, ...]
) -> None:
    with McapRecorder(tmp_path / "two.mcap", {}) as recorder:
        for number, topic in enumerate(topics):
            recorder.put(topic, b"x", number)
    for kind in refuses:
        with pytest.raises(RecordingError, match="record one at a time"):
            write_whole(
                kind,
                WholeOptions(tmp_path / "two.mcap", tmp_path / kind, NURSING, None, None, "01", "1"),
            )
        assert not (tmp_path / kind).exists()


def test_parquet_has_a_row_for_each_joint_and_instant(run: RecordedRun, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    table = pq.read_table(export(run, tmp_path / "a.parquet", "--to", "parquet"))
    assert table.column_names == [
        "time_s", "wall_time", "guard", "joint", "encoder_rad", "setpoint_rad", "operator_rad", "effort_nm",
    ]  # fmt: skip
    rows = table.filter(table["joint"].cast("string").to_numpy() == "left_elbow_pitch")
    assert len(table) == 25 * len(rows)
    steps = np.diff(rows["time_s"].to_numpy())
    np.testing.assert_allclose(steps, 0.02, atol=1e-9)
    column = NURSING.joint_names.index("left_elbow_pitch")
    known = {float(state.position_rad[column]) for _, state in states(run)}
    assert set(rows["encoder_rad"].to_pylist()) <= known
    assert rows["operator_rad"].null_count < len(rows)


def test_a_table_of_what_a_dataset_of_version_3_has(dataset: Path) -> None:
    import pyarrow.parquet as pq

    info = json.loads((dataset / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == FPS
    assert info["total_episodes"] == 2
    assert set(info["features"]) == {
        "observation.state", "action", "observation.images.head", "timestamp", "frame_index", "episode_index",
        "index", "task_index",
    }  # fmt: skip
    assert info["features"]["observation.images.head"]["shape"] == [240, 320, 3]
    data = pq.read_table(dataset / info["data_path"].format(chunk_index=0, file_index=0))
    assert data.num_rows == info["total_frames"]
    assert data["index"].to_pylist() == list(range(data.num_rows))
    frame = data["frame_index"].to_numpy()
    np.testing.assert_array_equal(data["timestamp"].to_numpy(), (frame / FPS).astype(np.float32))
    episodes = pq.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [e["length"] for e in episodes] == [
        e["dataset_to_index"] - e["dataset_from_index"] for e in episodes
    ]
    assert episodes[1]["dataset_from_index"] == episodes[0]["dataset_to_index"]
    video = "videos/observation.images.head"
    assert (
        episodes[1][f"{video}/from_timestamp"]
        == episodes[0][f"{video}/to_timestamp"]
        == episodes[0]["length"] / FPS
    )
    assert episodes[0]["tasks"] == ["hand over a cup"]
    statistics = json.loads((dataset / "meta/stats.json").read_text())
    for feature in info["features"]:
        names = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
        assert set(statistics[feature]) == names
        assert f"stats/{feature}/q99" in episodes[0]
    picture = statistics["observation.images.head"]
    assert np.shape(picture["mean"]) == (3, 1, 1)
    assert picture["mean"][0][0][0] == pytest.approx(96 / 255, abs=0.02)
    state = np.array(data["observation.state"].to_pylist())
    np.testing.assert_allclose(statistics["observation.state"]["mean"], state.mean(axis=0), atol=1e-5)


def test_the_task_is_the_index_that_pandas_sees(dataset: Path) -> None:
    import pyarrow.parquet as pq

    table = pq.read_table(dataset / "meta/tasks.parquet")
    named = json.loads(table.schema.metadata[b"pandas"])["index_columns"]
    assert table[named[0]].to_pylist() == ["hand over a cup"]


def test_the_video_has_a_frame_for_each_row_at_a_constant_rate(dataset: Path) -> None:
    import av

    path = dataset / "videos/observation.images.head/chunk-000/file-000.mp4"
    info = json.loads((dataset / "meta/info.json").read_text())
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
    assert len(frames) == info["total_frames"]
    np.testing.assert_allclose(np.diff([frame.time for frame in frames]), 1 / FPS, atol=1e-6)
    assert abs(frames[0].to_ndarray(format="rgb24").mean() - 96.0) < 4.0


@pytest.mark.filterwarnings("ignore")  # its packages warn of each other
def test_lerobot_itself_opens_it(dataset: Path) -> None:
    # not among tandem's extras: with torch and its CUDA libraries it is more than 1.6 GB
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    found = lerobot.LeRobotDataset("tandem/care", root=dataset)
    assert found.num_episodes == 2
    assert found[0]["observation.state"].shape == (25,)


def test_bids_has_a_channel_for_each_column(run: RecordedRun, tmp_path: Path) -> None:
    root = export(
        run, tmp_path / "study", "--to", "bids", "--subject", "03", "--session", "2", "--task", "cup"
    )
    folder = root / "sub-03/ses-2/motion"
    for system in ("encoders", "operator"):
        base = f"sub-03_ses-2_task-cup_tracksys-{system}"
        rows = [line.split("\t") for line in (folder / f"{base}_motion.tsv").read_text().splitlines()]
        channels = [line.split("\t") for line in (folder / f"{base}_channels.tsv").read_text().splitlines()]
        head = json.loads((folder / f"{base}_motion.json").read_text())
        assert len(rows[0]) == len(channels) - 1 == head["MotionChannelCount"] == 26
        assert [row[2] for row in channels[1:]] == ["LATENCY"] + ["JNTANG"] * 25
        np.testing.assert_allclose(np.diff([float(row[0]) for row in rows]), 0.02, atol=1e-6)
    events = (folder / "sub-03_ses-2_task-cup_events.tsv").read_text()
    assert events.count("guard_track") == 2
    assert (root / "participants.tsv").read_text() == "participant_id\nsub-03\n"
    assert len((root / "sub-03/ses-2/sub-03_ses-2_scans.tsv").read_text().splitlines()) == 3
    assert json.loads((root / "dataset_description.json").read_text())["DatasetType"] == "raw"
    export(run, root, "--to", "bids", "--subject", "04", "--task", "cup")
    assert (root / "participants.tsv").read_text().split() == ["participant_id", "sub-03", "sub-04"]
    with pytest.raises(TandemError, match="is there already"):
        export(run, root, "--to", "bids", "--subject", "04", "--task", "cup")
    with pytest.raises(TandemError, match="letters and digits"):
        export(run, root, "--to", "bids", "--subject", "Mrs Li")


def test_a_recording_in_which_nobody_follows_is_no_dataset(tmp_path: Path) -> None:
    still = record_run(tmp_path, lambda world: world.run(1.0))
    with pytest.raises(TandemError, match="no episode"):
        export(still, tmp_path / "x", "--to", "lerobot")
    assert not (tmp_path / "x").exists()
    with pytest.raises(TandemError, match="whole number"):
        export(still, tmp_path / "y", "--to", "lerobot", "--rate", "12.5")
