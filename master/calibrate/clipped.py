"""Readings at the ends of a sensor's range, found by their look: the largest value again and again."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

_RUN = 2
"""So many equal largest readings in a row are no coincidence while the reading is noisy."""
_SAME = 1e-6
"""Relative difference up to which two readings are the same: a recording in single precision."""


def clipped(samples: Array, least: float, run: int = _RUN) -> Mask:
    """Which of the readings (T, 3) stand at an end of their axis's range, (T,).

    An end beyond `least` is one where the extreme value comes in a `run`: what a converter limits is flat,
    what a person moves is a peak. Missing readings are not clipped.
    """
    out = np.zeros(len(samples), dtype=np.bool_)
    for values in samples.T:
        if not np.isfinite(values).any():
            continue
        for end in (float(np.nanmax(values)), float(np.nanmin(values))):
            if abs(end) < least:
                continue
            at = np.abs(values - end) <= _SAME * abs(end)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(np.int8), [0]]))).reshape(-1, 2)
            for begin, stop in edges[edges[:, 1] - edges[:, 0] >= run]:
                out[begin:stop] = True
    return out


def range_ends(samples: Array, where: Mask) -> str:
    """The axes that were clipped and at which value, for a message."""
    said = []
    for name, values in zip("xyz", samples.T, strict=True):
        if not where.any() or not np.isfinite(values).any():
            continue
        for end in (float(np.nanmax(values)), float(np.nanmin(values))):
            at = np.abs(values - end) <= _SAME * abs(end)
            if int((at & where).sum()) >= _RUN:
                said.append(f"{name} at {end:.4g}")
    return ", ".join(said)
