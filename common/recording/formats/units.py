"""Units as files name them, and what they are in m/s², rad/s, µT, s and m."""

from __future__ import annotations

import math
from collections.abc import Mapping

from common.errors import RecordingError
from common.recording.formats.samples import ACC, GYR, MAG, POSITION, TIME

G_M_S2 = 9.80665
_DEG = math.pi / 180.0
_NAMES: Mapping[str, Mapping[float, tuple[str, ...]]] = {
    ACC: {
        1.0: ("m/s^2", "m/s2", "m/s/s", "ms2", "mss", "m.s-2", "ms-2"),
        G_M_S2: ("g", "gs", "g0"),
        1e-3 * G_M_S2: ("mg", "milli-g"),
        1e-2: ("cm/s^2", "cm/s2"),
    },
    GYR: {
        1.0: ("rad/s", "rads", "radps", "rad/sec", "rads-1"),
        _DEG: ("deg/s", "°/s", "dps", "degs", "degps", "deg/sec", "degrees/s", "o/s"),
        1e-3 * _DEG: ("mdps", "mdeg/s", "m°/s"),
    },
    MAG: {
        1.0: ("ut", "microtesla", "a.u.", "au", "arb", "normalised", "normalized"),
        1e6: ("t", "tesla"),
        1e3: ("mt",),
        1e-3: ("nt",),
        100.0: ("gauss", "gs", "ga"),
        0.1: ("mgauss", "mgs", "milligauss", "mga"),
    },
    TIME: {
        1.0: ("s", "sec", "secs", "second", "seconds"),
        1e-3: ("ms", "msec", "millis", "milliseconds"),
        1e-6: ("us", "usec", "micros", "microseconds"),
        1e-9: ("ns", "nsec", "nanos", "nanoseconds"),
    },
    POSITION: {1.0: ("m",), 1e-3: ("mm",), 1e-2: ("cm",)},
}
"""A magnetometer in arbitrary units stays as it is: only its direction is used until it is calibrated."""
FACTORS = {q: {name: f for f, names in table.items() for name in names} for q, table in _NAMES.items()}
SI = {q: names[1.0][0] for q, names in _NAMES.items()} | {MAG: "µT"}


def known_unit(quantity: str, text: str) -> str | None:
    """The table's name of a unit; None where it is not a unit of that quantity."""
    name = text.strip().lower().replace("µ", "u").replace("μ", "u").replace("²", "^2").replace(" ", "")
    return name if name in FACTORS.get(quantity, {}) else None


def factor(where: str, quantity: str, unit: str) -> float:
    """What a number in that unit is to be multiplied by. Raises RecordingError, beginning with `where`."""
    name = known_unit(quantity, unit)
    if name is None:
        known = ", ".join(names[0] for names in _NAMES.get(quantity, {}).values()) or "none"
        raise RecordingError(f"{where}: {unit!r} is no unit of {quantity}; expected one of {known}")
    return FACTORS[quantity][name]
