"""Whether the base's attitude sensor gives a reason to hold."""

from __future__ import annotations

import math

from common.clock import to_ns, to_s
from common.wire.messages import BaseAttitude
from slave.guard.config import GuardConfig


def base_loss(attitude: BaseAttitude | None, now_ns: int, config: GuardConfig) -> str | None:
    """A text for why the base's attitude forbids motion, or None: for `Body.base`.

    Silence is doubt, and so is an attitude from the future or one that is no number. Where no sensor is
    configured do not ask.
    """
    if attitude is None:
        return "the base's sensor has not answered yet"
    age_ns = abs(now_ns - attitude.measured_ns)
    if age_ns > to_ns(config.base_timeout_s):
        return f"the base's sensor is silent for {to_s(age_ns):.2f} s"
    tilt_deg = math.degrees(attitude.tilt_rad)
    # written so that a NaN is refused
    if abs(tilt_deg) <= config.max_tilt_deg:
        return None
    return f"the base tilts by {tilt_deg:.1f}°, limit {config.max_tilt_deg:g}°"
