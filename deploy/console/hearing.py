"""Hears robots: from the master's tap on this host, or from the robots themselves."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from common.clock import monotonic_ns, to_ns
from common.errors import CodecError, LinkError, TandemError
from common.link import Link, LinkSession, open_session
from common.link.config import LinkConfig
from common.log.throttle import LogThrottle
from common.metrics.slave import SlaveMetrics
from common.tap.message import TapMessage
from common.tap.reader import TapReader
from common.wire.codec import decode
from common.wire.messages import Command, RobotState, Statistics
from common.wire.topics import IN_ORDER, STATE, STATISTICS, VIDEO, Topic
from common.wire.video import decode_frame
from deploy.console.model.robot import LINK, TAP, RobotModel

AGAIN_S = 0.5
"""Between two attempts to reach the tap."""
LOOK_S = 0.25
TOPICS = ("tandem/",)
"""What is wanted of the tap: the link's messages."""
Models = dict[str, RobotModel]
"""By robot; those that pages open come and go."""

log = logging.getLogger(__name__)


class Hearing:
    """Hands every message to the robot's model. One that cannot be read changes nothing."""

    def __init__(self, models: Models) -> None:
        self.models = models
        self._throttle = LogThrottle()
        self.undecodable = 0
        self.heard_ns = 0
        """When the tap said something last."""
        self.on_picture: Callable[[RobotModel, str], None] = lambda model, camera: None
        """Called with the robot and the camera's name when a newer picture came."""

    async def read_tap(self, path: Path) -> None:
        """Read the master's tap until cancelled; again and again where it is not there."""
        said = ""
        while True:
            try:
                with TapReader(path, TOPICS) as reader:
                    log.info("%s: the master is heard", path)
                    while True:
                        self.on_tap(await reader.read())
            except TandemError as error:
                if str(error) != said:
                    log.warning("%s; trying again", error)
                said = str(error)
            await asyncio.sleep(AGAIN_S)

    def on_tap(self, message: TapMessage) -> None:
        """One message of the tap."""
        self.heard_ns = monotonic_ns()
        if message.topic.startswith(TOPICS):
            self._take(message.topic, message.payload, message.stamp_ns, TAP)

    def listen(self, session: LinkSession, states: bool) -> None:
        """Hear the robots' figures over the link; their states and pictures too where there is no tap."""
        for robot in self.models:
            link = session.link(robot)
            self._subscribe(link, (STATISTICS, STATE, VIDEO) if states else (STATISTICS,))

    def open(self, session: LinkSession, model: RobotModel) -> None:
        """Hear one more robot over the link, in full."""
        self.models[model.robot] = model
        self._subscribe(session.link(model.robot), (STATISTICS, STATE, VIDEO))

    def _subscribe(self, link: Link, topics: Sequence[Topic]) -> None:
        for topic in topics:
            link.subscribe_keys(
                topic,
                lambda key, payload, at_ns: self._take(key, payload, at_ns, LINK),
                in_order=IN_ORDER if topic is VIDEO else 0,
            )

    def close(self, robot: str) -> None:
        """Hear it no more; the caller withdraws its link."""
        self.models.pop(robot, None)

    async def stand_in(self, config: LinkConfig) -> None:
        """While the tap is silent, hear the robots' states from themselves, until cancelled.

        Not always: a second copy of every state would cross the line.
        """
        while True:
            await asyncio.sleep(LOOK_S)
            if not self._tap_silent():
                continue
            try:
                async with open_session(config, router_within_s=AGAIN_S) as session:
                    for robot in self.models:
                        session.link(robot).subscribe_keys(
                            STATE, lambda key, payload, at_ns: self._take(key, payload, at_ns, LINK)
                        )
                    while self._tap_silent():  # noqa: ASYNC110
                        await asyncio.sleep(LOOK_S)
            except LinkError as error:
                if self._throttle.passes(monotonic_ns(), "stand in"):
                    log.warning("the robots cannot be heard directly: %s", error)

    def _tap_silent(self) -> bool:
        return monotonic_ns() - self.heard_ns > to_ns(AGAIN_S)

    def _take(self, key: str, payload: bytes, at_ns: int, source: str) -> None:
        parts = key.split("/")
        model = self.models.get(parts[1]) if len(parts) > 2 else None
        if model is None:
            return
        try:
            self._hand_over(model, parts, payload, at_ns, source)
        except CodecError as error:
            self.undecodable += 1
            if self._throttle.passes(at_ns, key):
                log.warning("%s: a message cannot be read: %s", key, error)

    def _hand_over(
        self, model: RobotModel, parts: list[str], payload: bytes, at_ns: int, source: str
    ) -> None:
        match parts[2:]:
            case ["state"]:
                model.on_state(decode(payload, RobotState, model.joints), at_ns, source)
            case ["operator", _, "command"]:
                model.on_command(decode(payload, Command, model.joints), at_ns)
            case ["video", camera]:
                frame = decode_frame(payload)
                if model.on_picture(camera, frame, at_ns):
                    self.on_picture(model, camera)
            case ["statistics"]:
                metrics = decode(payload, Statistics).metrics
                if isinstance(metrics, SlaveMetrics):
                    model.on_robot(metrics, at_ns)
                else:
                    model.on_master(metrics, at_ns)
