"""What a process reserves at its start is there later: what comes and goes touches no new page."""

from __future__ import annotations

import subprocess
import sys

import pytest

STORY = """
import ctypes, sys
from common.process.heap import freeze_heap, reserve_heap, use_one_arena

def anonymous_kb():
    return next(int(l.split()[1]) for l in open("/proc/self/status") if l.startswith("RssAnon"))

use_one_arena()
freeze_heap()
before = anonymous_kb()
if sys.argv[1] == "reserved":
    reserve_heap()
reserved = anonymous_kb()
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.free.argtypes = (ctypes.c_void_p,)
chunks = [libc.malloc(10_000) for _ in range(200)]
for chunk in chunks:
    ctypes.memset(chunk, 1, 10_000)
objects = [bytes(300) for _ in range(1500)]
used = anonymous_kb()
for chunk in chunks:
    libc.free(chunk)
print(reserved - before, used - reserved)
"""


def grown_kb(way: str) -> tuple[int, int]:
    """By the reserve, and by 2 MB of C's and 0.5 MB of Python's objects after it."""
    ended = subprocess.run([sys.executable, "-c", STORY, way], capture_output=True, text=True, check=True)
    by_reserve, by_use = map(int, ended.stdout.split())
    return by_reserve, by_use


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="mallopt(3) is glibc's")
def test_what_is_used_after_the_reserve_touches_next_to_nothing_new() -> None:
    reserve_kb, after_kb = grown_kb("reserved")
    _, without_kb = grown_kb("not reserved")
    assert 3_500 < reserve_kb < 8_000
    assert without_kb > 2_000  # else this would show nothing
    assert after_kb < 0.25 * without_kb
