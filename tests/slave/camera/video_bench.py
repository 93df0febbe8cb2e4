"""What video does to commands and states on a slow link: the real link, feed and rate control, over a proxy.

The camera is a stand-in that fills whatever it is allowed to: the worst that a picture can be. One run a
process, for what is left in a link's queue at its end must not meet the next run:

    python -m tests.slave.camera.video_bench controlled --kb-s 125 --seconds 20
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from contextlib import AsyncExitStack
from dataclasses import asdict, dataclass, replace

import numpy as np

from common.clock import monotonic_ns, to_ns
from common.clock_sync import Offset
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
from common.wire.topics import COMMAND, STATE, VIDEO
from deploy.harness.endpoints import free_port
from master.picture import VideoWatch
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
    """Of the feed, with `fps` as received over the whole run; None without video."""


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


class Uncontrolled(RateControl):
    """What not to do: a fixed size at a fixed rate, whatever becomes of it."""

    @property
    def budget_bytes(self) -> int:
        """Always the same."""
        return FIXED_BYTES

    def due_ns(self, now_ns: int) -> int:
        """Always on time."""
        return now_ns if self._last_sent_ns is None else self._last_sent_ns + round(self._fastest_ns)


async def measure(options: SlowLinkOptions, seconds: float, video: str = "controlled") -> VideoRun:
    """One run. `video`: off, controlled, or uncontrolled. Raises LinkError where no link comes about."""
    robot_port = free_port("tcp")
    async with AsyncExitStack() as stack:
        slow = stack.enter_context(SlowLink(robot_port, options))
        robot = await stack.enter_async_context(open_link(_listening(robot_port), ROBOT))
        operator = await stack.enter_async_context(open_link(_connecting(slow.port), ROBOT))
        await operator.connected()
        same_clock = Offset(0, to_ns(options.delay_s), trusted=True)
        watch, commands, states = VideoWatch(), Durations(), Durations()
        feed: CameraFeed | None = None
        if video != "off":
            make = Uncontrolled if video == "uncontrolled" else RateControl
            config = CameraConfig(source="robot")
            feed = CameraFeed(config, robot.publish(VIDEO), FullCamera, make_rate=make)
            feed.look(_ZERO, monotonic_ns())
            operator.subscribe(VIDEO, watch.on_payload)

        def on_command(payload: bytes, arrived_ns: int) -> None:
            command = decode(payload, Command, len(_ALL))
            commands.record(arrived_ns - command.stamps.put_ns)
            if feed is not None:
                feed.on_command(command, arrived_ns, same_clock)

        def on_state(payload: bytes, arrived_ns: int) -> None:
            states.record(arrived_ns - decode(payload, RobotState, len(_ALL)).sent_ns)

        robot.subscribe(COMMAND, on_command)
        operator.subscribe(STATE, on_state)
        await asyncio.sleep(0.3)  # declarations travel too
        if feed is not None:
            stack.enter_context(feed)
        began_ns = monotonic_ns()
        until_ns = began_ns + to_ns(seconds)
        await asyncio.gather(_command(operator, watch, until_ns), _tell(robot, until_ns))
        shown = None if feed is None else replace(feed.metrics(), fps=watch.received / seconds)
        return VideoRun(commands.summary(), states.summary(), shown)


async def _command(link: Link, watch: VideoWatch, until_ns: int) -> None:
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
    chosen = parser.parse_args()
    options = SlowLinkOptions(1000 * chosen.kb_s, chosen.delay_ms / 1000, chosen.shared)
    run = asyncio.run(measure(options, chosen.seconds, chosen.video))
    sys.stdout.write(json.dumps(asdict(run)) + "\n")


if __name__ == "__main__":
    main()
