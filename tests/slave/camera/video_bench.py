"""What video does to commands and states on a slow link: the real link, feed and rate control, over a proxy.

The camera is a stand-in that fills whatever it is allowed to: the worst that a picture can be. One run a
process, for what is left in a link's queue at its end must not meet the next run:

    python -m tests.slave.camera.video_bench controlled --kb-s 125 --seconds 20
    python -m tests.slave.camera.video_bench controlled --kb-s 12500 --cameras 3 --rate 25 --kb 60 --freeze
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import threading
from contextlib import AsyncExitStack
from dataclasses import asdict, dataclass, replace

import numpy as np

from common.clock import monotonic_ns, to_ns
from common.clock_sync import Offset
from common.errors import RobotError
from common.latency.durations import Durations
from common.link import Link, open_link
from common.link.config import LinkConfig
from common.metrics.parts import Summary
from common.metrics.slave import CameraMetrics
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.skeleton import load_skeleton
from common.wire.codec import decode, encode
from common.wire.messages import Command, CommandStamps, RobotState
from common.wire.topics import COMMAND, IN_ORDER, STATE
from common.wire.topics import video as on_video
from deploy.harness.endpoints import free_port
from master.picture import CamerasWatch
from slave.camera.cameras import Cameras
from slave.camera.config import CameraConfig
from slave.camera.feed import CameraFeed
from slave.camera.pipe import PictureReply, PictureRequest, ReplyKind
from slave.camera.rate import RateControl
from tests.slave.camera.slow_link import SlowLink, SlowLinkOptions

ROBOT = "video-bench"
FIXED_BYTES = 30_000
"""Of each picture where nothing controls the rate."""
_ALL = np.ones(len(load_skeleton("nursing").joints), np.bool_)
_ZERO = np.zeros(len(_ALL))


@dataclass(frozen=True, slots=True)
class VideoRun:
    """What one run measured; ages in ms."""

    command_ms: Summary
    state_ms: Summary
    video: CameraMetrics | None
    """Of the main camera, with `fps` as received over the whole run; None without video."""
    fps: dict[str, float]
    """Of each camera, as received over the whole run."""
    still_s: dict[str, float]
    """Of each camera, how long before the end its last picture came."""


@dataclass(frozen=True, slots=True)
class BenchCameras:
    """How many cameras, and what each may send at best."""

    count: int = 1
    rate_hz: float = 12.0
    most_kb: float = 40.0
    freeze: bool = False
    """Whether the last one stops answering after 20 pictures."""


class FullCamera:
    """Fills its budget to the last byte."""

    def wait_ready(self) -> None:
        """At once."""

    def ask(self, request: PictureRequest) -> PictureReply:
        """A JPEG's two ends with nothing between them."""
        body = b"\xff\xd8" + bytes(request.most_bytes - 60) + b"\xff\xd9"
        return PictureReply(ReplyKind.PICTURE, monotonic_ns(), 320, 240, body)

    def kill(self) -> None:
        """Nothing to end."""

    def close(self) -> None:
        """Nothing to end."""


class FrozenCamera(FullCamera):
    """Answers 20 times, and then waits until it is killed."""

    def __init__(self) -> None:
        self._asked = 0
        self._killed = threading.Event()

    def ask(self, request: PictureRequest) -> PictureReply:
        """As a driver that hangs."""
        self._asked += 1
        if self._asked > 20:
            self._killed.wait()
            raise RobotError("killed")
        return super().ask(request)

    def kill(self) -> None:
        """Let the thread end."""
        self._killed.set()


class Uncontrolled(RateControl):
    """What not to do: a fixed size at a fixed rate, whatever becomes of it."""

    @property
    def budget_bytes(self) -> int:
        """Always the same."""
        return FIXED_BYTES

    def due_ns(self, now_ns: int) -> int:
        """Always on time."""
        return now_ns if self._last_sent_ns is None else self._last_sent_ns + round(self._fastest_ns)


