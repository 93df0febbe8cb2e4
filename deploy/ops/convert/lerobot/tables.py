"""The files of a LeRobot dataset of version 3.0, but for its videos."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from common.quaternion import Array
from deploy.ops.convert.lerobot.statistics import Statistics

VERSION = "v3.0"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
TASKS, STATS, INFO = "meta/tasks.parquet", "meta/stats.json", "meta/info.json"
STATE, ACTION = "observation.state", "action"
COUNTED = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}


@dataclass(slots=True)
class Episode:
    """One stretch in which the robot followed."""

    state: list[Array] = field(default_factory=list)
    """(J,) each: encoders."""
    action: list[Array] = field(default_factory=list)
    """(J,) each: what the operator asked for."""
    statistics: dict[str, Statistics] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.state)


@dataclass(frozen=True, slots=True)
class Video:
    """One camera's file."""

    width: int
    height: int
    codec: str


def at(template: str, **values: object) -> str:
    """A path of the only chunk and file."""
    return template.format(chunk_index=0, file_index=0, **values)


def write_data(root: Path, episodes: Sequence[Episode], fps: int) -> None:
    """All frames of all episodes."""
    import pyarrow as pa

    lengths = [len(episode) for episode in episodes]
    frame_index = np.concatenate([np.arange(length) for length in lengths])
    columns = {
        STATE: _vectors([row for episode in episodes for row in episode.state]),
        ACTION: _vectors([row for episode in episodes for row in episode.action]),
        "timestamp": pa.array((frame_index / fps).astype(np.float32)),
        "frame_index": pa.array(frame_index),
        "episode_index": pa.array(np.repeat(np.arange(len(lengths)), lengths)),
        "index": pa.array(np.arange(sum(lengths))),
        "task_index": pa.array(np.zeros(sum(lengths), dtype=np.int64)),
    }
    _write(root / at(DATA), pa.table(columns))


def _vectors(rows: Sequence[Array]) -> object:
    import pyarrow as pa

    values = np.asarray(rows, dtype=np.float32)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def write_tasks(root: Path, task: str) -> None:
    """One task; its text is the index that pandas gives the table."""
    import pyarrow as pa

    index = "__index_level_0__"
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: pa.array([task])})
    column = {"field_name": None, "metadata": None, "numpy_type": "object"}
    pandas = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {
                **column,
                "name": "task_index",
                "field_name": "task_index",
                "pandas_type": "int64",
                "numpy_type": "int64",
            },
            {**column, "name": None, "field_name": index, "pandas_type": "unicode"},
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    _write(root / TASKS, table.replace_schema_metadata({"pandas": json.dumps(pandas)}))


def write_episodes(
    root: Path, episodes: Sequence[Episode], videos: Mapping[str, Video], task: str, fps: int
) -> None:
    """Where each episode lies in the files, and its statistics."""
    import pyarrow as pa

    rows, begin = [], 0
    for number, episode in enumerate(episodes):
        row: dict[str, object] = {
            "episode_index": number, "tasks": [task], "length": len(episode),
            "data/chunk_index": 0, "data/file_index": 0,
            "dataset_from_index": begin, "dataset_to_index": begin + len(episode),
            "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
        }  # fmt: skip
        for key in videos:
            row |= {
                f"videos/{key}/chunk_index": 0, f"videos/{key}/file_index": 0,
                f"videos/{key}/from_timestamp": begin / fps,
                f"videos/{key}/to_timestamp": (begin + len(episode)) / fps,
            }  # fmt: skip
        for feature, statistics in episode.statistics.items():
            row |= {f"stats/{feature}/{name}": values for name, values in statistics.items()}
        rows.append(row)
        begin += len(episode)
    _write(root / EPISODES, pa.Table.from_pylist(rows))


def write_info(
    root: Path,
    joints: Sequence[str],
    videos: Mapping[str, Video],
    episodes: Sequence[Episode],
    fps: int,
    robot: str,
) -> None:
    """The head of the dataset."""
    vector = {"dtype": "float32", "shape": [len(joints)], "names": list(joints)}
    features: dict[str, object] = {STATE: vector, ACTION: vector}
    for key, video in videos.items():
        features[key] = {
            "dtype": "video", "shape": [video.height, video.width, 3],
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": video.height, "video.width": video.width, "video.codec": video.codec,
                "video.pix_fmt": "yuv420p", "video.is_depth_map": False, "video.fps": fps,
                "video.channels": 3, "has_audio": False,
            },
        }  # fmt: skip
    features |= {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTED.items()}
    info = {
        "codebase_version": VERSION, "robot_type": robot, "fps": fps,
        "total_episodes": len(episodes), "total_frames": sum(map(len, episodes)), "total_tasks": 1,
        "chunks_size": 1000, "data_files_size_in_mb": 100, "video_files_size_in_mb": 500,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": DATA, "video_path": VIDEO if videos else None, "features": features,
    }  # fmt: skip
    (root / INFO).write_text(json.dumps(info, indent=4), "utf-8")


def write_stats(root: Path, statistics: Mapping[str, Statistics]) -> None:
    """Of the whole dataset, by feature."""
    (root / STATS).write_text(json.dumps(statistics, indent=4), "utf-8")


def _write(path: Path, table: object) -> None:
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
