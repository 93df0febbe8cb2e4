"""The operator takes the zero pose again: asked for, counted down, taken or refused.

From the moment of asking no joint is valid and the doubt says why, so the slave's guard holds and refuses to
engage. Afterwards it moves only after somebody has engaged, as after every hold.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from common.clock import to_ns, to_s
from common.metrics.master import ZeroPoseTaken
from common.quaternion import Array
from master.comfort.config import ZeroPoseAgainConfig
from master.orientation.estimator import Estimator
from master.orientation.zero_pose_again import ZeroPoseAgain, spread_deg

_NAMED_DEG = 5.0
"""A heading that moved farther than this from the suit's is named to the operator."""
ENGAGE = "engage when you are ready"


class Phase(StrEnum):
    """What the operator does."""

    IDLE = "idle"
    COUNTDOWN = "countdown"
    STANDING = "standing"


class ZeroPoseConduct:
    """What is said to the operator, and when the estimator takes the pose. `now_ns` is the master's clock."""

    def __init__(self, config: ZeroPoseAgainConfig, estimator: Estimator, segments: tuple[str, ...]) -> None:
        self._config = config
        self._estimator = estimator
        self._segments = segments
        self.phase = Phase.IDLE
        self._since_ns = 0
        self._said_s = 0
        self._again: ZeroPoseAgain | None = None
        self._lines: list[str] = []
        self._refused_words = ""
        self.taken = self.refused = 0
        self.moved_deg: Array = np.zeros(len(segments))
        """(N,) how far each heading had moved apart from the suit's, when the pose was last taken again."""

    @property
    def hold(self) -> str:
        """Why the robot must hold, in words; empty where it need not."""
        return "" if self.phase is Phase.IDLE else "the operator takes the zero pose again"

    def ask(self, by: str, now_ns: int) -> None:
        """Begin, by a tap or a key; in the countdown: call it off."""
        if self.phase is Phase.COUNTDOWN:
            self._end(f"zero pose called off ({by}): the old one stays; {ENGAGE}")
        elif self.phase is Phase.IDLE and not self._estimator.has_zero_pose:
            self._lines.append(f"zero pose ({by}): not every node that is heard has taken its first one yet")
        elif self.phase is Phase.IDLE:
            self.phase, self._since_ns = Phase.COUNTDOWN, now_ns
            self._said_s = math.ceil(self._config.countdown_s)
            self._lines.append(
                f"zero pose again ({by}): the robot holds; stand upright, arms hanging, in {self._said_s} s"
            )

    def step(self, now_ns: int) -> list[str]:
        """Go on; what to say to the operator now, each line with a sound."""
        if self.phase is Phase.COUNTDOWN:
            self._count_down(now_ns)
        elif self.phase is Phase.STANDING:
            self._stand(now_ns)
        lines, self._lines = self._lines, []
        return lines

    def metrics(self) -> ZeroPoseTaken:
        """How often, and what it found."""
        return ZeroPoseTaken(self.taken, self.refused, self._refused_words, self._moved())

    def _count_down(self, now_ns: int) -> None:
        left_s = self._config.countdown_s - to_s(now_ns - self._since_ns)
        if left_s <= 0.0:
            self.phase, self._since_ns = Phase.STANDING, now_ns
            self._again = self._estimator.stand_again()
            self._lines.append("zero pose: stand still now")
        elif math.ceil(left_s) < self._said_s:
            self._said_s = math.ceil(left_s)
            self._lines.append(f"zero pose in {self._said_s} s")

    def _stand(self, now_ns: int) -> None:
        again = self._again
        assert again is not None
        if again.taken.any():
            self.taken += 1
            self.moved_deg = np.where(again.taken, self._apart(again), 0.0)
            moved = [f"{name} by {deg:+.0f}°" for name, deg in self._moved().items() if abs(deg) > _NAMED_DEG]
            found = f"; headings had moved: {', '.join(moved)}" if moved else ""
            self._refused_words = ""
            self._end(f"zero pose taken{found}; {ENGAGE}")
        elif now_ns - self._since_ns > to_ns(self._config.give_up_s):
            self.refused += 1
            self._refused_words = again.words(self._segments) or "no node stood still for long enough"
            self._end(f"zero pose refused: {self._refused_words}: the old one stays; ask again, or {ENGAGE}")

    def _apart(self, again: ZeroPoseAgain) -> Array:
        out = np.zeros(len(self._segments))
        out[again.taken] = spread_deg(again.moved_rad[again.taken])
        return out

    def _moved(self) -> dict[str, float]:
        return {
            name: round(float(deg), 1)
            for name, deg in zip(self._segments, self.moved_deg, strict=True)
            if abs(deg) >= 1.0
        }

    def _end(self, line: str) -> None:
        self._estimator.drop_again()
        self.phase, self._again = Phase.IDLE, None
        self._lines.append(line)
