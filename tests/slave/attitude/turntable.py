"""A sensor's affine map from known attitudes (paper D, section 3: a levelled turntable with three scales).

Other than fits to a norm it also finds how the sensor is turned in the instrument's case, and so the axis.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array

UNKNOWNS = 4
"""Of each row: three factors and an offset."""
_WORST_CONDITION = 1e4


def fit_affine(readings: Array, truth: Array) -> Array:
    """The map (3, 4) with the least Σ ‖map · [reading, 1] - truth‖², of readings and truth (K ≥ 4, 3).

    Truth is the vector in the instrument's frame at that attitude: q⁻¹ of gravity, or of the field. Raises
    ValueError where the attitudes do not determine the map.
    """
    if len(readings) < UNKNOWNS:
        raise ValueError(
            f"{len(readings)} attitudes; at least {UNKNOWNS} are needed, of different inclination"
        )
    # in units of the readings' own spread, so that the condition is that of the attitudes alone
    scale = float(np.abs(readings).max()) or 1.0
    design = np.column_stack([readings / scale, np.ones(len(readings))])
    if np.linalg.cond(design) > _WORST_CONDITION:
        raise ValueError(
            "the attitudes are too much alike: turn the instrument to all sides, and upside down"
        )
    solved: Array = np.linalg.lstsq(design, truth, rcond=None)[0].T.astype(np.float64)
    solved[:, :3] /= scale
    return solved
