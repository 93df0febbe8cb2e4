"""Several cameras at one robot: one that stands still, ends or is slow does not hold up the others."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from common.clock import monotonic_ns
from common.clock_sync import Offset
from common.config.load import check_config, load_config
from common.errors import ConfigError
from common.wire.messages import Command, CommandStamps
from deploy.examples.profiles import example
from slave.camera.cameras import Cameras
from slave.camera.config import CameraConfig
from slave.camera.feed import CameraFeed
from slave.camera.process import CameraProcess
from slave.camera.rate import RateControl, RateLimits
from slave.config import SlaveConfig
from slave.guard.config import GuardConfig
from tests.slave.camera.test_feed import SERVE, Link, until

NEVER_ANSWERS = """
import sys, time
from slave.camera.pipe import *
sys.stdout.buffer.write(pack_reply(PictureReply(ReplyKind.READY))); sys.stdout.buffer.flush()
sys.stdin.buffer.read()
"""
OFFSET = Offset(0, 0, trusted=True)


@contextmanager
def running(*codes: str) -> Iterator[tuple[Cameras, list[Link]]]:
    links = [Link() for _ in codes]
    feeds = []
    for index, (code, link) in enumerate(zip(codes, links, strict=True)):
        config = CameraConfig(source="robot", name=f"camera{index}", most_rate_hz=60.0)
        command = (sys.executable, "-c", code)
        feeds.append(
            CameraFeed(
                config,
                link.put,
                lambda config=config, command=command: CameraProcess("nursing", config, command),  # type: ignore[misc]
                place=(index, len(codes)),
            )
        )
    with Cameras(feeds, {}) as cameras:
        cameras.look(np.zeros(25), 12345)
        yield cameras, links


def command(seen_frame: int) -> Command:
    every, zero = np.ones(25, np.bool_), np.zeros(25)
    now_ns = monotonic_ns()
    return Command("robot-1", 1, 1, 1, CommandStamps(now_ns, now_ns, now_ns, now_ns), True, every, zero, zero,
                   seen_frame, now_ns)  # fmt: skip


def test_one_that_never_answers_does_not_hold_up_the_others() -> None:
    with running(SERVE, NEVER_ANSWERS, SERVE) as (cameras, links):
        for count in range(1, 12):
            for link in (links[0], links[2]):
                newest = link.wait(count)[-1]
                cameras.on_command(command(newest.number), monotonic_ns(), OFFSET)
        assert links[1].frames == []
        until(lambda: "does not answer" in cameras.fault)
        assert cameras.fault.startswith("camera1: ")
        assert {len(str(link.frames[0].number)) for link in (links[0], links[2])} != {0}
    numbers = [{frame.number for frame in link.frames} for link in links]
    assert numbers[0].isdisjoint(numbers[2]), "a command's acknowledgement would fit two cameras"


def test_only_the_camera_of_the_acknowledged_picture_takes_it() -> None:
    with running(SERVE, SERVE) as (cameras, links):
        first = links[0].wait(1)[0]
        links[1].wait(1)
        cameras.on_command(command(first.number), monotonic_ns(), OFFSET)
        assert [feed.sight.captured_ns for feed in cameras.feeds] == [12345, None]
        late = monotonic_ns() + 10**12
        assert (cameras.loss(late, GuardConfig()) or "").startswith("camera camera0: ")


def test_cameras_share_the_wait_and_the_lines_time() -> None:
    alone, shared = (RateControl(RateLimits(25.0, 1.0, 30_000_000, 100_000, n)) for n in (1, 3))
    due = []
    for rate in (alone, shared):
        rate.sent(1, 1500, 0)
        rate.seen(1, 100_000_000, 20_000_000)
        due.append(rate.due_ns(100_000_000))
    assert due == [40_000_000, 120_000_000]


@pytest.mark.parametrize(("rate_hz", "cameras", "window"), [(12.0, 1, 2), (25.0, 1, 3), (25.0, 3, 7)])
def test_as_many_are_under_way_as_are_due_until_they_can_be_acknowledged(
    rate_hz: float, cameras: int, window: int
) -> None:
    assert RateLimits(rate_hz, 1.0, 1, 1, cameras).window == window


def slave(cameras: str) -> SlaveConfig:
    table = tomllib.loads(example("slave").read_text("utf-8"))
    table["camera"] = tomllib.loads(cameras)["camera"]
    return check_config(Path("slave.toml"), table, SlaveConfig)


def test_a_table_is_one_camera_and_a_list_up_to_three() -> None:
    assert [one.name for one in load_config(example("slave"), SlaveConfig).camera.all] == ["head"]
    hand = '[[camera]]\nsource = "v4l2"\nname = "hand"\nwidth = 1280\nheight = 720\n'
    listed = f'[[camera]]\nsource = "robot"\n{hand}'
    config = slave(listed)
    assert [(one.name, one.source, one.width) for one in config.camera.all] == [
        ("head", "robot", 320), ("hand", "v4l2", 1280),
    ]  # fmt: skip
    for wrong, named in (
        (listed.replace("hand", "head"), "camera.name"),
        (listed.replace('"robot"', '"v4l2"'), "camera.device"),
        (listed * 2, "camera = .*at most 3 cameras, not 4"),
        (f"{listed}colour = 3\n", r"camera\.1\.colour = 3"),
        (f"[[camera]]\nwidth = 81\n{hand}", r"camera\.0\.width = 81"),
    ):
        with pytest.raises(ConfigError, match=named):
            slave(wrong)


def test_a_camera_that_sends_rarely_must_leave_the_guard_its_time() -> None:
    main = '[[camera]]\nsource = "robot"\nleast_rate_hz = 5.0\n'
    rare = f'{main}[[camera]]\nsource = "robot"\nname = "room"\nleast_rate_hz = 0.1\n'
    with pytest.raises(ConfigError, match="max_video_age_s"):
        slave(rare)
    assert len(slave(rare + "relied_on = false\n").camera.all) == 2
