"""The master's side of the tap: its pipeline's calls, what it sends and hears, a snapshot now and then."""

from __future__ import annotations

import logging

import msgpack

from common.clock import to_ns
from common.tap.readers import Readers
from master.journal.calls import SNAPSHOT, JournaledPipeline, Pipeline
from master.journal.memory import recall

SNAPSHOT_NS = to_ns(60.0)
SOONEST_NS = to_ns(2.0)
"""A snapshot takes 2 to 4 ms: a reader that keeps falling behind must not ask for one each tick."""

log = logging.getLogger(__name__)


class MasterTap:
    """Everything that a recording needs to compute the joint angles again. Costs little without readers."""

    def __init__(self, pipeline: Pipeline, readers: Readers) -> None:
        self._raw = pipeline
        self._readers = readers
        self._snapshot_ns: int | None = None
        self._failed = False
        self.pipeline = JournaledPipeline(pipeline, readers.put, lambda: readers.read)
        """To be called in the pipeline's place."""

    def overhear(self, key: str, payload: bytes, stamp_ns: int) -> None:
        """A message that was sent or heard on the link."""
        self._readers.put(key, payload, stamp_ns)

    def rest(self, now_ns: int) -> None:
        """The tick's work is done: time for a snapshot, if one is due."""
        if not self._readers.read or self._failed:
            return
        since_ns = SNAPSHOT_NS if self._snapshot_ns is None else now_ns - self._snapshot_ns
        if since_ns >= SNAPSHOT_NS or (self._readers.behind and since_ns >= SOONEST_NS):
            self._snapshot_ns = now_ns
            self._put_snapshot()

    def _put_snapshot(self) -> None:
        try:
            snapshot: bytes = msgpack.packb(recall(self._raw))
        except Exception:  # whatever it is, the operator's robot goes on
            self._failed = True
            log.exception("no snapshot can be taken, so recordings of this run cannot be computed again")
            return
        self.pipeline.begin_again()
        self._readers.put_snapshot(SNAPSHOT, snapshot)
