"""Calibrating as people do it: all units lie in one rigid tray, which a pair of hands turns.

First from one attitude to the next, resting in each; then tumbling about with hardly a rest; then again from
the start. No joint can bring a worn unit into twenty well-spread attitudes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from common.config.section import Section
from common.quaternion import (
    Array,
    conjugate,
    from_rotation_vector,
    multiply,
    rotate,
    to_rotation_vector,
)
from deploy.sim.suit.sensors import CHANNELS, GRAVITY_M_S2

PITCH_M = 0.04
"""From one unit to the next in the tray."""
_EASY_RATE_RAD_S = 1.5
"""Mean rate of a turn by hand."""
_SHORTEST_TURN_S = 0.6


class TrayConfig(Section):
    """`[tray]`: how the simulated operator handles the tray (motions `tray` and `calibration`)."""

    attitudes: int = Field(default=26, ge=1, le=200)
    """Rests, each with another direction up."""
    still_s: float = Field(default=5.0, gt=0.0, le=60.0)
    """Length of a rest."""
    tumble_s: float = Field(default=90.0, ge=0.0, le=600.0)
    """How long it is tumbled about afterwards."""


class Tray:
    """Motion of the tray: rotations about fixed axes, each of minimum jerk, from rest to rest."""

    def __init__(self, config: TrayConfig, units: int, seed: int = 0) -> None:
        """`units` lie in rows; the same seed turns it the same way."""
        random = np.random.default_rng([seed, 3])
        side = math.ceil(math.sqrt(units))
        place = np.arange(units)
        self._lever_m = PITCH_M * np.stack(
            [place % side - 0.5 * (side - 1), place // side - 0.5 * (side - 1), np.zeros(units)], axis=1
        )
        rests = _spread(config.attitudes, random)
        begins: list[float] = []
        lasts: list[float] = []
        froms: list[Array] = []
        turns: list[Array] = []
        now_s = 0.0
        at = rests[0]
        for to in (*rests[1:], *_tumbles(config.tumble_s, random), rests[0]):
            # a rest comes before each of the turns between attitudes
            now_s += config.still_s if len(begins) < config.attitudes else 0.0
            turn = to_rotation_vector(multiply(conjugate(at), to))
            lasts.append(max(_SHORTEST_TURN_S, float(np.linalg.norm(turn)) / _EASY_RATE_RAD_S))
            begins.append(now_s)
            froms.append(at)
            turns.append(turn)
            now_s += lasts[-1]
            at = to
        self.period_s = now_s
        self._begin_s, self._last_s = np.array(begins), np.array(lasts)
        self._from, self._turn = np.array(froms), np.array(turns)

    def readings(self, t_s: float, field_ut: Array) -> Array:
        """What perfect units in the tray read, (N, 9), in a field (3,) of the world."""
        t = t_s % self.period_s
        k = max(int(np.searchsorted(self._begin_s, t, side="right")) - 1, 0)
        duration, turn = self._last_s[k], self._turn[k]
        u = min(max((t - self._begin_s[k]) / duration, 0.0), 1.0)
        rest = 1.0 - u
        share = u**3 * (10.0 + u * (6.0 * u - 15.0))
        rate = turn * (30.0 * (u * rest) ** 2 / duration)
        rate_change = turn * (60.0 * u * rest * (rest - u) / duration**2)
        q_sensor_from_world = conjugate(multiply(self._from[k], from_rotation_vector(share * turn)))
        out = np.empty((len(self._lever_m), CHANNELS))
        # the axis is fixed in the tray as in the world, so all of it can be said in the tray's frame
        out[:, 0:3] = np.cross(rate_change, self._lever_m) + np.cross(rate, np.cross(rate, self._lever_m))
        out[:, 0:3] += rotate(q_sensor_from_world, np.array([0.0, 0.0, GRAVITY_M_S2]))
        out[:, 3:6] = rate
        out[:, 6:9] = rotate(q_sensor_from_world, field_ut)
        return out


def _spread(count: int, random: np.random.Generator) -> Array:
    """Attitudes (count, 4) whose directions up lie evenly over the sphere (a Fibonacci spiral), mixed up.

    The first lies flat. The turn about the vertical is left to chance.
    """
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    azimuth = k * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    up = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)
    up[1:] = random.permutation(up[1:])
    return np.array([_with_up(direction, random.uniform(0.0, 2.0 * math.pi)) for direction in up])


def _with_up(direction: Array, yaw_rad: float) -> Array:
    """A tray in which the world's up points to `direction`."""
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(direction[2]))
    tilt = from_rotation_vector(axis / sine * angle if sine > 1e-9 else np.array([angle, 0.0, 0.0]))
    out: Array = multiply(from_rotation_vector(np.array([0.0, 0.0, yaw_rad])), tilt)
    return out


def _tumbles(duration_s: float, random: np.random.Generator) -> NDArray[np.float64]:
    """Attitudes at random, as many as are passed in that time."""
    mean_s = 2.2 / _EASY_RATE_RAD_S  # a random rotation turns by 126° on average
    q = random.standard_normal((round(duration_s / mean_s), 4))
    out: Array = q / np.linalg.norm(q, axis=1, keepdims=True)
    return out
