"""A base that stands level, or leans after a while, as simulated chips measure it; on any clock."""

from __future__ import annotations

import math

import numpy as np

from common.clock import NS_PER_S, Clock, monotonic_ns, to_ns
from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.quaternion import Array, from_axis_angle, multiply
from common.wire.messages import BaseAttitude
from slave.attitude.angles import orientation
from slave.attitude.base import Axis, base_attitude, less
from slave.attitude.config import BaseConfig
from slave.attitude.instrument import Instrument
from slave.attitude.simulated import Chips, readings

_PERIOD_NS = NS_PER_S // 50
"""The HMC5843's own fastest rate."""
_AZIMUTH = 0.5
"""Radians: where the base looks."""
_LEVEL: dict[Axis, Array] = {
    "ahead": orientation(np.asarray(0.5 * math.pi), np.asarray(_AZIMUTH), np.asarray(0.0)),
    "up": orientation(np.asarray(0.0), np.asarray(_AZIMUTH), np.asarray(0.0)),
}
"""q_world_from_instrument of a level base."""
_AHEAD: dict[Axis, Array] = {"ahead": np.array([0.0, 0.0, 1.0]), "up": np.array([0.0, 1.0, 0.0])}
"""The base's x in the instrument's coordinates: leaning turns about it."""


class SimulatedBase:
    """A `BaseSensor` without hardware; reading it takes the measurements that have fallen due."""

    def __init__(
        self, config: BaseConfig, clock: Clock = monotonic_ns, seed: int = 1, chips: Chips | None = None
    ) -> None:
        sound = None if config.calibration is None else load_config(config.calibration, NodeCalibration)
        self._config = config
        self._clock = clock
        self._rng = np.random.default_rng(seed)
        self._chips = chips or Chips()
        self._instrument = Instrument(sound, math.radians(config.declination_deg), config.time_constant_s)
        self._began_ns = clock()
        self._next_ns = self._began_ns
        self._taken = 0
        self._attitude: BaseAttitude | None = None
        level = _LEVEL[config.axis]
        # right-handed about ahead is to the right
        lean = from_axis_angle(_AHEAD[config.axis], math.radians(config.lean_deg))
        self._level, self._leaning = level, multiply(level, lean)

    def start(self) -> None:
        """Begin: the time until it leans counts from now."""
        self._began_ns = self._next_ns = self._clock()

    def read(self) -> BaseAttitude | None:
        """The newest measurement; takes one where one is due. Those that nobody asked for are left out."""
        now_ns = self._clock()
        if now_ns >= self._next_ns:
            self._next_ns = now_ns - (now_ns - self._next_ns) % _PERIOD_NS + _PERIOD_NS
            self._measure(now_ns)
        return self._attitude

    def counters(self) -> dict[str, int]:
        """Measurements taken."""
        return {"measurements": self._taken}

    def stop(self) -> None:
        """Nothing to let go of."""

    def _measure(self, now_ns: int) -> None:
        leans = now_ns - self._began_ns >= to_ns(self._config.lean_after_s)
        acc, mag = readings(self._leaning if leans else self._level, self._rng, self._chips)
        found = self._instrument.update(acc, mag, now_ns)
        self._taken += 1
        if found is not None:
            self._attitude = base_attitude(
                now_ns,
                found.inclination_rad,
                found.azimuth_rad,
                less(found.tool_face_rad, math.radians(self._config.level_tool_face_deg)),
                self._config.axis,
                self._instrument.quick_up,
            )
