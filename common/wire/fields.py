"""Single fields of a wire message: packed on sending, checked on arrival. Any doubt raises CodecError."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from common.errors import CodecError
from common.quaternion import Array
from common.wire.messages import Mask

MAX_NAME = 64
MAX_TEXT = 512
MAX_DOUBT = 240
MAX_NAMED = 120
"""Bytes of the words for one joint, so that the words for many joints fit in one message."""
_OVERHEAD_BYTES = 6
"""Of a name and a text in msgpack."""
_OTHERS_BYTES = 30
"""Of a command, which must fit into one packet on every path."""
MAX_NM = 10_000.0
"""No joint of a humanoid has more torque."""
ANGLE_LIMIT_RAD = 4 * math.pi
"""No joint turns twice round; a larger angle is a fault, not a posture."""
RATE_LIMIT_RAD_S = 100.0
MAX_ITEMS = 4096
"""Entries of one array or map."""
_U63 = (1 << 63) - 1
_F2, _F4 = np.dtype("<f2"), np.dtype("<f4")


def pack_floats(first: Array, second: Array) -> bytes:
    """Two arrays of one length as one float32 block: 1e-7 of a turn, half the size."""
    return first.astype(_F4).tobytes() + second.astype(_F4).tobytes()


def floats(value: object, count: int, limits: tuple[float, float]) -> tuple[Array, Array]:
    """Two float64 arrays of `count`, none of whose values lies beyond ± its limit or is not finite."""
    if type(value) is not bytes or len(value) != 8 * count:
        raise CodecError(f"not two times {count} float32 values")
    block = np.frombuffer(value, _F4)
    bounds, all_true = _bounds(count, limits)
    # one comparison refuses NaN and infinity too; before the cast, which would warn of a signalling NaN
    if (np.abs(block) <= bounds).tobytes() != all_true:
        raise CodecError(f"a value is not finite, or beyond ±{limits[0]:g} or ±{limits[1]:g}")
    wide = block.astype(np.float64)
    return wide[:count], wide[count:]


@lru_cache(maxsize=32)
def _bounds(count: int, limits: tuple[float, float]) -> tuple[NDArray[np.float32], bytes]:
    """The limits as float32, as the values are, so that a value at its limit passes; and all-True bytes."""
    return np.repeat(np.array(limits, _F4), count), b"\x01" * (2 * count)


def pack_torques(torque_nm: Array | None) -> bytes | None:
    """Torques as float16, a quarter of the size: steps of 0.05 % are less than any drive's noise."""
    return None if torque_nm is None else np.clip(torque_nm, -MAX_NM, MAX_NM).astype(_F2).tobytes()


def length(value: object, bytes_: int) -> None:
    """A block of so many bytes, whose values nobody looks at."""
    if type(value) is not bytes or len(value) != bytes_:
        raise CodecError(f"not a block of {bytes_} bytes")


def torques(value: object, count: int) -> Array | None:
    """Torques of `count` joints, NaN where one is not known; None where none is."""
    if value is None:
        return None
    if type(value) is not bytes or len(value) != 2 * count:
        raise CodecError(f"not {count} float16 values")
    # signalling NaNs are told from numbers before the cast, which would warn of them
    narrow = np.frombuffer(value, _F2)
    known = ~np.isnan(narrow)
    if (np.abs(narrow[known]) > MAX_NM).any():
        raise CodecError(f"a torque is beyond ±{MAX_NM:g} N m")
    out = np.full(count, np.nan)
    out[known] = narrow[known]
    return out


def pack_mask(mask: Mask) -> bytes:
    """One byte an entry: ten times faster here than bits, for twenty bytes more."""
    return mask.tobytes()


def mask(value: object, count: int) -> Mask:
    """A read-only mask of `count` entries."""
    if type(value) is not bytes or len(value) != count or value.strip(b"\x00\x01"):
        raise CodecError(f"not a mask of {count} flags")
    return np.frombuffer(value, np.bool_)


