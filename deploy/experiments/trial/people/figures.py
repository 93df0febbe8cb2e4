"""How well clips were followed: error, roughness, overshoot, motion at standstill. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.experiments.trial.people.followed import TICK_S, Followed
from deploy.measure.roughness import CUTOFF_HZ, low_pass

SETTLE_S = 1.5
"""Left out at the beginning of a clip, and after the operator has stopped."""
MOVING_DEG = 5.0
"""A joint that moves less within a clip is not judged."""
POLE_DEG = 65.0
"""Beyond this shoulder roll the other two angles of a shoulder are not defined: left out, for all three."""
AROUND_S = 0.5
"""Overshoot: how far the robot is beyond all that the operator did from so long before to so long after."""


@dataclass(frozen=True, slots=True)
class PeopleFigures:
    """Over all judged joints and instants of some clips."""

    rmse_deg: float
    roughness: float
    overshoot_deg: float
    """99 % are below it."""
    largest_overshoot_deg: float
    unlimited_rmse_deg: float
    """If the robot's joints had no limits of speed and acceleration."""
    still_deg: float
    """RMS of the robot's motion about its mean while the operator stands still."""


def figures(clips: Iterable[Followed], shoulders: tuple[tuple[int, int, int], ...]) -> PeopleFigures:
    """Judge some clips together; `shoulders` are the columns of pitch, roll and yaw of each."""
    errors, unlimited, robots, operators, beyond, still = [], [], [], [], [], []
    for one in clips:
        moving, judged = slice(0, one.still), _judged(one, shoulders)
        truth, robot = one.truth_rad[moving], one.robot_rad[moving]
        errors.append((robot - truth)[judged])
        unlimited.append((one.unlimited_rad[moving] - truth)[judged])
        beyond.append(_beyond(truth, robot)[judged])
        robots.append(_acceleration(robot)[judged[1:-1]])
        operators.append(_acceleration(truth)[judged[1:-1]])
        rest = one.robot_rad[one.still + round(SETTLE_S / TICK_S) :]
        still.append((rest - rest.mean(axis=0)).ravel())
    over = np.degrees(np.concatenate(beyond))
    return PeopleFigures(
        rmse_deg=float(np.degrees(_rms(errors))),
        roughness=_rms(robots) / _rms(operators),
        overshoot_deg=float(np.percentile(over, 99.0)),
        largest_overshoot_deg=float(over.max()),
        unlimited_rmse_deg=float(np.degrees(_rms(unlimited))),
        still_deg=float(np.degrees(_rms(still))),
    )


def _judged(one: Followed, shoulders: tuple[tuple[int, int, int], ...]) -> Mask:
    """(T, J) of the moving part."""
    truth = one.truth_rad[: one.still]
    judged = np.tile(np.degrees(np.ptp(truth, axis=0)) > MOVING_DEG, (len(truth), 1))
    judged[: round(SETTLE_S / TICK_S)] = False
    for pitch, roll, yaw in shoulders:
        near = np.degrees(np.abs(truth[:, roll])) > POLE_DEG
        near = np.convolve(near, np.ones(81), "same") > 0.0
        judged[:, (pitch, roll, yaw)] &= ~near[:, None]
    return judged


def _beyond(truth: Array, robot: Array) -> Array:
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    window = 2 * round(AROUND_S / TICK_S) + 1
    highest, lowest = maximum_filter1d(truth, window, axis=0), minimum_filter1d(truth, window, axis=0)
    out: Array = np.maximum(np.maximum(robot - highest, lowest - robot), 0.0)
    return out


def _acceleration(position_rad: Array) -> Array:
    out: Array = np.diff(low_pass(position_rad, 1.0 / TICK_S, CUTOFF_HZ), n=2, axis=0) / TICK_S**2
    return out


def _rms(parts: list[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
