"""The thread between a camera's process and the link, with real processes that are easily had."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import pytest

from common.clock import monotonic_ns
from common.errors import RobotError
from common.wire.topics import JOINED, LOST
from common.wire.video import VideoFrame, decode_frame
from slave.camera import feed as feed_module
from slave.camera.config import CameraConfig
from slave.camera.feed import CameraFeed
from slave.camera.pipe import PictureReply, PictureRequest, ReplyKind
from slave.camera.process import CameraProcess, NeverError
from slave.camera.sight import SeenPicture

CONFIG = CameraConfig(source="robot", most_rate_hz=60.0)
JOINTS = 25
SERVE = """
import sys
from slave.camera.pipe import *
out = sys.stdout.buffer
def say(reply):
    out.write(pack_reply(reply)); out.flush()
say(PictureReply(ReplyKind.READY))
while head := sys.stdin.buffer.read(REQUEST.size):
    read_ns, most, length, alone = request_of(head)
    sys.stdin.buffer.read(length)
    say(PictureReply(ReplyKind.PICTURE, read_ns, 320, 240, b"\\xff\\xd8 picture \\xff\\xd9"))
"""


def process(code: str = SERVE) -> CameraProcess:
    return CameraProcess("nursing", CONFIG, (sys.executable, "-c", code))


class Link:
    """Hears the feed, and can wait for what it is to hear."""

    def __init__(self) -> None:
        self.frames: list[VideoFrame] = []
        self._some = threading.Condition()

    def put(self, payload: bytes) -> None:
        with self._some:
            self.frames.append(decode_frame(payload))
            self._some.notify_all()

    def wait(self, count: int) -> list[VideoFrame]:
        with self._some:
            assert self._some.wait_for(lambda: len(self.frames) >= count, 20.0), "no picture came"
            return list(self.frames)


@contextmanager
def running(
    open_camera: Callable[[], CameraProcess], config: CameraConfig = CONFIG
) -> Iterator[tuple[CameraFeed, Link]]:
    link = Link()
    feed = CameraFeed(config, link.put, open_camera)
    feed.look(np.zeros(JOINTS), 12345)
    with feed:
        yield feed, link


def until(reached: Callable[[], bool]) -> None:
    deadline_ns = monotonic_ns() + 20_000_000_000
    while not reached():
        assert monotonic_ns() < deadline_ns
        time.sleep(0.005)


def test_pictures_carry_the_time_of_their_angles_and_numbers_that_grow() -> None:
    with running(process) as (feed, link):
        first, second = link.wait(2)[:2]
        assert (first.captured_ns, first.width, first.height) == (12345, 320, 240)
        assert second.number == first.number + 1
        assert feed.fault == ""


def test_a_camera_killed_is_told_and_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feed_module, "_FIRST_BACK_OFF_S", 0.3)
    opened: list[CameraProcess] = []

    def open_camera() -> CameraProcess:
        opened.append(process())
        return opened[-1]

    with running(open_camera) as (feed, link):
        last = link.wait(1)[-1].number
        os.kill(opened[0]._process.pid, signal.SIGKILL)
        until(lambda: feed.fault != "")
        assert "the camera's process has ended" in feed.fault
        until(lambda: len(opened) == 2)
        seen = len(link.frames)
        assert link.wait(seen + 1)[-1].number > last
        until(lambda: feed.fault == "")


SERVE_H264 = SERVE.replace(
    'say(PictureReply(ReplyKind.PICTURE, read_ns, 320, 240, b"\\xff\\xd8 picture \\xff\\xd9"))',
    "kind = ReplyKind.PICTURE if alone else ReplyKind.NEXT_PICTURE\n"
    "    say(PictureReply(kind, read_ns, 320, 240, bytes((0, 0, 0, 1, 9))))",
)
H264 = CameraConfig(source="robot", codec="h264", most_rate_hz=60.0, keyframe_s=60.0)


def acknowledge(feed: CameraFeed, number: int) -> None:
    """As the operator's command does."""
    feed._seen.append(SeenPicture(number, monotonic_ns(), 0))
    feed._wake.set()


@pytest.mark.parametrize("why", [LOST, JOINED])
def test_the_first_picture_and_an_asked_one_stand_alone_the_others_name_the_one_before(
    why: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feed_module, "_KEY_AGAIN_NS", 0)
    with running(lambda: process(SERVE_H264), H264) as (feed, link):
        for count in range(1, 5):
            acknowledge(feed, link.wait(count)[-1].number)
        before = len(link.frames)
        feed.on_keyframe(why)
        for count in range(before, before + 4):
            acknowledge(feed, link.wait(count)[-1].number)
        frames = list(link.frames)
    assert [frame.codec for frame in frames] == ["h264"] * len(frames)
    assert frames[0].after == 0
    alone = [i for i, frame in enumerate(frames) if frame.after == 0]
    assert len(alone) == 2
    for one, following in pairwise(frames):
        assert following.after in (0, one.number)


