"""Where the time of the commands went, stage by stage, with means that add up. Pure."""

from __future__ import annotations

from dataclasses import replace

from common.clock import NS_PER_MS
from common.clock_sync import Offset
from common.latency.durations import Durations
from common.latency.stamps import STAGES, Passage
from common.metrics.parts import Summary


class StageTimes:
    """Consecutive stages, recorded together, so that all rows are over the same commands."""

    def __init__(self, *stages: str) -> None:
        self._stages = {name: Durations() for name in stages}
        self._total = Durations()

    def record(self, *durations_ns: int) -> None:
        """Take one command's durations, in the order of the stages. ValueError if it is not one a stage."""
        if len(durations_ns) != len(self._stages):
            raise ValueError(f"{len(durations_ns)} durations for {len(self._stages)} stages")
        for stage, duration_ns in zip(self._stages.values(), durations_ns, strict=True):
            stage.record(duration_ns)
        self._total.record(sum(max(d, 0) for d in durations_ns))

    def summary(self) -> dict[str, Summary]:
        """A row a stage, in order, in ms; their means add up to that of `total`."""
        return {name: stage.summary() for name, stage in self._stages.items()}

    def total(self) -> Summary:
        """The whole, from the first stamp to the last."""
        return self._total.summary()


class LatencyBudget:
    """The stages of commands that went the whole way, recorded on the slave.

    The others, refused, lost or followed by no motion, are in no row.
    """

    def __init__(self) -> None:
        self._stages = StageTimes(*STAGES)
        self._bound_ns = 0

    def record(self, passage: Passage, offset: Offset) -> None:
        """Take one passage. `offset` is the master's clock minus the slave's; only a trusted one counts."""
        if offset.trusted:
            self._stages.record(*passage.stages_ns(offset))
            self._bound_ns = max(self._bound_ns, offset.bound_ns)

    def summary(self) -> dict[str, Summary]:
        """A row a stage in ms; `put→received` also has `bound`, the widest its offset had."""
        rows = self._stages.summary()
        crossing = rows["put→received"]
        if crossing.count:
            rows["put→received"] = replace(crossing, bound=self._bound_ns / NS_PER_MS)
        return rows

    def total(self) -> Summary:
        """From sampled to moved; its mean is the sum of the stages' means."""
        return self._stages.total()
