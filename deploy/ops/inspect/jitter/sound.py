"""Leaves out what was not valid: channels that hardly ever were, and instants at which others were not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.ops.inspect.jitter.bands import Signal

MOSTLY = 0.9
"""Share of the time for which a channel must be valid to be judged."""


def sound(
    stage: str,
    channels: Sequence[str],
    time_s: Array,
    angle_rad: Array,
    valid: Mask,
    between: Signal | None = None,
) -> Signal | None:
    """A stage of what was valid: `angle_rad` (T, C) or (T, C, axes), `valid` (T, C). None: nothing was."""
    known = valid & np.isfinite(angle_rad.reshape(*valid.shape, -1)).all(axis=-1)
    some = known.any(axis=1)  # settling, or not followed at all
    if some.sum() < 2:
        return None
    kept = known[some].mean(axis=0) >= MOSTLY
    rows = some & known[:, kept].all(axis=1)
    if not kept.any() or rows.sum() < 2:
        return None
    axes = 1 if angle_rad.ndim == valid.ndim else angle_rad.shape[-1]
    names = tuple(name for name, keep in zip(channels, kept, strict=True) if keep for _ in range(axes))
    angles = angle_rad[rows][:, kept].reshape(int(rows.sum()), -1)
    return Signal(stage, names, time_s[rows], angles, between)
