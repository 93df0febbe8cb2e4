"""Whether a magnetometer's axes are those of the gyroscope and the accelerometer beside it.

The gyroscope tells how the field must turn in the sensor (`carried.py`), up to the sign of all three axes at
once; gravity tells that sign, as the earth's field dips below the horizon in the north and rises above it in
the south.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from common.quaternion import Array
from master.calibrate.carried import AXES, Carried, axes_text, carried, confusion
from master.calibrate.evidence import CrossCheck, agrees, at_most, not_judged
from master.calibrate.recording import NodeRecording

Hemisphere = Literal["north", "south"]
_LEAST_DIP = float(np.sin(np.radians(5.0)))
"""Sine of the dip; nearer to the magnetic equator its sign tells nothing."""
_MOST_TURNED_DEG = 10.0
"""Axes further apart are no imperfection of a board."""
_WAYS = "magnetometer's axes against the gyroscope's turns"
_SIGN = "sign of the magnetic dip against the hemisphere"
_TURN = "turn the node about each of its axes, with gyroscope and accelerometer recorded"


def hemisphere_named(text: str) -> Hemisphere:
    """`north` or `south`. Raises ValueError."""
    if text == "north":
        return "north"
    if text == "south":
        return "south"
    raise ValueError(f"{text}: expected north or south")


def axes_matrix(text: str) -> Array:
    """`y,x,-z` as the signed permutation (3, 3) that takes readings to the node's axes. Raises ValueError."""
    words = [word.strip().lower() for word in text.split(",")]
    matrix = np.zeros((3, 3))
    places = [word.removeprefix("-").removeprefix("+") for word in words]
    if sorted(places) != list(AXES):
        raise ValueError("expected x, y and z once each, each with or without a minus, such as y,x,-z")
    for row, (word, place) in enumerate(zip(words, places, strict=True)):
        matrix[row, AXES.index(place)] = -1.0 if word.startswith("-") else 1.0
    if np.linalg.det(matrix) < 0.0:
        raise ValueError(
            f"{text} is a mirror image, which no sensor orientation can make; correct the driver's signs"
        )
    return matrix


def check_axes(recording: NodeRecording, field: Array, hemisphere: Hemisphere) -> list[CrossCheck]:
    """Compare calibrated magnetometer readings (T, 3), NaN where none are, with the other sensors."""
    found = carried(field, recording.gyr_rad_s, recording.rate_hz)
    if found is None or not found.known:
        return [not_judged(_WAYS, f"the recording does not decide; {_TURN}")]
    axes = found.axes if found.confused else np.eye(3)
    return [_handed(axes), _same_as_gravity(recording, found), *_signed(recording, field, found, hemisphere)]


def _handed(axes: Array) -> CrossCheck:
    compared = "handedness of the gyroscope against the magnetometer's"
    if np.linalg.det(axes) > 0.0:
        return agrees(compared, 0.0, 0.0)
    return at_most(
        compared,
        1.0,
        0.0,
        advice=f"the gyroscope turns against the field: {confusion(axes)} (a mirror image). "
        "Correct the signs in the gyroscope's driver, and record again",
    )


def _same_as_gravity(recording: NodeRecording, found: Carried) -> CrossCheck:
    compared = "gyroscope's axes against gravity's turns"
    gravity = carried(recording.acc_m_s2, recording.gyr_rad_s, recording.rate_hz)
    if gravity is None or not gravity.known:
        return not_judged(compared, f"the accelerometer does not decide; {_TURN}")
    wrong = gravity.confused and found.confused and np.array_equal(gravity.axes, found.axes)
    return at_most(
        compared,
        float(wrong),
        0.0,
        advice="gravity and the field turn alike, and the gyroscope otherwise: of the gyroscope, "
        f"{confusion(gravity.axes)}. Correct its axes in its driver; `calibrate imu` checks them",
    )


def _signed(
    recording: NodeRecording, field: Array, found: Carried, hemisphere: Hemisphere
) -> list[CrossCheck]:
    """By gravity, which of both possible maps it is: the axes found, or all of them negated."""
    rotation = found.axes if found.confused else np.eye(3)
    dip = _sine_of_dip(recording.acc_m_s2, field @ rotation)
    if dip is None or abs(dip) < _LEAST_DIP:
        why = "there is no gravity to compare with" if dip is None else "the field lies level here"
        if not found.confused:
            return [agrees(_WAYS, 0.0, 0.0), not_judged(_SIGN, f"{why}; all three axes may be negated")]
        return [_refused(f"{confusion(rotation)}, or that and all three negated ({why}); {_TURN}")]
    mirrored = (dip > 0.0) == (hemisphere == "north")
    return [
        _dip_sign(dip, hemisphere, mirrored and not found.confused),
        _square(found, rotation),
        *([_refused(_offer(rotation, hemisphere, mirrored))] if found.confused else []),
    ]


def _dip_sign(dip: float, hemisphere: Hemisphere, wrong: bool) -> CrossCheck:
    degrees = float(np.degrees(np.arcsin(dip)))
    other = "south" if hemisphere == "north" else "north"
    advice = (
        f"the field points {abs(degrees):.0f}° {'above' if dip > 0 else 'below'} the horizon, which "
        "is so in the "
        f"{other} only: there, say --hemisphere {other}. Otherwise all three axes of the magnetometer are "
        "negated (a mirror image): correct the signs in its driver, and record again"
    )
    return CrossCheck(_SIGN, degrees, 0.0, "°", "contradicts" if wrong else "agrees", advice if wrong else "")


def _square(found: Carried, rotation: Array) -> CrossCheck:
    degrees = float(np.degrees(_turned_by(found, rotation)))
    return at_most(
        _WAYS,
        degrees,
        _MOST_TURNED_DEG,
        "°",
        advice=f"the magnetometer is turned by {degrees:.0f}° against the gyroscope, and not by quarter "
        "turns alone; mount it square, or correct its axes in its driver",
    )


def _offer(rotation: Array, hemisphere: Hemisphere, mirrored: bool) -> str:
    if not mirrored:
        return (
            f"{confusion(rotation)}. If the chip is soldered so, accept it with "
            f"--axes={axes_text(rotation.T)}; otherwise correct its driver, and record again"
        )
    other = "south" if hemisphere == "north" else "north"
    return (
        f"{confusion(-rotation)}: a mirror image, which no sensor orientation can make. "
        "Correct the signs in its driver, and record again "
        f"(recorded in the {other}? Then say --hemisphere {other})"
    )


def _refused(what: str) -> CrossCheck:
    return at_most(_WAYS, 1.0, 0.0, advice=f"the magnetometer's axes are not the gyroscope's: {what}")


def _turned_by(found: Carried, axes: Array) -> float:
    """Angle between a proper signed permutation and the rotation nearest to the matrix found, rad."""
    u, _, v = np.linalg.svd(axes.T @ found.matrix)
    rotation = u @ v
    return float(np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0)))


def _sine_of_dip(acc: Array, field: Array) -> float | None:
    """Median over the recording of the field's part along gravity's upwards, -1 to 1."""
    size = np.linalg.norm(acc, axis=1) * np.linalg.norm(field, axis=1)
    usable = np.isfinite(size) & (size > 0.0)
    if not usable.any():
        return None
    return float(np.median(np.sum(acc * field, axis=1)[usable] / size[usable]))
