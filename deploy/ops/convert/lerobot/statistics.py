"""What LeRobot wants to know of every feature: extent, mean, spread, quantiles. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
Statistics = dict[str, list[object]]
"""By name: one number a dimension; of pictures nested as (3, 1, 1)."""


def of_rows(rows: Array) -> Statistics:
    """Of T rows, (T, D)."""
    values: Statistics = {
        "min": rows.min(axis=0).tolist(),
        "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(),
        "std": rows.std(axis=0).tolist(),
        "count": [len(rows)],
    }
    return values | {name: np.quantile(rows, share, axis=0).tolist() for name, share in QUANTILES.items()}


class PictureStatistics:
    """Of pictures, channel by channel, each value between 0 and 1. Every picture counts, by its histogram."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, 256), dtype=np.int64)
        self._pictures = 0

    def take(self, rgb: NDArray[np.uint8]) -> None:
        """One picture, (H, W, 3); every fourth pixel each way, as neighbours are alike."""
        few = rgb[::4, ::4]
        for channel in range(3):
            self._counts[channel] += np.bincount(few[..., channel].ravel(), minlength=256)
        self._pictures += 1

    def values(self) -> Statistics:
        """As `of_rows`, each (3, 1, 1); count is of pictures."""
        levels = np.arange(256) / 255.0
        share = self._counts / self._counts.sum(axis=1, keepdims=True)
        mean = share @ levels
        variance = np.maximum(share @ levels**2 - mean**2, 0.0)
        below = np.cumsum(share, axis=1)
        there = self._counts > 0

        def nested(numbers: Iterable[float]) -> list[object]:
            return [[[float(number)]] for number in numbers]

        found: Statistics = {
            "min": nested(levels[there.argmax(axis=1)]),
            "max": nested(levels[255 - there[:, ::-1].argmax(axis=1)]),
            "mean": nested(mean),
            "std": nested(np.sqrt(variance)),
            "count": [self._pictures],
        }
        quantiles = {
            name: nested(levels[(below >= share_).argmax(axis=1)]) for name, share_ in QUANTILES.items()
        }
        return found | quantiles


def of_columns(columns: Mapping[str, Sequence[float]]) -> dict[str, Statistics]:
    """Of columns of one number each."""
    return {name: of_rows(np.asarray(values, dtype=np.float64)[:, None]) for name, values in columns.items()}
