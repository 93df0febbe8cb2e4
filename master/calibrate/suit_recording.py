"""A suit's recording (`.mcap`) as the calibration takes it."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from master.calibrate.recording import NodeRecording
from master.suit.recorded import Sweeps, read_sweeps

log = logging.getLogger(__name__)


def load_suit(path: Path) -> dict[str, NodeRecording]:
    """Every node that answered at all, by segment; a file that was cut off is said. Raises RecordingError."""
    sweeps = read_sweeps(path)
    if sweeps.cut:
        log.warning("%s: %s; its first %.1f s are whole", path, sweeps.cut, sweeps.duration_s)
    nodes = split(sweeps)
    if not nodes:
        raise RecordingError(f"{path}: no node answered; check the bus and record again")
    return nodes


def split(sweeps: Sweeps) -> dict[str, NodeRecording]:
    """Recordings of the single nodes; those that never answered are left out."""
    nodes = {}
    for i, name in enumerate(sweeps.nodes):
        acc, gyr, mag = (sweeps.readings[:, i, k : k + 3].astype(np.float64) for k in (0, 3, 6))
        if np.isnan(gyr).all():
            log.warning("%s: never answered", name)
            continue
        nodes[name] = NodeRecording(name, sweeps.rate_hz, acc, gyr, None if np.isnan(mag).all() else mag)
    return nodes
