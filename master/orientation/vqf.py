"""VQF (Laidig and Seel, Information Fusion 91, 2023) behind the filters' interface: one object a node."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from common.quaternion import Array
from common.wire.messages import Mask
from master.orientation.front import BehindFront, Front, FrontLimits, FrontSection

if TYPE_CHECKING:
    from vqf import VQF

_REACH_RAD_S = np.radians(1.9)
"""Just below the package's `biasClip` of 2 °/s, beyond which it takes no rest for one."""
_BIAS_TICKS = 16
"""From one look at the biases to the next, where they only weigh what a period lacks or has too much."""


class VqfConfig(FrontSection):
    """`[estimation.vqf]`."""

    tau_acc_s: float = Field(default=3.0, gt=0.0, allow_inf_nan=False)
    """Time constant with which the accelerometer corrects the inclination."""
    tau_mag_s: float = Field(default=9.0, gt=0.0, allow_inf_nan=False)
    """Time constant with which the magnetometer corrects the heading."""
    motion_bias: bool = True
    """Estimate the gyro's bias in motion too."""
    rest_bias: bool = True
    """Estimate the gyro's bias at rest."""
    reject_disturbed_field: bool = True
    """Leave out a magnetic field whose strength or dip is not the usual one."""

    def make(self, rate_hz: float, count: int) -> VqfFilter:
        """The filter for `count` nodes."""
        return VqfFilter(self, rate_hz, count)


class VqfFilter(BehindFront):
    """An `OrientationFilter` of n `vqf.VQF` objects (C++, about 1 µs an update).

    The package knows one period only. An update of another `dt_s` turns by the true angle, the bias
    included, but counts as one period in every time constant: at half the rate all of them last twice as
    long, and after one long gap nothing is made good but the turn.
    """

    def __init__(self, config: VqfConfig, rate_hz: float, count: int) -> None:
        """Raises ModuleNotFoundError without the package, which has no wheels for aarch64 nor Python 3.14."""
        from vqf import VQF

        self._period_s = 1.0 / rate_hz
        limit_deg_s = config.rest_bias_limit_deg_s if config.rest_bias else 0.0
        field_change = config.field_change if config.reject_disturbed_field else 0.0
        limits = FrontLimits(limit_deg_s, float(_REACH_RAD_S), field_change)
        self._bias_rad_s: Array = np.zeros((count, 3))
        self._bias_age = _BIAS_TICKS
        self._front = Front(limits, rate_hz, count, self.q_inertial_from_sensor)
        self._filters = [
            VQF(
                1.0 / rate_hz,
                tauAcc=config.tau_acc_s,
                tauMag=config.tau_mag_s,
                motionBiasEstEnabled=config.motion_bias,
                restBiasEstEnabled=config.rest_bias,
                magDistRejectionEnabled=config.reject_disturbed_field,
            )
            for _ in range(count)
        ]
        self._update_all = _together(self._filters)

    def update(self, gyr_rad_s: Array, acc_m_s2: Array, mag_ut: Array, dt_s: float | None = None) -> None:
        """One tick's readings, (n, 3) each."""
        gyr_rad_s, acc_m_s2, mag_ut = self._front.take(gyr_rad_s, acc_m_s2, mag_ut, dt_s)
        if self._front.corrected is not None:
            self._begin_at_rest(self._front.corrected)
        if dt_s is not None and dt_s != self._period_s:
            bias = self._lately_rad_s()
            # the package takes the bias off again: (gyr' - bias) period = (gyr - bias) dt
            gyr_rad_s = bias + (gyr_rad_s - bias) * (dt_s / self._period_s)
        if self._front.everybody:
            self._update_all(gyr_rad_s, acc_m_s2, mag_ut)
            return
        magnetic = self._front.magnetic.tolist()
        rows = zip(self._filters, gyr_rad_s, acc_m_s2, mag_ut, magnetic, strict=True)
        for vqf, gyr, acc, mag, nine_axis in rows:
            if nine_axis:
                vqf.update(gyr, acc, mag)
            else:
                vqf.update(gyr, acc)

    def q_world_from_sensor(self) -> Array:
        """Orientations (n, 4); VQF's nine-axis answer is its six-axis one until a magnetometer speaks."""
        return np.concatenate([vqf.getQuat9D() for vqf in self._filters]).reshape(-1, 4)

    def q_inertial_from_sensor(self) -> Array:
        """Orientations (n, 4) without the magnetometer, VQF's six-axis answer."""
        return np.concatenate([vqf.getQuat6D() for vqf in self._filters]).reshape(-1, 4)

    def bias_rad_s(self) -> Array:
        """Gyro biases (n, 3)."""
        return self._front.with_offset(self._own_bias_rad_s())

    def _own_bias_rad_s(self) -> Array:
        return np.concatenate([vqf.getBiasEstimate()[0] for vqf in self._filters]).reshape(-1, 3)

    def _lately_rad_s(self) -> Array:
        """The biases (n, 3) of the last few updates: they creep, and to ask each filter takes 15 µs."""
        self._bias_age += 1
        if self._bias_age >= _BIAS_TICKS:
            self._bias_rad_s, self._bias_age = self._own_bias_rad_s(), 0
        return self._bias_rad_s

    def _begin_at_rest(self, nodes: Mask) -> None:
        """Let gravity and field set the orientation anew, by which a gross bias has dragged it.

        Without a field the heading goes on from where it is.
        """
        self._bias_age = _BIAS_TICKS
        for i in np.flatnonzero(nodes):
            vqf = self._filters[i]
            kept = vqf.state["gyrQuat"], vqf.state["accQuat"], vqf.state["delta"]
            vqf.resetState()
            state = vqf.state
            state["gyrQuat"], state["accQuat"], state["delta"] = kept
            vqf.state = state

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (n,)."""
        self._bias_age = _BIAS_TICKS
        self._front.restart(nodes)
        for i in np.flatnonzero(nodes):
            self._filters[i].resetState()


def _together(filters: Sequence[VQF]) -> Callable[[Array, Array, Array], None]:
    """Updates n filters with one tick's readings, (n, 3) each.

    The filters' rows are made once, and the readings copied into them: 108 rows made anew each tick took a
    fifth of the update. A partial function, as what it holds is no memory of the filters that a recording
    needs, and as a copy of the filters must not share it (`deploy/sim/world/copy.py`).
    """
    samples = np.empty((3, len(filters), 3))
    return partial(_update, samples, list(zip(filters, *samples, strict=True)))


def _update(
    samples: Array,
    rows: Sequence[tuple[VQF, Array, Array, Array]],
    gyr_rad_s: Array,
    acc_m_s2: Array,
    mag_ut: Array,
) -> None:
    samples[0], samples[1], samples[2] = gyr_rad_s, acc_m_s2, mag_ut
    for vqf, gyr, acc, mag in rows:
        vqf.update(gyr, acc, mag)
