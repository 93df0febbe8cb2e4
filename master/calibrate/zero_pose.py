"""When the person stood still in the zero pose."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from master.calibrate.hinge import PoorMotionError
from master.calibrate.still import runs

_STILL_RAD_S = 0.15
"""A person who stands still turns no segment faster; sway is a fifth of it."""
_LEAST_S = 1.0
_EDGE_S = 0.2
"""Left out at either end, where the movement begins."""
_LONGEST_S = 10.0


def find_zero_pose(gyr_rad_s: Array, rate_hz: float) -> slice:
    """The samples of the first stretch in which all units (N, T, 3) rest: people begin with the zero pose.

    Raises PoorMotionError where there is none.
    """
    norm = np.linalg.norm(gyr_rad_s, axis=2)
    width = max(1, round(0.2 * rate_hz))
    window = np.ones(width) / width
    smooth = np.stack([np.convolve(row, window, mode="same") for row in norm])
    edge = round(_EDGE_S * rate_hz)
    for begin, end in runs(np.max(smooth, axis=0) < _STILL_RAD_S).tolist():
        if end - begin >= (_LEAST_S + 2.0 * _EDGE_S) * rate_hz:
            return slice(begin + edge, min(end - edge, begin + edge + round(_LONGEST_S * rate_hz)))
    raise PoorMotionError(
        "no node stood still: begin with three seconds in the zero pose (arms hanging, palms to the thighs), "
        "or name the zero pose with --zero-pose FROM:TO"
    )


def given_zero_pose(from_s: float, to_s: float, samples: int, rate_hz: float) -> slice:
    """The samples between two times. Raises PoorMotionError where they are not in the recording."""
    begin, end = round(from_s * rate_hz), round(to_s * rate_hz)
    if not 0 <= begin < end <= samples or end - begin < 0.2 * rate_hz:
        raise PoorMotionError(
            f"zero pose from {from_s:g} to {to_s:g} s: not in the recording of {samples / rate_hz:.1f} s; "
            "expected FROM:TO in seconds, 0.2 s or longer"
        )
    return slice(begin, end)
