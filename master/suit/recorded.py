"""One sweep of the suit as the message that a recording keeps of it."""

from __future__ import annotations

import numpy as np

from common.recording.sweeps import encode_readings
from master.suit.sweep import Sweep


def encode_sweep(sweep: Sweep) -> bytes:
    """One tick's message of the topic `suit/readings`."""
    readings = np.concatenate([sweep.acc_m_s2, sweep.gyr_rad_s, sweep.mag_ut], axis=1)
    return encode_readings(sweep.tick, sweep.fresh, readings)
