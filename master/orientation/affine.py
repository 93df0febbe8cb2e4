"""Calibration of the readings: the nodes' files (`sensor_calibration.py`), stacked and applied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.quaternion import IDENTITY, Array, normalise
from common.wire.messages import Mask

ACC, GYR, MAG = 0, 1, 2
"""Places of the three sensors along the first axis of `samples` (3, N, 3) and of all that goes with it."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """What all N nodes' files say, in node order."""

    affine: Array
    """(3, N, 3, 4): accelerometer, gyroscope, magnetometer."""
    q_sensor_from_segment: Array
    """(N, 4)."""
    alignment_made: Mask | None = None
    """(N,) nodes whose file records how the alignment was found; None: no node's."""

    @property
    def aligned(self) -> Mask:
        """(N,) nodes whose alignment is known: found, or at least not the identity."""
        askew: Mask = np.any(self.q_sensor_from_segment != IDENTITY, axis=-1)
        return askew if self.alignment_made is None else askew | self.alignment_made


def identity(count: int) -> Calibration:
    """Readings taken as they come, sensors aligned with their segments."""
    return _stack([NodeCalibration()] * count)


def load_calibration(paths: Sequence[Path | None]) -> Calibration:
    """Read the nodes' files; a node without one gets the identity.

    Raises ConfigError naming file, key, value and what was expected.
    """
    same = NodeCalibration()
    return _stack([same if path is None else load_config(path, NodeCalibration) for path in paths])


def _stack(nodes: list[NodeCalibration]) -> Calibration:
    return Calibration(
        affine=np.array(
            [
                [node.accelerometer for node in nodes],
                [node.gyroscope for node in nodes],
                [node.magnetometer for node in nodes],
            ]
        ),
        q_sensor_from_segment=normalise(np.array([node.q_sensor_from_segment for node in nodes])),
        alignment_made=np.array([node.made.alignment is not None for node in nodes], dtype=np.bool_),
    )


def apply(affine: Array, samples: Array) -> Array:
    """Calibrated samples (3, N, 3) of raw ones, for maps (3, N, 3, 4). NaN stays within its sensor."""
    out: Array = np.einsum("snij,snj->sni", affine[..., :3], samples)
    out += affine[..., 3]
    return out
