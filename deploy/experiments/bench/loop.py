"""How late the 200 Hz loop ticks, alone and beside a core that is kept busy."""

from __future__ import annotations

import uvloop

from common.clock import monotonic_ns, to_ns
from common.process.heap import freeze_heap
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from deploy.experiments.bench.worker import beside, in_worker
from deploy.measure.timing import spread_us

RATE_HZ = 200


def loop(seconds: float) -> dict[str, object]:
    """Lateness in µs and ticks missed, `idle` and `busy`; half of the time goes to each."""
    idle = in_worker(lateness, seconds / 2)
    with beside(burn):
        return {"idle": idle, "busy": in_worker(lateness, seconds / 2)}


def lateness(seconds: float) -> dict[str, object]:
    """Tick for a while and do nothing else."""
    return uvloop.run(_lateness(seconds))


async def _lateness(seconds: float) -> dict[str, object]:
    freeze_heap()
    period_ns = to_ns(1 / RATE_HZ)
    begin_ns = monotonic_ns() + period_ns
    late_ns: list[int] = []
    corrected_ns: list[int] = []
    missed = 0
    async for due in ticks(TickGrid(begin_ns, period_ns)):
        late_ns.append(monotonic_ns() - due.scheduled_ns)
        corrected_ns += with_missed(late_ns[-1], due.missed, period_ns)
        missed += due.missed
        if due.scheduled_ns - begin_ns >= to_ns(seconds):
            break
    return {"late_us": spread_us(late_ns), "corrected_us": spread_us(corrected_ns), "missed": missed}


def with_missed(late_ns: int, missed: int, period_ns: int) -> list[int]:
    """Lateness of a tick that ran and of those before it that did not: their work was done with it."""
    return [late_ns + number * period_ns for number in range(missed + 1)]


def burn() -> None:
    """Keep one core busy until killed."""
    while True:
        pass
