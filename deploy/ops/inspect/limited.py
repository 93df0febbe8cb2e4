"""For how long a limit held each joint back, from a robot's states. Pure."""

from __future__ import annotations

import numpy as np

from common.clock import to_s
from common.errors import CodecError
from common.recording import Entry
from common.wire.codec import decode
from common.wire.messages import RobotState

_LONGEST_S = 0.1
"""Between two states: a longer silence counts as this much."""


class LimitedJoints:
    """Takes a recording's messages in their order. Of states that tell nothing of it there is nothing."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._held_s = np.zeros(len(joints))
        self._before_ns: dict[str, int] = {}

    def take(self, entry: Entry) -> None:
        """One message. States of another profile are left out."""
        if entry.topic.rpartition("/")[2] != "state":
            return
        try:
            state = decode(entry.payload, RobotState, len(self._joints))
        except CodecError:
            return
        before_ns = self._before_ns.get(state.robot)
        self._before_ns[state.robot] = entry.monotonic_ns
        if before_ns is not None and state.clamped is not None:
            passed_s = min(_LONGEST_S, max(0.0, to_s(entry.monotonic_ns - before_ns)))
            self._held_s[state.clamped] += passed_s

    def seconds(self) -> dict[str, float]:
        """By joint, longest first; joints that were never held back are left out."""
        order = np.argsort(-self._held_s, kind="stable").tolist()
        return {self._joints[j]: round(float(self._held_s[j]), 3) for j in order if self._held_s[j] > 0.0}
