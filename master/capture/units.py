"""Units as DBC files spell them, and their factors to tandem's own. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

G_M_S2 = 9.80665
_DEG = math.radians(1.0)
EARTHS_FIELD_UT = 50.0
"""µT of one arbitrary unit: a normalised magnetometer reads 1 in the earth's field."""

FACTORS: Mapping[str, Mapping[str, float]] = {
    "accelerometer": {"m/s^2": 1.0, "g": G_M_S2, "mg": 1e-3 * G_M_S2},
    "gyroscope": {"rad/s": 1.0, "deg/s": _DEG, "mdeg/s": 1e-3 * _DEG},
    "magnetometer": {
        "uT": 1.0, "nT": 1e-3, "mT": 1e3, "T": 1e6, "gauss": 100.0, "mgauss": 0.1, "a.u.": EARTHS_FIELD_UT,
    },
    "angle": {"rad": 1.0, "deg": _DEG},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}  # fmt: skip
"""By quantity, the factor of each unit to m/s², rad/s, µT, rad and s."""

_SPELT: Mapping[str, str] = {
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "ms^-2": "m/s^2", "m/s**2": "m/s^2",
    "m/sec^2": "m/s^2",
    "°/s": "deg/s", "dps": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s", "deg/sec": "deg/s",
    "mdps": "mdeg/s", "rad/sec": "rad/s", "rps": "rad/s",
    "µT": "uT", "μT": "uT", "microtesla": "uT", "mGauss": "mgauss", "mGs": "mgauss", "Gauss": "gauss",
    "Gs": "gauss", "au": "a.u.", "a.u": "a.u.", "°": "deg", "degree": "deg", "degrees": "deg",
    "sec": "s", "µs": "us", "μs": "us", "msec": "ms", "usec": "us",
}  # fmt: skip
"""Other spellings."""
_BY_QUANTITY = {("accelerometer", "G"): "g", ("magnetometer", "G"): "gauss", ("magnetometer", "mG"): "mgauss"}


def known_unit(quantity: str, text: str) -> str | None:
    """The unit that a DBC or a person has written, by tandem's own name; None where it is not one."""
    text = text.strip()
    name = _BY_QUANTITY.get((quantity, text)) or _SPELT.get(text, text)
    return name if name in FACTORS[quantity] else None


def names(quantity: str) -> str:
    """The units of a quantity, for messages."""
    return ", ".join(FACTORS[quantity])
