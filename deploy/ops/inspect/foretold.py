"""What the page foretells of the robot, computed again over a master's recording. Pure."""

from __future__ import annotations

from common.clock import NS_PER_MS
from common.errors import CodecError
from common.recording import Entry
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from deploy.measure.ahead import AheadScore, RobotAhead

EVERY_NS = 40 * NS_PER_MS
"""As often as the page shows it."""


class ForetoldRobot:
    """Of one robot; only a master's recording has both messages on one clock."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._joints = len(skeleton.joints)
        self._ahead = RobotAhead(skeleton)
        self._next_ns = 0

    def take(self, entry: Entry) -> None:
        """One message."""
        kind = entry.topic.rpartition("/")[2]
        if kind not in ("command", "state"):
            return
        try:
            if kind == "command":
                self._ahead.on_command(decode(entry.payload, Command, self._joints))
            else:
                self._ahead.on_state(decode(entry.payload, RobotState, self._joints), entry.monotonic_ns)
        except CodecError:
            return
        if entry.monotonic_ns >= self._next_ns:
            self._next_ns = entry.monotonic_ns + EVERY_NS
            self._ahead.foretell(entry.monotonic_ns)

    def score(self) -> AheadScore | None:
        """None where nothing was foretold."""
        return self._ahead.score()
