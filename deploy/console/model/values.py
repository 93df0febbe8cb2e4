"""Numbers as JSON has them: rounded, and null where they are not known. Pure."""

from __future__ import annotations

import math

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask


def rounded(values: Array, valid: Mask | None = None, digits: int = 4) -> list[float | None]:
    """Values (J,) rounded; None where one is not finite or not valid."""
    known = np.isfinite(values) if valid is None else np.isfinite(values) & valid
    pairs = zip(np.round(values, digits).tolist(), known.tolist(), strict=True)
    return [value if there else None for value, there in pairs]


def ms(nanoseconds: float | None, digits: int = 2) -> float | None:
    """Nanoseconds as ms, rounded."""
    return None if nanoseconds is None else round(nanoseconds / 1e6, digits)


def number(value: float | None, digits: int = 3) -> float | None:
    """One number, rounded; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else round(value, digits)
