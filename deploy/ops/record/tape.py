"""A recording that is file after file, so that hours of it cost no more memory, or damage, than one file."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from pathlib import Path

from common.clock import Clock, monotonic_ns, to_ns
from common.errors import RecordingError
from common.recording import McapRecorder, RecorderCounters

log = logging.getLogger(__name__)


class Tape:
    """Writes to `out`, then to files named after it.

    An MCAP writer keeps its index in memory until it closes: 2 kB for each half second, 15 MB an hour.
    """

    def __init__(
        self, out: Path, metadata: Mapping[str, str], each_s: float | None, clock: Clock = monotonic_ns
    ) -> None:
        """`each_s`: how long a file lasts; None: one for all. Raises RecordingError."""
        self._out = out
        self._metadata = metadata
        self._each_s = each_s
        self._clock = clock
        self._closed = RecorderCounters()
        self._refused = 0
        self._recorder: McapRecorder | None = McapRecorder(out, metadata)
        self._begun_ns = clock()
        self.files = [out]
        """One name an hour, or so."""

    @property
    def failed(self) -> str:
        """Why nothing is written any more; empty while all is well."""
        return self._recorder.counters.failed if self._recorder else self._closed.failed

    def put(self, topic: str, payload: bytes, monotonic_ns: int) -> bool:
        """Hand a message over; False where it was dropped, which is counted."""
        if self._recorder is None:
            self._refused += 1
            return False
        return self._recorder.put(topic, payload, monotonic_ns)

    async def turn(self) -> None:
        """Begin the next file if it is time. If that fails, recording stops and one error is logged."""
        recorder, each_s = self._recorder, self._each_s
        if recorder is None or each_s is None or recorder.counters.failed:
            return
        if self._clock() - self._begun_ns < to_ns(each_s):
            return
        path = self._out.with_name(f"{self._out.stem}-{1 + len(self.files)}{self._out.suffix}")
        try:
            self._recorder = McapRecorder(path, {**self._metadata, "continues": self.files[-1].name})
        except RecordingError as error:
            log.error("%s; the recording stops here; tandem record continues without writing", error)
            self._recorder, self._closed.failed = None, str(error)
        else:
            self.files.append(path)
        self._begun_ns = self._clock()
        await self._end(recorder)

    async def close(self) -> None:
        """Write what waits, and close the last file."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            await self._end(recorder)

    async def _end(self, recorder: McapRecorder) -> None:
        await asyncio.to_thread(recorder.close)
        all_, one = self._closed, recorder.counters
        for name in ("put", "written", "refused", "lost"):
            setattr(all_, name, getattr(all_, name) + getattr(one, name))
        all_.failed = all_.failed or one.failed

    def counters(self) -> RecorderCounters:
        """The sum of the counters of all closed files."""
        put, refused = self._closed.put + self._refused, self._closed.refused + self._refused
        return RecorderCounters(put, self._closed.written, refused, self._closed.lost, self._closed.failed)
