"""Asks a robot's cameras for pictures that stand alone, over the link."""

from __future__ import annotations

import re
from collections.abc import Callable

from common.link import LinkSession
from common.wire.topics import JOINED, VIDEO_NAME, keyframe

MOST = 8
"""Cameras of one console."""


class KeyframeRequests:
    """Publishers by robot and camera, declared when first needed."""

    def __init__(self, session: LinkSession) -> None:
        self._session = session
        self._puts: dict[tuple[str, str], Callable[[bytes], None]] = {}

    def put(self, robot: str, camera: str) -> None:
        """Ask one camera; never blocks, and never raises."""
        key = robot, camera
        if key not in self._puts:
            if len(self._puts) >= MOST or re.match(VIDEO_NAME, camera) is None:
                return
            self._puts[key] = self._session.link(robot).publish(keyframe(camera))
        self._puts[key](JOINED)

    def forget(self, robot: str) -> None:
        """The robot's link is withdrawn."""
        self._puts = {key: put for key, put in self._puts.items() if key[0] != robot}
