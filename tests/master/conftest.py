"""What a person's joints can do, and real recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array

Range = tuple[float, float]


@pytest.fixture(scope="session")
def possible_deg() -> Mapping[str, Range]:
    """Each kind of joint's range.

    The zero is the zero pose of a person at ease: elbows hang bent by some 15°, and are that far beyond when
    they are straight.
    """
    return {
        "neck_yaw": (-80, 80),
        "neck_pitch": (-60, 60),
        "waist_pitch": (-20, 90),
        "shoulder_pitch": (-60, 180),
        "shoulder_roll": (-20, 120),
        "shoulder_yaw": (-90, 90),
        "elbow_pitch": (-18, 150),
        "elbow_roll": (-100, 100),
        "wrist_yaw": (-60, 60),
        "hip_flexion": (-30, 125),
        "hip_abduction": (-30, 50),
        "hip_rotation": (-50, 50),
        "knee_flexion": (-12, 150),
        "ankle_flexion": (-55, 40),
    }


@pytest.fixture(scope="session")
def fastest_deg_s() -> Mapping[str, float]:
    """A step's swing bends a knee at up to 700°/s, and a throw an elbow faster; nothing here is thrown.

    The thigh's skin turns its unit faster still as a heel strikes, which is rotation of the hip.
    """
    return {"hip_rotation": 1500.0} | dict.fromkeys(
        ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "elbow_roll", "wrist_yaw")
        + ("neck_yaw", "neck_pitch", "waist_pitch")
        + ("hip_flexion", "hip_abduction", "knee_flexion", "ankle_flexion"),
        900.0,
    )


LoadRecording = Callable[[str], dict[str, Array]]


@pytest.fixture(scope="session")
def recording(recordings_folder: Path) -> LoadRecording:
    """Loads one of the recordings by name, as float64."""

    def load(name: str) -> dict[str, Array]:
        path = recordings_folder / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{path.name} is not in TANDEM_DATA")
        with np.load(path) as arrays:
            return {key: np.asarray(arrays[key], np.float64) for key in arrays if key != "version"}

    return load
