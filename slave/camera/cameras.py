"""All cameras of a robot, as the loop has them: none holds up another, or the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack

from common.clock_sync import Offset
from common.link import Link
from common.metrics.lens import Lens
from common.metrics.slave import CameraMetrics
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Command
from common.wire.topics import keyframe, video
from slave.camera.config import CameraConfig
from slave.camera.feed import CameraFeed, open_feed
from slave.guard.config import GuardConfig
from slave.guard.eyes import video_loss


class Cameras:
    """A feed for each camera, each with a thread, a process, a topic and a rate of its own."""

    def __init__(self, feeds: Sequence[CameraFeed], lenses: Mapping[str, Lens]) -> None:
        """`lenses`: how each sees the robot, by name, as far as it is known."""
        self.feeds = list(feeds)
        self.lenses = dict(lenses)
        self._stack = ExitStack()

    def __enter__(self) -> Cameras:
        """Let pictures come."""
        for feed in self.feeds:
            self._stack.enter_context(feed)
        return self

    def __exit__(self, *_: object) -> None:
        """End threads and processes."""
        self._stack.close()

    def look(self, position_rad: Array, read_ns: int) -> None:
        """The newest joint angles (J,), and when they were read."""
        for feed in self.feeds:
            feed.look(position_rad, read_ns)

    def on_command(self, command: Command, now_ns: int, offset: Offset) -> None:
        """Take an accepted command: it acknowledges a picture of one of them."""
        for feed in self.feeds:
            feed.on_command(command, now_ns, offset)

    def loss(self, now_ns: int, config: GuardConfig) -> str | None:
        """Why the operator does not see the robot, and by which camera; None where nothing is amiss."""
        for feed in self.feeds:
            words = video_loss(feed.sight.captured_ns, now_ns, config) if feed.relied_on else None
            if words is not None:
                return words if len(self.feeds) == 1 else f"camera {feed.name}: {words}"
        return None

    @property
    def fault(self) -> str:
        """What is wrong with them, as text; empty where nothing is."""
        if len(self.feeds) == 1:
            return self.feeds[0].fault
        return "; ".join(f"{feed.name}: {feed.fault}" for feed in self.feeds if feed.fault)

    def main_metrics(self) -> CameraMetrics | None:
        """Of the first one; None without any."""
        return self.feeds[0].metrics() if self.feeds else None

    def other_metrics(self) -> dict[str, CameraMetrics]:
        """Of all others, by name."""
        return {feed.name: feed.metrics() for feed in self.feeds[1:]}


def open_cameras(configs: Sequence[CameraConfig], profile: str, link: Link, always: bool) -> Cameras:
    """The feeds of all configured cameras, each on its own topic, not yet started.

    `always`: pictures are made although nobody on the link looks, as somebody at the tap does.
    """
    places = [(index, len(configs)) for index in range(len(configs))]
    skeleton = load_skeleton(profile)
    seen = {one.name: one.lens(skeleton) for one in configs}
    return Cameras(
        [_open(one, profile, link, always, place) for one, place in zip(configs, places, strict=True)],
        {name: lens for name, lens in seen.items() if lens is not None},
    )


def _open(config: CameraConfig, profile: str, link: Link, always: bool, place: tuple[int, int]) -> CameraFeed:
    looked_at = threading.Event()

    def look(wanted: bool) -> None:
        (looked_at.set if wanted or always else looked_at.clear)()

    put: Callable[[bytes], None] = link.publish(video(config.name), look)
    feed = open_feed(config, profile, put, looked_at.is_set, place)
    link.subscribe(keyframe(config.name), lambda payload, _: feed.on_keyframe(payload))
    return feed
