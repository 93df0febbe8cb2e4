"""What is said of a sensor that cannot be right."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.wire.messages import Mask


def frozen_words(counts: Array, repeats: Mask) -> str:
    """Of a sensor that repeats one reading, counts (6,); `repeats` (2,): accelerometer, gyro."""
    which = {(True, True): "", (True, False): "its accelerometer ", (False, True): "its gyroscope "}
    part = which[bool(repeats[0]), bool(repeats[1])]
    reported = np.rint(np.concatenate([counts[3 * k : 3 * k + 3] for k in range(2) if repeats[k]]))
    if (reported == 0.0).all():
        return f"{part}reads zero on every axis: no power, asleep or just reset"
    if (reported == -1.0).all():
        return f"{part}reads all ones (-1 on every axis): nothing drives its sensor's bus"
    if (np.abs(reported) >= 32767.0).all():
        return f"{part}is saturated on every axis"
    return f"{part}is frozen: repeats one reading; its sensor or the bus to it hangs"


_LETTERS = "xyz"


def letters_of(axes: NDArray[np.intp]) -> str:
    """Axes of one sensor, with their verb."""
    return " and ".join(_LETTERS[axis] for axis in axes) + (" is" if len(axes) == 1 else " are")


def axes_of(axes: NDArray[np.intp]) -> str:
    """Axes of accelerometer and gyro, 0 to 5, with their verb."""
    names = [f"{'gyroscope' if axis > 2 else 'accelerometer'} {_LETTERS[axis % 3]}" for axis in axes]
    return " and ".join(names) + (" is" if len(axes) == 1 else " are")


def values_of(readings: Array, axes: Sequence[int] | NDArray[np.intp]) -> str:
    """What they read."""
    return " and ".join(
        f"{math.degrees(readings[axis]):.1f} °/s" if axis > 2 else f"{readings[axis]:.2f} m/s²"
        for axis in axes
    )
