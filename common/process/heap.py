"""The heap of a process that runs for days: out of the collector's way, and with room that is there already.

A page of memory that is touched for the first time costs the loop a fault, and is growth. Each outage of
the link touched some tens of kB more, ever less: 0.9 MB over the first forty, behind which a leak could hide.
So what a process will need is touched when it starts, as real-time programs under Linux do; sixteen outages
after the eighth then added 24 kB.
"""

from __future__ import annotations

import ctypes
import gc
import sys
import threading

from common.metrics.parts import HeapMetrics

_M_TRIM_THRESHOLD, _M_ARENA_MAX = -1, -8
"""mallopt(3)."""
_KEEP_BYTES = 1 << 30
_RESERVE_BYTES, _CHUNK_BYTES = 4 << 20, 64 << 10
"""What is touched for C, in pieces below the size from which the library maps each by itself."""
_OBJECTS, _OBJECT_BYTES = 4096, 400
"""What is touched for Python, of a size that its own allocator serves: 1.6 MB."""


def freeze_heap() -> None:
    """Take what lives now out of garbage collection: a full one took 80 ms with a large heap.

    Call it once all is imported, and again after a start that builds much.
    """
    gc.collect()
    gc.freeze()


def use_one_arena() -> None:
    """Let all threads share one heap, or each of several would grow by itself. Call it before any starts."""
    _mallopt(_M_ARENA_MAX, 1)


def reserve_heap() -> None:
    """Touch what a long run needs above a quiet one, once all is built. Does nothing but under glibc."""
    if not _mallopt(_M_TRIM_THRESHOLD, _KEEP_BYTES):
        return
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, (ctypes.c_size_t,)
    libc.free.argtypes = (ctypes.c_void_p,)
    chunks = [chunk for _ in range(_RESERVE_BYTES // _CHUNK_BYTES) if (chunk := libc.malloc(_CHUNK_BYTES))]
    objects = [bytes(_OBJECT_BYTES) for _ in range(_OBJECTS)]
    for chunk in chunks:
        ctypes.memset(chunk, 0, _CHUNK_BYTES)
        libc.free(chunk)
    del objects


class _MallInfo2(ctypes.Structure):
    """mallinfo2(3)."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks",
            "fordblks", "keepcost",
        )
    )  # fmt: skip


def heap_in_use() -> HeapMetrics:
    """What this process holds on to now, whatever was touched before: a leak shows from its first byte."""
    try:
        mallinfo2 = ctypes.CDLL(None).mallinfo2
    except (AttributeError, OSError, TypeError):  # not glibc, or one before 2.33; Windows has no such library
        return HeapMetrics(None, sys.getallocatedblocks(), threading.active_count())
    mallinfo2.restype = _MallInfo2
    info = mallinfo2()
    # small Python objects live in maps of their own, which C does not count: blocks stand for them
    return HeapMetrics(info.uordblks + info.hblkhd, sys.getallocatedblocks(), threading.active_count())


def _mallopt(parameter: int, value: int) -> bool:
    """False where the C library has no such thing."""
    try:
        return bool(ctypes.CDLL(None).mallopt(parameter, value))
    except (AttributeError, OSError, TypeError):
        return False
