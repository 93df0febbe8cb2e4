"""Ticks of an absolute grid on the event loop, by a kernel timer: sharper than the loop's own (1 ms)."""

from __future__ import annotations

import asyncio
import ctypes
import os
from collections.abc import AsyncGenerator

from common.clock import NS_PER_S, Clock, monotonic_ns
from common.pacing import Due, TickGrid

_CLOCK_MONOTONIC = 1
_TFD_TIMER_ABSTIME = 1
_EXPIRATIONS_BYTES = 8


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("it_interval", _Timespec), ("it_value", _Timespec))


async def ticks(grid: TickGrid, clock: Clock = monotonic_ns) -> AsyncGenerator[Due, None]:
    """Each tick of the grid when it falls due; a late caller gets the newest, with the count of the missed.

    The loop runs between any two ticks, however late the caller is. `clock` must be this host's monotonic
    clock, or one that runs with it. The timer is closed when the iteration ends or is cancelled.
    """
    loop = asyncio.get_running_loop()
    timer = _open_timer(grid.next_ns, grid.period_ns)
    waiter: asyncio.Future[None] = loop.create_future()

    def on_expired() -> None:
        try:
            os.read(timer, _EXPIRATIONS_BYTES)
        except BlockingIOError:
            return
        if not waiter.done():
            waiter.set_result(None)

    loop.add_reader(timer, on_expired)
    try:
        while True:
            if clock() >= grid.next_ns:
                await asyncio.sleep(0)
            else:
                waiter = loop.create_future()
                await waiter
            due = grid.due(clock())
            if due is not None:
                yield due
    finally:
        loop.remove_reader(timer)
        os.close(timer)


def _open_timer(first_ns: int, period_ns: int) -> int:
    """A non-blocking timerfd that expires at first_ns + k * period_ns of CLOCK_MONOTONIC."""
    libc = ctypes.CDLL(None, use_errno=True)
    timer = int(libc.timerfd_create(_CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC))
    if timer < 0:
        raise OSError(ctypes.get_errno(), "no kernel timer: timerfd_create")
    # an absolute time of 0 would disarm it
    setting = _Itimerspec(_timespec(period_ns), _timespec(max(first_ns, 1)))
    if libc.timerfd_settime(timer, _TFD_TIMER_ABSTIME, ctypes.byref(setting), None) != 0:
        number = ctypes.get_errno()
        os.close(timer)
        raise OSError(number, "no kernel timer: timerfd_settime")
    return timer


def _timespec(time_ns: int) -> _Timespec:
    return _Timespec(*divmod(time_ns, NS_PER_S))
