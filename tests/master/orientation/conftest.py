"""Real recordings, and readings that perfect sensors would give."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array

LoadRecording = Callable[[str], dict[str, Array]]


@pytest.fixture(scope="session")
def recording() -> LoadRecording:
    """Loads one of the recordings by name, as float64."""
    folder = os.environ.get("TANDEM_DATA")
    if not folder:
        pytest.skip("TANDEM_DATA does not name the folder of recordings")

    def load(name: str) -> dict[str, Array]:
        path = Path(folder) / f"{name}.npz"
        if not path.exists():
            pytest.skip(f"{path.name} is not in TANDEM_DATA")
        with np.load(path) as arrays:
            return {key: np.asarray(arrays[key], np.float64) for key in arrays if key != "version"}

    return load
