"""Ticks of an absolute grid on the event loop, by a kernel timer: sharper than the loop's own (1 ms)."""

from __future__ import annotations

import asyncio
import ctypes
import os
from collections.abc import AsyncGenerator

from common.clock import NS_PER_S, Clock, monotonic_ns
from common.process.pacing import DueTick, TickGrid

_CLOCK_MONOTONIC = 1
_EXPIRATIONS_BYTES = 8


class _Timespec(ctypes.Structure):
    _fields_ = (("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("it_interval", _Timespec), ("it_value", _Timespec))


async def coarse_ticks(grid: TickGrid, clock: Clock = monotonic_ns) -> AsyncGenerator[DueTick, None]:
    """As `ticks`, by the loop's own timer: later by up to a millisecond or two, at a third of the cost.

    For whatever is done for each of many robots.
    """
    async for tick in _ticks_by_the_loop(grid, clock):
        yield tick


async def ticks(grid: TickGrid, clock: Clock = monotonic_ns) -> AsyncGenerator[DueTick, None]:
    """Each tick of the grid when it falls due; a late caller gets the newest, with the count of the missed.

    The loop runs between any two ticks, however late the caller is. `clock` must be this host's monotonic
    clock, or one that runs with it. The timer is closed when the iteration ends or is cancelled.
    """
    loop = asyncio.get_running_loop()
    try:
        timer = _Timer()
    except (AttributeError, TypeError):  # no timerfd in this system's C library: not Linux
        async for tick in _ticks_by_the_loop(grid, clock):
            yield tick
        return
    waiter: asyncio.Future[None] = loop.create_future()

    def on_expired() -> None:
        if timer.expired() and not waiter.done():
            waiter.set_result(None)

    loop.add_reader(timer.fd, on_expired)
    try:
        while True:
            # the timer runs by the steered clock: it is set for each tick, and again where it was early
            wait_ns = grid.next_ns - clock()
            if wait_ns <= 0:
                await asyncio.sleep(0)
            else:
                waiter = loop.create_future()
                timer.set(wait_ns)
                await waiter
            due = grid.due(clock())
            if due is not None:
                yield due
    finally:
        loop.remove_reader(timer.fd)
        timer.close()


async def _ticks_by_the_loop(grid: TickGrid, clock: Clock) -> AsyncGenerator[DueTick, None]:
    """The same by the loop's own timer, where there is no timerfd: later by up to its resolution."""
    while True:
        wait_ns = grid.next_ns - clock()
        await asyncio.sleep(max(0, wait_ns) / NS_PER_S)
        due = grid.due(clock())
        if due is not None:
            yield due


class _Timer:
    """A non-blocking timerfd that expires once, so long after it was set."""

    def __init__(self) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self.fd = int(self._libc.timerfd_create(_CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC))
        if self.fd < 0:
            raise OSError(ctypes.get_errno(), "no kernel timer: timerfd_create")
        self._setting = _Itimerspec()
        self._by_reference = ctypes.byref(self._setting)

    def set(self, wait_ns: int) -> None:
        """Expire so much later, above 0."""
        self._setting.it_value = _timespec(wait_ns)
        if self._libc.timerfd_settime(self.fd, 0, self._by_reference, None) != 0:
            raise OSError(ctypes.get_errno(), "no kernel timer: timerfd_settime")

    def expired(self) -> bool:
        """Whether it has; asking begins anew."""
        try:
            os.read(self.fd, _EXPIRATIONS_BYTES)
        except BlockingIOError:
            return False
        return True

    def close(self) -> None:
        """It expires no more."""
        os.close(self.fd)


def _timespec(time_ns: int) -> _Timespec:
    return _Timespec(*divmod(time_ns, NS_PER_S))