def pack_bits(mask: Mask) -> bytes:
    """One bit an entry: for what is sent often and read seldom. No bytes where no entry is set."""
    return np.packbits(mask).tobytes() if mask.any() else b""


def bits(value: object, count: int) -> Mask | None:
    """A mask of `count` entries, None where none is set."""
    if value == b"":
        return None
    if type(value) is not bytes or len(value) != (count + 7) // 8:
        raise CodecError(f"not {count} bits")
    return np.unpackbits(np.frombuffer(value, np.uint8), count=count).astype(np.bool_)


def counts(values: tuple[object, ...]) -> tuple[int, ...]:
    """Integers of 0 to 2**63 - 1: counters, ticks and stamps in ns."""
    return tuple(map(count, values))


def count(value: object) -> int:
    """One integer of 0 to 2**63 - 1."""
    if type(value) is not int or not 0 <= value <= _U63:
        raise CodecError(f"{short(value)} is not a 63-bit count")
    return value


def signed(value: object) -> int:
    """An integer of ±(2**63 - 1)."""
    if type(value) is not int or not -_U63 <= value <= _U63:
        raise CodecError(f"{short(value)} is not a 64-bit integer")
    return value


def flag(value: object) -> bool:
    """True or false, not 0 or 1."""
    if type(value) is not bool:
        raise CodecError(f"{short(value)} is not a flag")
    return value


def text(value: object, most: int) -> str:
    """A text of at most `most` characters."""
    if type(value) is not str or len(value) > most:
        raise CodecError(f"{short(value)} is not a text of at most {most} characters")
    return value


def number(value: object, lowest: float, highest: float) -> float:
    """A finite float between two bounds, both allowed."""
    if type(value) is not float or not lowest <= value <= highest:
        raise CodecError(f"{short(value)} is not a number from {lowest:g} to {highest:g}")
    return value


def numbers(value: object, lowest: float, highest: float) -> tuple[float, ...]:
    """A list of finite numbers within limits."""
    if type(value) is not tuple:
        raise CodecError("not a list of numbers")
    return tuple(number(one, lowest, highest) for one in value)


def texts(value: object, most_key: int, most: int) -> dict[str, str]:
    """A map from names to texts."""
    if type(value) is not dict:
        raise CodecError(f"{short(value)} is not a map")
    return {text(key, most_key): text(item, most) for key, item in value.items()}


def names(value: object, most: int) -> tuple[str, ...]:
    """A list of texts."""
    if type(value) is not tuple:
        raise CodecError(f"{short(value)} is not a list of names")
    return tuple(text(item, most) for item in value)


def shorten(words: str, most_bytes: int) -> str:
    """The text, cut where its UTF-8 would be longer than that."""
    packed = words.encode("utf-8")
    return words if len(packed) <= most_bytes else packed[:most_bytes].decode("utf-8", "ignore")


def fit_texts(texts: dict[str, str], most_bytes: int) -> dict[str, str]:
    """As many of the named texts as the bytes hold, in their order, and how many more there are.

    Each is cut to MAX_NAMED bytes. None is left out silently: `others` counts them.
    """
    fitting: dict[str, str] = {}
    room = most_bytes - _OTHERS_BYTES
    for name, words in texts.items():
        words = shorten(words, MAX_NAMED)
        room -= len(name.encode("utf-8")) + len(words.encode("utf-8")) + _OVERHEAD_BYTES
        if room < 0:
            fitting["others"] = f"{len(texts) - len(fitting)} more"
            break
        fitting[name] = words
    return fitting


def array(value: object, expected: int) -> tuple[object, ...]:
    """An array of so many fields."""
    if not isinstance(value, tuple):
        raise CodecError(f"{short(value)} is not an array")
    if len(value) != expected:
        raise CodecError(f"{len(value)} fields, expected {expected}")
    return value


def short(value: object) -> str:
    """A value as an error may quote it."""
    return repr(value)[:40]
