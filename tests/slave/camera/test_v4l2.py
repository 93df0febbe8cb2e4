"""With a stand-in for the device: there is none here."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from common.errors import RobotError
from slave.camera import v4l2
from slave.camera.v4l2 import V4l2Camera


class Capture:
    def __init__(self, refuses: bool = False) -> None:
        self.refuses = refuses
        self.asked: tuple[object, ...] = ()
        self.frames: queue.SimpleQueue[SimpleNamespace | None] = queue.SimpleQueue()

    def set_format(self, *asked: object) -> None:
        if self.refuses:
            raise OSError("Invalid argument")
        self.asked = asked

    def open(self) -> None: ...

    def __iter__(self) -> Iterator[SimpleNamespace]:
        while (frame := self.frames.get()) is not None:
            yield frame


def test_each_picture_is_had_once_with_the_driver_s_time_on_the_slave_s_clock() -> None:
    """By the driver's own clock each picture would seem 3 s older after a day, and the robot would hold."""
    capture = Capture()
    camera = V4l2Camera("/dev/video9", 320, 240, lambda _: capture, lambda at_ns: at_ns + 3_000_000_000)
    assert capture.asked == (320, 240, "MJPG")
    capture.frames.put(SimpleNamespace(timestamp=12.5, data=b"jpeg"))
    assert camera.newest() == (15_500_000_000, b"jpeg")
    capture.frames.put(None)
    with pytest.raises(RobotError, match="has failed: it ended"):
        camera.newest()


def test_a_camera_that_falls_silent_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(v4l2, "WAIT_S", 0.05)
    with pytest.raises(RobotError, match="no picture for"):
        V4l2Camera("/dev/video9", 320, 240, lambda _: Capture()).newest()


def test_a_camera_without_mjpg_is_refused_in_words() -> None:
    with pytest.raises(RobotError, match="/dev/video9 gives no MJPG pictures: Invalid argument"):
        V4l2Camera("/dev/video9", 320, 240, lambda _: Capture(refuses=True))