def test_requests_right_after_a_picture_that_stands_alone_get_no_other() -> None:
    with running(lambda: process(SERVE_H264), H264) as (feed, link):
        for count in range(1, 6):
            feed.on_keyframe(JOINED)
            acknowledge(feed, link.wait(count)[-1].number)
        frames, lost = list(link.frames), feed.metrics().not_acknowledged
    took_ns = frames[4].sent_ns - frames[0].sent_ns
    if took_ns < 300_000_000:
        assert [frame.after == 0 for frame in frames[:5]] == [True] + [False] * 4
    assert lost == 0


def test_after_a_loss_the_window_is_free_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feed_module, "_KEY_AGAIN_NS", 0)
    monkeypatch.setattr("slave.camera.rate._LOST_NS", 10**15)
    with running(lambda: process(SERVE_H264), H264) as (feed, link):
        link.wait(2)  # both are lost: as many as may be are under way
        feed.on_keyframe(LOST)
        assert link.wait(3)[2].after == 0
        assert feed.metrics().not_acknowledged == 2


def test_a_machine_that_cannot_says_so_once_and_is_not_asked_again() -> None:
    code = "import sys\nfrom slave.camera.pipe import *\n" \
        "sys.stdout.buffer.write(pack_reply(PictureReply(ReplyKind.NEVER, body=b'no OpenGL')))"  # fmt: skip
    opened = 0

    def open_camera() -> CameraProcess:
        nonlocal opened
        opened += 1
        return process(code)

    with running(open_camera) as (feed, _):
        until(lambda: feed.fault == "no OpenGL")
        until(lambda: not feed._thread.is_alive())
    assert opened == 1


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("", "has ended"),
        ("print('hello from a driver, which is no answer')", "camera's process"),
        ("import sys; sys.stdout.buffer.write(b'\\1' * 5)", "has ended"),
    ],
)
def test_a_process_that_is_no_camera_is_refused_in_words(code: str, said: str) -> None:
    camera = process(code)
    with pytest.raises(RobotError, match=said):
        camera.wait_ready()
    camera.close()


def test_a_process_that_does_not_answer_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slave.camera.process.ANSWER_S", 0.1)
    camera = process(SERVE.split("while")[0] + "sys.stdin.buffer.read()")
    camera.wait_ready()
    with pytest.raises(RobotError, match="does not answer"):
        camera.ask(PictureRequest(0, 1000, np.zeros(JOINTS)))
    camera.close()


def test_the_feed_ends_at_once_whatever_its_camera_does() -> None:
    with running(lambda: process(SERVE.split("say(PictureReply")[0] + "sys.stdin.buffer.read()")) as (
        feed,
        _,
    ):
        until(lambda: feed._camera is not None)
    assert not feed._thread.is_alive()


def drawn() -> CameraProcess:
    camera = CameraProcess("nursing", CameraConfig(source="robot"))
    try:
        camera.wait_ready()
    except NeverError as error:
        camera.close()
        pytest.skip(str(error))
    return camera


def test_the_robot_sees_its_room_and_keeps_within_the_bytes() -> None:
    camera = drawn()
    try:
        sizes = {}
        for most_bytes in (1500, 1500, 1500, 40_000):
            reply = camera.ask(PictureRequest(99, most_bytes, np.zeros(JOINTS)))
            assert reply.answer is ReplyKind.PICTURE
            assert reply.captured_ns == 99
            assert len(reply.body) <= most_bytes
            sizes[most_bytes] = (reply.width, reply.height)
        assert sizes[1500][0] < 320
    finally:
        camera.close()


def test_without_opengl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no such thing")
    camera = CameraProcess("nursing", CameraConfig(source="robot"))
    with pytest.raises(NeverError, match="libegl1"):
        camera.wait_ready()
    camera.close()


def test_without_the_device_it_says_so() -> None:
    camera = CameraProcess("nursing", CameraConfig(source="v4l2", device="/dev/no-such-camera"))
    with pytest.raises(RobotError, match="there is no camera /dev/no-such-camera") as raised:
        camera.wait_ready()
    # it may be plugged in later
    assert not isinstance(raised.value, NeverError)
    camera.close()


def test_a_camera_s_process_ends_when_the_slave_does() -> None:
    camera = process(SERVE)
    camera.wait_ready()
    assert camera._process.stdin is not None
    camera._process.stdin.close()
    assert camera._process.wait(10) == 0
    camera.close()
    assert PictureReply(ReplyKind.TROUBLE, body=b"x").words == "x"


def test_no_picture_is_made_while_nobody_looks() -> None:
    asked: list[int] = []

    class Counting(CameraProcess):
        def ask(self, request: PictureRequest) -> PictureReply:
            asked.append(request.read_ns)
            return super().ask(request)

    wanted = threading.Event()
    link = Link()
    feed = CameraFeed(
        CONFIG,
        link.put,
        lambda: Counting("nursing", CONFIG, (sys.executable, "-c", SERVE)),
        wanted=wanted.is_set,
    )
    feed.look(np.zeros(JOINTS), 12345)
    with feed:
        until(lambda: feed._camera is not None)
        time.sleep(3 * feed_module._IDLE_S)
        assert asked == []
        wanted.set()
        link.wait(2)
        wanted.clear()
        until(lambda: len(asked) == len(link.frames))
        before = len(asked)
        time.sleep(3 * feed_module._IDLE_S)
        assert len(asked) <= before + 1
