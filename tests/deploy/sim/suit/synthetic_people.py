"""People-like motion made by code, in the form of the recording that stays out of the repository.

Of its statistics: speeds (RMS 30 to 100 °/s a joint), ω = RMS acceleration over RMS velocity (8 to 14 a
second), pauses, and joints that move together in bursts. Nobody's motion is in it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array

JOINTS = (
    "neck_yaw", "neck_pitch", "waist_pitch",
    *(f"{side}_{joint}" for side in ("left", "right") for joint in (
        "shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "elbow_roll", "wrist_yaw"
    )),
)  # fmt: skip
RATE_HZ = 100.0
SWING_HZ = (0.4, 3.5)


def motion(seed: int, seconds: float) -> Array:
    """(T, 15) rad: noise between the frequencies of people's swings, in bursts with pauses between."""
    random = np.random.default_rng(seed)
    count = round(seconds * RATE_HZ)
    hz = np.fft.rfftfreq(2 * count, 1.0 / RATE_HZ)
    # below the lowest swing as much as at it, above it falling as people's spectra do
    gain = np.where(hz > 0.1, 1.0 / (1.0 + (hz / 1.2) ** 3), 0.0) * (hz < SWING_HZ[1] * 2.0)
    spectrum = gain[:, None] * (random.standard_normal((len(hz), 15, 2)) @ np.array([1.0, 1.0j]))
    swing = np.fft.irfft(spectrum, axis=0)[:count]
    swing /= np.gradient(swing, 1.0 / RATE_HZ, axis=0).std(axis=0)
    time_s = np.arange(count) / RATE_HZ
    bursts = 0.5 + 0.5 * np.tanh(4.0 * np.sin(2.0 * np.pi * time_s / 3.7 + seed))
    speed = np.radians(random.uniform(40.0, 110.0, 15))
    offset = np.radians([0, 5, 15, 30, 25, 0, 60, 0, 0, 30, 25, 0, 60, 0, 0])
    out: Array = offset + speed * swing * bursts[:, None]
    return out


def write(path: Path, seconds: float = 6.0) -> Path:
    """A file of four people, two of them with the names of those on whom the prediction was tuned."""
    subjects = ("cmu01", "cmu02", "made1", "made2")
    arrays: dict[str, NDArray[np.generic]] = {
        f"c{n:03d}_position_rad": motion(n, seconds) for n in range(len(subjects))
    }
    arrays["joints"], arrays["subjects"] = np.array(JOINTS), np.array(subjects)
    arrays["labels"], arrays["rate_hz"] = np.array([f"{name}_1" for name in subjects]), np.array(RATE_HZ)
    np.savez(path, allow_pickle=False, **arrays)
    return path
