"""The reference loops: one a core, in a process of their own, that only tick; the host misses what they miss.

`python -m deploy.harness.reference_loop` writes a JSON line when it starts, one each time that a loop is late
by a tick or more, and one a core four times a second; it ends when its standard input does. At real-time
priority, where the host permits it, it runs before all programs of tandem: what it misses then is the host's
alone. Without it, only the steal that the kernel counts meanwhile is the host's (deploy/harness/excuse.py).
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from dataclasses import asdict, replace
from pathlib import Path

from common.clock import NS_PER_S, monotonic_ns
from common.process.pacing import TickGrid
from common.process.realtime import enter_real_time
from deploy.harness.excuse import LoopsBegan, Stall

PERIOD_NS = 5_000_000
"""The same period as the master's capture and the slave's loop."""
REPORT_TICKS = 50
"""After so many ticks a loop reports that it still ticks: silence does not mean that it was in time."""
PRIORITY = 90
"""Above what `[process] realtime_priority` may ask for."""


def main() -> None:
    """Tick on every core until standard input ends."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started this one handles Ctrl-C
    first = enter_real_time(PRIORITY)
    cores = sorted(os.sched_getaffinity(0))
    origin_ns = monotonic_ns() + PERIOD_NS
    _write(LoopsBegan(cores, origin_ns, priority=first))
    for core in cores:
        threading.Thread(target=_tick, args=(core, TickGrid(origin_ns, PERIOD_NS)), daemon=True).start()
    sys.stdin.buffer.read()


def _tick(core: int, grid: TickGrid) -> None:
    os.sched_setaffinity(0, {core})
    before_ns = _stolen_ns(core)
    late: Stall | None = None
    while True:
        awaited_ns = grid.next_ns
        time.sleep(max(0, awaited_ns - monotonic_ns()) / NS_PER_S)
        now_ns = monotonic_ns()
        due = grid.due(now_ns)
        regular = due is not None and due.tick % REPORT_TICKS == 0
        if late or regular:
            # a tick after the stall: the kernel counts what was stolen only once it runs again
            stolen_ns = _stolen_ns(core)
            if late:
                _write(replace(late, stolen_ns=stolen_ns - before_ns))
            before_ns, late = stolen_ns, None
        if due is not None and (due.missed or regular):
            report = Stall(core, from_ns=awaited_ns, until_ns=now_ns, missed=due.missed)
            if due.missed:
                late = report
            else:
                _write(report)


def stolen_ns(stat: str, core: int, ticks_per_s: int) -> int:
    """The time stolen from a core since boot, by `/proc/stat` (proc(5)); 0 where it is not given."""
    for line in stat.splitlines():
        name, *times = line.split()
        if name == f"cpu{core}":
            return int(times[7]) * NS_PER_S // ticks_per_s if len(times) > 7 else 0
    return 0


def _stolen_ns(core: int) -> int:
    try:
        return stolen_ns(Path("/proc/stat").read_text("ascii"), core, os.sysconf("SC_CLK_TCK"))
    except OSError:
        return 0


def _write(line: LoopsBegan | Stall) -> None:
    sys.stdout.write(json.dumps(asdict(line)) + "\n")  # one write: two threads' lines must not mix
    sys.stdout.flush()


if __name__ == "__main__":
    main()
