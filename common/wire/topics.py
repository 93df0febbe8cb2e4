"""One table of all topics: key, rate, time-out and quality of service; liveness follows from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from common.wire.sender import operator_chunk


class Priority(StrEnum):
    """Names as Zenoh has them."""

    REAL_TIME = "real_time"
    INTERACTIVE_HIGH = "interactive_high"
    INTERACTIVE_LOW = "interactive_low"
    DATA_HIGH = "data_high"
    DATA = "data"
    DATA_LOW = "data_low"
    BACKGROUND = "background"


@dataclass(frozen=True, slots=True)
class Topic:
    """A key expression with `{robot}`, and `{operator}` for an operator's own keys; how it travels."""

    name: str
    key: str
    rate_hz: float
    """Nominal rate; 0 where it is sent on demand."""
    timeout_s: float
    """Silence after which it counts as dead; 0 where silence means nothing."""
    priority: Priority
    reliable: bool
    drop: bool
    """Under congestion drop rather than block: a `put` must never stall the loop."""
    express: bool
    """Never batched."""

    def key_for(self, robot: str) -> str:
        """The key of one robot; of an operator's topic that of every operator, as who hears them needs it."""
        return self.key.format(robot=robot, operator="*")

    def of(self, operator: str) -> Topic:
        """The topic on the keys of one operator, as who sends on it needs it."""
        return replace(self, key=self.key.replace("{operator}", operator_chunk(operator)))

    def with_quality(self, reliable: bool | None, priority: Priority | None, express: bool | None) -> Topic:
        """The same topic, travelling otherwise where a value is given."""
        return replace(
            self,
            reliable=self.reliable if reliable is None else reliable,
            priority=self.priority if priority is None else priority,
            express=self.express if express is None else express,
        )


COMMAND = Topic(
    "command", "tandem/{robot}/operator/{operator}/command", 12.5, 0.2, Priority.REAL_TIME, False, True, True
)  # fmt: skip
"""On the operator's own key: access control binds it to the name in the operator's certificate."""
STATE = Topic("state", "tandem/{robot}/state", 50.0, 0.2, Priority.INTERACTIVE_HIGH, False, True, True)
CONTROL = Topic(
    "control", "tandem/{robot}/operator/{operator}/control", 0.0, 1.0, Priority.REAL_TIME, True, True, True
)
"""As COMMAND: the robot takes who asks from the key on which the question arrived."""
STOP = Topic("stop", "tandem/{robot}/stop", 0.0, 1.0, Priority.REAL_TIME, True, True, True)
"""As CONTROL, for stops and status requests alone: access control does not look into messages, so a key of
their own is needed to allow them to every named host."""
CLOCK = Topic("clock", "tandem/{robot}/clock", 4.0, 1.0, Priority.REAL_TIME, True, True, True)
PATH = Topic("path", "tandem/{robot}/path", 0.0, 1.0, Priority.DATA_LOW, True, True, True)
"""Questions of any size, answered by any size (`common.wire.path_probe`): which does the way carry?"""
STATISTICS = Topic("statistics", "tandem/{robot}/statistics", 1.0, 5.0, Priority.DATA_LOW, False, True, False)
SUMMARY = Topic("summary", "tandem-summary/{robot}", 1.0, 3.0, Priority.DATA_LOW, False, True, False)
"""`common.wire.summary`: what a list of robots shows. Who commands or opens a robot hears its state too.

Its keys do not begin as the others do. A session that lists N robots knows 2 N tokens below `tandem/`, and
Zenoh compares the key of a message that comes by a wildcard with each of them: 1000 robots cost 18 % of a
core in that place, and 7 % in a tree of their own."""
CALL = Topic("call", "tandem/{robot}/call", 0.0, 1.0, Priority.DATA, True, True, True)
"""A person at the robot asks for an operator, or does not need one any more (`common.wire.call`)."""
ALIVE = Topic("alive", "tandem/{robot}/alive", 0.0, 0.0, Priority.DATA, True, True, False)
VIDEO = Topic("video", "tandem/{robot}/video/head", 0.0, 0.0, Priority.BACKGROUND, False, True, False)
IN_ORDER = 8
"""Pictures, or frames of voice, that wait for a loop that is late: each may need the one before."""
KEYFRAME = Topic("keyframe", "tandem/{robot}/keyframe/head", 0.0, 0.0, Priority.DATA, True, True, False)
"""From who receives pictures: the camera's next one shall stand alone. The payload is `LOST` or `JOINED`."""
VOICE = Topic("voice", "tandem/{robot}/voice", 0.0, 0.0, Priority.DATA_LOW, False, True, True)
"""20 ms of whoever speaks at the robot. Neither recorder nor tap hears voice: nothing of it is kept."""
OPERATOR_VOICE = Topic(
    "operator_voice", "tandem/{robot}/operator/{operator}/voice", 0.0, 0.0, Priority.DATA_LOW, False,
    True, True,
)  # fmt: skip
"""As VOICE, on the operator's own key: only who holds the lease is heard at the robot."""
TRUTH = Topic("truth", "tandem/{robot}/test/truth", 200.0, 0.0, Priority.DATA, False, True, False)
FAULTS = Topic("faults", "tandem/{robot}/test/faults", 0.0, 1.0, Priority.DATA, True, True, False)

TOPICS = {
    t.name: t
    for t in (
        COMMAND, STATE, CONTROL, STOP, CLOCK, PATH, STATISTICS, SUMMARY, CALL, ALIVE, VIDEO,
        KEYFRAME, VOICE, OPERATOR_VOICE, TRUTH,
        FAULTS,
    )
}  # fmt: skip
QUESTIONS = (CONTROL.name, STOP.name, CLOCK.name, PATH.name, CALL.name, FAULTS.name)
"""Topics that are asked and answered; all others are published."""

VIDEO_NAME = r"^[A-Za-z0-9_-]{1,32}$"
"""What a camera may be called."""


def video(camera: str) -> Topic:
    """The pictures of one camera; its rate is whatever the link bears."""
    return replace(VIDEO, key=f"tandem/{{robot}}/video/{camera}")


LOST, JOINED = b"lost", b"joined"
"""Why a picture that stands alone is asked for: one before it was lost, or somebody has begun to look."""


def keyframe(camera: str) -> Topic:
    """Requests for a picture of one camera that stands alone."""
    return replace(KEYFRAME, key=f"tandem/{{robot}}/keyframe/{camera}")
