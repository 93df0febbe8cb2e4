"""A soak's own clock, and its files: events as they happen, a row of samples a second."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from common.clock import Clock, monotonic_ns, to_s
from deploy.experiments.soak.files.events import AnyEvent, EventFile, SoakEvent
from deploy.experiments.soak.files.happenings import Happening
from deploy.experiments.soak.files.samples import SampleFile

SHOWN = 8
"""Newest events that are kept for the screen."""


class SoakLog:
    """Writes each event and sample at once, and keeps only the newest events in memory."""

    def __init__(
        self,
        folder: Path,
        processes: Iterable[str],
        clock: Clock = monotonic_ns,
        on_event: Callable[[AnyEvent], None] = lambda _: None,
    ) -> None:
        self._clock = clock
        self._on_event = on_event
        self._begun_ns = clock()
        self._events = EventFile(folder)
        self._samples = SampleFile(folder, processes)
        self.newest: deque[AnyEvent] = deque(maxlen=SHOWN)
        self.counts: dict[str, int] = {}
        """Events by kind."""

    @property
    def now_s(self) -> float:
        """Since the soak's begin."""
        return to_s(self._clock() - self._begun_ns)

    def at_s(self, at_ns: int) -> float:
        """A time of this host's clock as seconds of the soak."""
        return to_s(at_ns - self._begun_ns)

    def add(self, what: Happening) -> None:
        """Something has happened."""
        event: AnyEvent = SoakEvent(self.now_s, what)
        self._events.add(event)
        self.newest.append(event)
        self.counts[what.kind] = self.counts.get(what.kind, 0) + 1
        self._on_event(event)

    def sample(self, row: Mapping[str, float | str]) -> None:
        """The row of the last second."""
        self._samples.add({"at_s": self.now_s, **row})

    def close(self) -> None:
        """May be called again."""
        self._events.close()
        self._samples.close()
