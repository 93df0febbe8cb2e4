"""The master's side of the tap: its pipeline's calls, what it sends and hears, a snapshot now and then."""

from __future__ import annotations

import msgpack

from common.clock import to_ns
from common.tap.sender import TapSender
from master.journal.calls import SNAPSHOT, JournaledPipeline, Pipeline
from master.journal.memory import recall

SNAPSHOT_NS = to_ns(60.0)
SOONEST_NS = to_ns(2.0)
"""A snapshot takes 2 to 4 ms: a reader that keeps falling behind must not ask for one each tick."""


class MasterTap:
    """Everything that a recording needs to compute the joint angles again. Costs little without readers."""

    def __init__(self, pipeline: Pipeline, sender: TapSender) -> None:
        self._raw = pipeline
        self._sender = sender
        self._snapshot_ns = 0
        self.pipeline = JournaledPipeline(pipeline, sender.put, lambda: sender.read)
        """To be called in the pipeline's place."""

    def overhear(self, key: str, payload: bytes, stamp_ns: int) -> None:
        """A message that was sent or heard on the link."""
        self._sender.put(key, payload, stamp_ns)

    def rest(self, now_ns: int) -> None:
        """The tick's work is done: time for a snapshot, if one is due."""
        since_ns = now_ns - self._snapshot_ns
        if not self._sender.read or since_ns < SOONEST_NS:
            return
        if self._sender.behind or since_ns >= SNAPSHOT_NS:
            self._snapshot_ns = now_ns
            self.pipeline.flush()
            self._sender.put_snapshot(SNAPSHOT, msgpack.packb(recall(self._raw)))
