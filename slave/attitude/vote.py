"""Frames without a check sum, believed by their neighbours: of three in a row each angle's median. Pure.

A bit that flips on the wire turns one frame's angle into another, often one that looks sound. The median of
the newest three frames, angle by angle, lies within what the other two say: a single false frame shows no
more than that the instrument moved as it did. What then still moves faster than the base can is not told
before three frames agree on it.

How late this makes a true tilt: it is told with the second frame beyond a limit; after a turn
faster than `most_rad_s` with the third frame that agrees. Where frames go on contradicting each other nothing
new is told, and the age of what was told last holds the robot (`[guard] base_timeout_s`).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_S, to_s
from slave.attitude.angles import up_in_instrument
from slave.attitude.frame import FrameAngles, radians

FRAMES = 3
_TOGETHER_NS = NS_PER_S
"""Frames further apart than this say nothing of each other."""
_TURN = 3600
_RESOLUTION_RAD = math.radians(0.3)
"""Two frames of an instrument that stands differ by so much: rounding, and its own noise."""


@dataclass(frozen=True, slots=True)
class TimedFrame:
    """One frame and when it came."""

    angles: FrameAngles
    came_ns: int


class Vote:
    """Frames in as they come, frames that may be believed out."""

    def __init__(self, most_rad_s: float) -> None:
        """`most_rad_s`: the base cannot turn faster."""
        self._most_rad_s = most_rad_s
        self._window: deque[TimedFrame] = deque(maxlen=FRAMES)
        self._trusted: TimedFrame | None = None
        self.outvoted = 0
        """Frames that contradict their neighbours."""

    def hear(self, angles: FrameAngles, came_ns: int) -> TimedFrame | None:
        """The newest trusted frame after one more frame, or None; `came_ns` never falls."""
        window = self._window
        if window and came_ns - window[-1].came_ns > _TOGETHER_NS:
            window.clear()
        window.append(TimedFrame(angles, came_ns))
        if len(window) < FRAMES:
            return None
        # as old as the frame in the middle of the three
        chosen = TimedFrame(median(*(frame.angles for frame in window)), window[-2].came_ns)
        if not self._plausible(window[-1], chosen):
            self.outvoted += 1
        settled = all(self._plausible(a, b) for a in window for b in window)
        if self._trusted is not None and not settled and not self._plausible(self._trusted, chosen):
            return None
        self._trusted = chosen
        return chosen

    def _plausible(self, a: TimedFrame, b: TimedFrame) -> bool:
        # a longer time than the window's excuses no further turn: half a second would excuse any
        longest_ns = self._window[-1].came_ns - self._window[0].came_ns
        past_s = to_s(min(abs(b.came_ns - a.came_ns), longest_ns))
        return turn_rad(a.angles, b.angles) <= self._most_rad_s * past_s + _RESOLUTION_RAD


def turn_rad(a: FrameAngles, b: FrameAngles) -> float:
    """How far the instrument leaned over between two frames, at least: between the two directions of up."""
    if a.tool_face is None or b.tool_face is None:
        return abs(radians(a.inclination - b.inclination))
    one, other = (
        up_in_instrument(np.asarray(radians(f.inclination)), np.asarray(radians(f.tool_face or 0)))
        for f in (a, b)
    )
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def median(a: FrameAngles, b: FrameAngles, c: FrameAngles) -> FrameAngles:
    """Angle by angle."""
    inclination = sorted((a.inclination, b.inclination, c.inclination))[1]
    azimuth = _median_turn([a.azimuth, b.azimuth, c.azimuth])
    return FrameAngles(inclination, azimuth, _median_turn([a.tool_face, b.tool_face, c.tool_face]))


def _median_turn(three: list[int | None]) -> int | None:
    """The median of three angles on the circle, in tenths of a degree; None if two of them are None."""
    there = [angle for angle in three if angle is not None]
    if len(there) < 2:
        return None
    # the one with the least way to the others; of equal ones the newest
    return min(reversed(there), key=lambda angle: sum(_apart(angle, other) for other in there))


def _apart(a: int, b: int) -> int:
    way = (a - b) % _TURN
    return min(way, _TURN - way)