async def measure(
    options: SlowLinkOptions,
    seconds: float,
    video: str = "controlled",
    cameras: BenchCameras = BenchCameras(),
) -> VideoRun:
    """One run. `video`: off, controlled, or uncontrolled. Raises LinkError where no link comes about."""
    robot_port = free_port("tcp")
    async with AsyncExitStack() as stack:
        slow = stack.enter_context(SlowLink(robot_port, options))
        robot = await stack.enter_async_context(open_link(_listening(robot_port), ROBOT))
        operator = await stack.enter_async_context(open_link(_connecting(slow.port), ROBOT))
        await operator.connected()
        same_clock = Offset(0, to_ns(options.delay_s), trusted=True)
        watch, commands, states = CamerasWatch(), Durations(), Durations()
        came: dict[str, list[int]] = {}
        feeds = Cameras([], {})
        if video != "off":
            make = Uncontrolled if video == "uncontrolled" else RateControl
            feeds = Cameras([_feed(robot, cameras, index, make) for index in range(cameras.count)], {})
            feeds.look(_ZERO, monotonic_ns())

            def on_picture(key: str, payload: bytes, arrived_ns: int) -> None:
                came.setdefault(key.rpartition("/")[2], []).append(arrived_ns)
                watch.on_payload(key, payload, arrived_ns)

            operator.subscribe_keys(on_video("*"), on_picture, in_order=IN_ORDER)

        def on_command(payload: bytes, arrived_ns: int) -> None:
            command = decode(payload, Command, len(_ALL))
            commands.record(arrived_ns - command.stamps.put_ns)
            feeds.on_command(command, arrived_ns, same_clock)

        def on_state(payload: bytes, arrived_ns: int) -> None:
            states.record(arrived_ns - decode(payload, RobotState, len(_ALL)).sent_ns)

        robot.subscribe(COMMAND, on_command)
        operator.subscribe(STATE, on_state)
        await asyncio.sleep(0.3)  # declarations travel too
        stack.enter_context(feeds)
        began_ns = monotonic_ns()
        until_ns = began_ns + to_ns(seconds)
        await asyncio.gather(_command(operator, watch, until_ns), _tell(robot, until_ns))
        fps = {name: len(times) / seconds for name, times in came.items()}
        still_s = {name: round((until_ns - times[-1]) / 1e9, 2) for name, times in came.items()}
        main = feeds.main_metrics()
        shown = None if main is None else replace(main, fps=fps.get("camera0", 0.0))
        return VideoRun(commands.summary(), states.summary(), shown, fps, still_s)


def _feed(robot: Link, cameras: BenchCameras, index: int, make: type[RateControl]) -> CameraFeed:
    name = f"camera{index}"
    config = CameraConfig(
        source="robot", name=name, most_rate_hz=cameras.rate_hz, most_kb=cameras.most_kb, most_delay_s=0.03
    )
    frozen = cameras.freeze and index == cameras.count - 1
    place = (index, cameras.count)
    source = FrozenCamera if frozen else FullCamera
    return CameraFeed(config, robot.publish(on_video(name)), source, make_rate=make, place=place)


async def _command(link: Link, watch: CamerasWatch, until_ns: int) -> None:
    put = link.publish(COMMAND.of("nurse-1"))
    command = Command(ROBOT, 1, 0, 0, CommandStamps(0, 0, 0, 0), True, _ALL, _ZERO, _ZERO)
    async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / COMMAND.rate_hz))):
        now_ns = monotonic_ns()
        if now_ns > until_ns:
            return
        number, arrived_ns = watch.seen_by(now_ns)
        stamps = CommandStamps(now_ns, now_ns, now_ns, now_ns)
        put(encode(replace(command, sequence=due.tick, stamps=stamps, seen_frame=number, seen_ns=arrived_ns)))


async def _tell(link: Link, until_ns: int) -> None:
    put = link.publish(STATE)
    state = RobotState(ROBOT, 0, 0, 0, "track", "follows", "nurse-1", _ALL, _ZERO, _ZERO, None, 0, 0)
    async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / STATE.rate_hz))):
        now_ns = monotonic_ns()
        if now_ns > until_ns:
            return
        put(encode(replace(state, sequence=due.tick, sent_ns=now_ns)))


def _listening(port: int) -> LinkConfig:
    return LinkConfig(listen=[f"tcp/127.0.0.1:{port}"])


def _connecting(port: int) -> LinkConfig:
    return LinkConfig(connect=[f"tcp/127.0.0.1:{port}"])


def main() -> None:
    """One run, as JSON on standard output."""
    parser = argparse.ArgumentParser(prog="python -m tests.slave.camera.video_bench")
    parser.add_argument("video", choices=("off", "controlled", "uncontrolled"))
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--kb-s", type=float, default=125.0, help="in each direction")
    parser.add_argument("--delay-ms", type=float, default=20.0)
    parser.add_argument("--shared", action="store_true", help="both directions share the rate")
    parser.add_argument("--cameras", type=int, default=1)
    parser.add_argument("--rate", type=float, default=12.0, help="pictures a second of each camera, at best")
    parser.add_argument("--kb", type=float, default=40.0, help="of a picture, at best")
    parser.add_argument("--freeze", action="store_true", help="the last camera stops after 20 pictures")
    chosen = parser.parse_args()
    cameras = BenchCameras(chosen.cameras, chosen.rate, chosen.kb, chosen.freeze)
    options = SlowLinkOptions(1000 * chosen.kb_s, chosen.delay_ms / 1000, chosen.shared)
    run = asyncio.run(measure(options, chosen.seconds, chosen.video, cameras))
    sys.stdout.write(json.dumps(asdict(run)) + "\n")


if __name__ == "__main__":
    main()
