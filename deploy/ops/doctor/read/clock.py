"""Whether the kernel takes its wall clock for synchronised (adjtimex(2)); what time services state of it."""

from __future__ import annotations

import ctypes

from common.clock import monotonic_ns
from common.clock_sync.config import ClockConfig
from common.clock_sync.services import TimeServices

_STA_UNSYNC = 0x0040


class _Timex(ctypes.Structure):
    """The kernel's `struct timex` up to `status`; the rest is room."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_char * 256),
    )


def clock_is_synchronised() -> bool | None:
    """None where the kernel does not tell."""
    timex = _Timex()  # modes 0: only read
    try:
        state = ctypes.CDLL(None).adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    return None if state < 0 else not timex.status & _STA_UNSYNC


def read_services(config: ClockConfig | None) -> tuple[bool, str] | None:
    """Whether a time service states how wrong this host's clock is, and its words; None where none is to."""
    if config is None or config.source == "round_trip":
        return None
    services = TimeServices(config)
    services.read()
    return services.track.reference(monotonic_ns()) is not None, services.words
