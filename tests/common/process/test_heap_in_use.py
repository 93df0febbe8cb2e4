"""What is in use is seen from its first byte, although a reserve of megabytes was touched before."""

from __future__ import annotations

import ctypes

import pytest

from common.process.heap import heap_in_use, reserve_heap


def test_a_leak_shows_at_once_in_spite_of_the_reserve() -> None:
    before = heap_in_use()
    if before.bytes_in_use is None:
        pytest.skip("this C library does not tell what is in use")
    reserve_heap()
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, (ctypes.c_size_t,)
    libc.free.argtypes = (ctypes.c_void_p,)
    leaked = [libc.malloc(10_000) for _ in range(100)]
    during = heap_in_use()
    for chunk in leaked:
        libc.free(chunk)
    assert during.bytes_in_use is not None
    assert during.bytes_in_use - before.bytes_in_use > 900_000


def test_python_objects_are_counted_beside() -> None:
    before = heap_in_use().python_blocks
    kept = [object() for _ in range(5000)]
    assert heap_in_use().python_blocks - before > 4000
    del kept
