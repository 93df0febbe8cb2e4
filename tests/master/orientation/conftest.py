"""Real recordings, and readings that perfect sensors would give."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array

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
