"""Whether the age of the operator's picture gives a reason to hold. Pure."""

from __future__ import annotations

from common.clock import to_ns, to_s
from slave.guard.config import GuardConfig

REMEDY = "repair the camera or its link, or restart the master: who has had no picture yet relies on none"
"""What a person does. A master that is restarted takes a new lease, and no picture counts as its own."""


def video_loss(captured_ns: int | None, now_ns: int, config: GuardConfig) -> str | None:
    """A text for why the operator does not see the robot, or None: for `Body.video`.

    `captured_ns`: when the newest picture was taken that came to the operator, as the commands say; None
    where none ever came, so that nobody relies on pictures. Both times are the slave's own clock.
    """
    if captured_ns is None or not config.max_video_age_s:
        return None
    # absolute: an own clock that went back must not keep an old picture fresh
    age_ns = abs(now_ns - captured_ns)
    if age_ns <= to_ns(config.max_video_age_s):
        return None
    words = f"the operator's newest picture is {to_s(age_ns):.1f} s old, limit {config.max_video_age_s:g} s"
    return f"{words}; {REMEDY}"
