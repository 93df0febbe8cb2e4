"""Makes the dataset: each stretch in which the robot follows is an episode, one task for all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.recording import RecordingStream
from common.skeleton import Skeleton
from deploy.ops.convert.lerobot import tables
from deploy.ops.convert.lerobot.statistics import PictureStatistics, of_columns, of_rows
from deploy.ops.convert.lerobot.tables import ACTION, STATE, Episode, Video
from deploy.ops.convert.lerobot.video_out import VideoOut
from deploy.recorded.held import HeldFrame, HeldFrames
from deploy.report.output import writing

FOLLOWS = "track"
LEAST_FRAMES = 10
"""A shorter stretch teaches nothing."""


def write_lerobot(root: Path, source: Path, skeleton: Skeleton, fps: int, task: str) -> str:
    """Write the dataset; returns what is in it, in words.

    Raises RecordingError where the robot never follows, ModuleNotFoundError without the extra `export`.
    """
    import av  # noqa: F401  # before a folder is made
    import pyarrow  # noqa: F401

    if root.exists():
        raise RecordingError(f"{root}: is there already; name another folder, or move it away")
    cameras = _cameras(source)
    maker = _Maker(root, skeleton, fps, cameras)
    frames = HeldFrames(skeleton, fps)
    with writing(root):
        (root / "meta").mkdir(parents=True)
        for episode in _stretches(frames.of(RecordingStream(source)), frozenset(cameras)):
            maker.add(episode)
        maker.finish(task)
    if not maker.episodes:
        shutil.rmtree(root)
        raise RecordingError(
            f"{source}: the robot follows nobody in it for {LEAST_FRAMES / fps:.1f} s, so there is no episode"
        )
    shown = f", cameras {', '.join(cameras)}" if cameras else ", no camera"
    count = sum(map(len, maker.episodes))
    return f"{len(maker.episodes)} episodes, {count} frames at {fps} Hz{shown}"


def _cameras(source: Path) -> list[str]:
    names = (entry.topic.split("/") for entry in RecordingStream(source))
    return sorted({parts[-1] for parts in names if len(parts) > 2 and parts[-2] == "video"})


def _stretches(frames: Iterator[HeldFrame], cameras: frozenset[str]) -> Iterator[list[HeldFrame]]:
    """Frames while the robot follows, all encoders and cameras are known, and states keep coming."""

    def usable(frame: HeldFrame) -> bool:
        known = np.isfinite(frame.encoder_rad).all() and np.isfinite(frame.setpoint_rad).all()
        return frame.guard == FOLLOWS and frame.fresh and bool(known) and cameras <= frame.pictures.keys()

    for good, group in groupby(frames, key=usable):
        stretch = list(group) if good else []
        if len(stretch) >= LEAST_FRAMES:
            yield stretch


class _Maker:
    """Gathers episodes, and encodes pictures as they come."""

    def __init__(self, root: Path, skeleton: Skeleton, fps: int, cameras: list[str]) -> None:
        self.episodes: list[Episode] = []
        self._root, self._skeleton, self._fps, self._cameras = root, skeleton, fps, cameras
        self._videos: dict[str, VideoOut] = {}
        self._pictures = {_key(camera): PictureStatistics() for camera in cameras}

    def add(self, frames: list[HeldFrame]) -> None:
        """One episode. Where the operator's angle of a joint is not known, the robot is asked to stay."""
        episode = Episode()
        own = {_key(camera): PictureStatistics() for camera in self._cameras}
        for frame in frames:
            episode.state.append(frame.encoder_rad)
            known = np.isfinite(frame.operator_rad)
            episode.action.append(np.where(known, frame.operator_rad, frame.setpoint_rad))
            for camera in self._cameras:
                picture = frame.pictures[camera]
                key = _key(camera)
                if key not in self._videos:
                    path = self._root / tables.at(tables.VIDEO, video_key=key)
                    self._videos[key] = VideoOut(path, self._fps, picture.width, picture.height)
                rgb = self._videos[key].put(picture.body)
                own[key].take(rgb)
                self._pictures[key].take(rgb)
        begin = sum(map(len, self.episodes))
        episode.statistics = {
            STATE: of_rows(np.array(episode.state)),
            ACTION: of_rows(np.array(episode.action)),
            **{key: statistics.values() for key, statistics in own.items()},
            **of_columns(_counted(len(self.episodes), begin, len(episode), self._fps)),
        }
        self.episodes.append(episode)

    def finish(self, task: str) -> None:
        """Write everything but the frames of the videos, which are written already."""
        for video in self._videos.values():
            video.close()
        if not self.episodes:
            return
        videos = {key: Video(one.width, one.height, one.codec) for key, one in self._videos.items()}
        tables.write_data(self._root, self.episodes, self._fps)
        tables.write_tasks(self._root, task)
        tables.write_episodes(self._root, self.episodes, videos, task, self._fps)
        tables.write_info(
            self._root, self._skeleton.joint_names, videos, self.episodes, self._fps, self._skeleton.name
        )
        columns: dict[str, list[float]] = {}
        begin = 0
        for number, episode in enumerate(self.episodes):
            for name, values in _counted(number, begin, len(episode), self._fps).items():
                columns.setdefault(name, []).extend(values)
            begin += len(episode)
        tables.write_stats(
            self._root,
            {
                STATE: of_rows(np.array([row for episode in self.episodes for row in episode.state])),
                ACTION: of_rows(np.array([row for episode in self.episodes for row in episode.action])),
                **{key: statistics.values() for key, statistics in self._pictures.items()},
                **of_columns(columns),
            },
        )


def _key(camera: str) -> str:
    return f"observation.images.{camera}"


def _counted(number: int, begin: int, length: int, fps: int) -> dict[str, list[float]]:
    """The columns that count, of one episode."""
    return {
        "timestamp": [k / fps for k in range(length)],
        "frame_index": [float(k) for k in range(length)],
        "episode_index": [float(number)] * length,
        "index": [float(begin + k) for k in range(length)],
        "task_index": [0.0] * length,
    }
