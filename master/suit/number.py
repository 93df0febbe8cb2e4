"""The number that a SYNC carries for a tick: it skips some now and then, so that an old answer shows. Pure.

Nodes on classic CAN return six bits of it. Counting by one, an answer that is late by 64 ticks (320 ms), for
ever, bears the right six bits and would pass. So after every 64 ticks the number leaves out some more: 1, 2,
… 62, 1, 2, … A lag of 64 ticks then never shows the right number, one of any other length seldom.
"""

from __future__ import annotations

from bisect import bisect_right

EPOCH = 64
"""Ticks between two skips: as many as six bits tell apart."""
_SKIPS = range(1, 63)
_STARTS = [EPOCH * i + sum(_SKIPS[:i]) for i in range(len(_SKIPS) + 1)]
"""First number of each epoch of a cycle; the last entry is the first number of the next cycle."""
_CYCLE_TICKS, _CYCLE_NUMBERS = EPOCH * len(_SKIPS), _STARTS[-1]


def number_of(tick: int) -> int:
    """What the SYNC of a tick carries, before it is cut to the wire's 32 bits."""
    cycle, within = divmod(tick, _CYCLE_TICKS)
    epoch, offset = divmod(within, EPOCH)
    return cycle * _CYCLE_NUMBERS + _STARTS[epoch] + offset


def tick_of(number: int) -> int:
    """The tick of a SYNC's number; of one that no SYNC has, the tick before it."""
    cycle, within = divmod(number, _CYCLE_NUMBERS)
    epoch = bisect_right(_STARTS, within) - 1
    return cycle * _CYCLE_TICKS + EPOCH * epoch + min(within - _STARTS[epoch], EPOCH - 1)
