"""Whether each drive's own angle and its joint's output encoder agree. Always compared. Pure.

The two see one joint from both ends of its gear. A wrong zero, gear ratio, direction or lost turn of the
drive, an encoder that is stuck, and a gear that slips all show as a difference, before anything has moved or
as soon as it does. Which of the two is wrong cannot be known here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask

WINDOW_RAD = math.radians(2.0)
"""Gears' play, an encoder's own error (AS5045: ±1.4° with its magnet askew) and its resolution."""
READINGS = 2
"""One reading that disagrees is forgiven: a bit may flip on its way from the encoder to the drive."""


class EncoderAgreement:
    """Compares the two angles of J joints. Give it each reading once."""

    def __init__(self, joint_names: Sequence[str], window_rad: float = WINDOW_RAD) -> None:
        self._names = tuple(joint_names)
        self._window_rad = window_rad
        self._apart: NDArray[np.int64] = np.zeros(len(joint_names), np.int64)
        self.words: dict[str, str] = {}
        """A text for each joint whose two angles differ now; empty if all agree."""

    def judge(self, drive_rad: Array, encoder_rad: Array, heard: Mask) -> Mask:
        """(J,) whose angles (J,) differ, of joints whose angles are both `heard`; others stay as judged."""
        apart = ~(np.abs(drive_rad - encoder_rad) <= self._window_rad)
        self._apart = np.where(heard, np.where(apart, self._apart + 1, 0), self._apart)
        out: Mask = self._apart >= READINGS
        if out.any():
            self.words = {
                self._names[j]: differ(float(drive_rad[j]), float(encoder_rad[j]))
                for j in np.flatnonzero(out).tolist()
            }
        elif self.words:
            self.words = {}
        return out


def differ(drive_rad: float, encoder_rad: float) -> str:
    """What is wrong with a joint whose two angles differ."""
    return (
        f"its drive reads {math.degrees(drive_rad):.1f}°, "
        f"its output encoder {math.degrees(encoder_rad):.1f}°: "
        "check the drive's zero, gear ratio, direction and turns, and the encoder"
    )
