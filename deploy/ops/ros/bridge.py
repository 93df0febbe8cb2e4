"""Hears a robot and tells ROS.

It has no publisher, question or answer on the robot's side, and no subscriber on the side of ROS: two
sessions, and only this file between them.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from common.clock import monotonic_ns, wall_ns
from common.errors import CodecError
from common.link import Link, open_link
from common.link.config import LinkConfig
from common.link.opening import open_zenoh
from common.log.throttle import LogThrottle
from common.process.runtime import until_stopped
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import RobotState
from common.wire.topics import STATE, video
from common.wire.video import JPEG, decode_frame
from deploy.ops.ros.publishers import KeyFormat, RosPublishers
from deploy.ros.translate import Published, Translator

log = logging.getLogger(__name__)
_LOOK_S = 0.5
NODE = "tandem_bridge"


@dataclass(frozen=True, slots=True)
class BridgeOptions:
    """What the command line chose."""

    link: LinkConfig
    """To the robot."""
    robot: str
    skeleton: Skeleton
    ros: LinkConfig
    """To the router on the ROS side."""
    domain: int = 0
    keys: KeyFormat = KeyFormat.RMW_ZENOH
    cameras: tuple[str, ...] = ()
    seconds: float | None = None


async def bridge(
    options: BridgeOptions, stop: asyncio.Event, report: Callable[[str], None]
) -> dict[str, int]:
    """Tell ROS until `stop` is set or the time is over; how many messages went to each topic.

    Raises LinkError where a session cannot be opened; a router that is not there yet is waited for.
    """
    sent: dict[str, int] = {}
    await until_stopped(stop, _run(options, report, sent))
    return sent


async def _run(options: BridgeOptions, report: Callable[[str], None], sent: dict[str, int]) -> None:
    async with open_link(options.link, options.robot) as link:
        session = await open_zenoh(options.ros, waits=report)
        try:
            publishers = RosPublishers(session, NODE, options.domain, options.keys)
            publishers.sent = sent
            await _tell(options, link, publishers, report)
        finally:
            await asyncio.to_thread(session.close)


async def _tell(
    options: BridgeOptions, link: Link, publishers: RosPublishers, report: Callable[[str], None]
) -> None:
    translator = Translator(options.robot, options.skeleton)
    wrong = LogThrottle()

    def publish(messages: list[Published], now_ns: int) -> None:
        for topic, payload in messages:
            publishers.put(topic, payload, now_ns)

    def on_state(payload: bytes, _: int) -> None:
        now_ns = wall_ns()
        try:
            state = decode(payload, RobotState, len(options.skeleton.joints))
        except CodecError as error:
            if wrong.passes(monotonic_ns()):
                log.warning("%s: a state does not fit %s: %s", options.robot, options.skeleton.name, error)
            return
        publish(translator.state(state, now_ns), now_ns)

    def on_picture(camera: str, payload: bytes, _: int) -> None:
        try:
            frame = decode_frame(payload)
        except CodecError as error:
            if wrong.passes(monotonic_ns(), camera):
                log.warning("%s: a picture of %s cannot be read: %s", options.robot, camera, error)
            return
        if frame.codec != JPEG:
            if wrong.passes(monotonic_ns(), camera):
                log.warning("%s: %s sends H.264; only JPEG is passed on to ROS", options.robot, camera)
            return
        publish([translator.picture(camera, frame)], wall_ns())

    link.subscribe(STATE, on_state)
    for camera in options.cameras:
        link.subscribe(video(camera), partial(on_picture, camera))
    loop = asyncio.get_running_loop()
    end_s = None if options.seconds is None else loop.time() + options.seconds
    while end_s is None or loop.time() < end_s:
        now_ns = wall_ns()
        publish(translator.silence(now_ns), now_ns)
        report(
            ", ".join(f"{name} {count}" for name, count in publishers.sent.items()) or "nothing is heard yet"
        )
        await asyncio.sleep(_LOOK_S if end_s is None else max(0.0, min(_LOOK_S, end_s - loop.time())))
