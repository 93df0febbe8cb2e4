"""Writes messages of named topics to an MCAP file, in a thread of its own.

`put` only hands over: it never waits for the disk. What the thread cannot keep up with is dropped and
counted; a disk that fails ends the recording, says so once, and leaves the process alone. Every `flush_s`
what came is closed into a chunk and handed to the kernel, with a link of the file's chain of hashes
(`chain.py`), so that a process that is killed loses no more than that; a host that loses its power may lose
more. The file gets its name once its head is in it: a
process that is killed, or a disk that is full, at the very beginning leaves no file that cannot be read.
"""

from __future__ import annotations

import logging
import os
import queue
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import BinaryIO, NamedTuple, Self, cast

from mcap.writer import Writer

from common.clock import Clock, monotonic_ns, to_ns, wall_ns
from common.errors import RecordingError
from common.recording.chain import CHAIN, RunningChain

METADATA = "tandem"
"""Name of the MCAP metadata record that says what was recorded."""
ENCODING = "msgpack"
FLUSH_S = 0.5
CAPACITY = 4000
"""Messages that may wait for the disk: 20 s at 200 Hz."""
CLOSE_S = 2.0
"""How long closing waits for a disk that hangs: less than a process is given to end."""

log = logging.getLogger(__name__)


class _Item(NamedTuple):
    topic: str
    payload: bytes
    wall_ns: int
    monotonic_ns: int


class _HashedStream:
    """The file, of which each byte that is written goes into the chain too."""

    def __init__(self, stream: BinaryIO) -> None:
        self.chain = RunningChain()
        self._stream = stream

    def write(self, data: bytes) -> int:
        """As of the file."""
        self.chain.take(data)
        return self._stream.write(data)

    def tell(self) -> int:
        """As of the file."""
        return self._stream.tell()

    def flush(self) -> None:
        """As of the file."""
        self._stream.flush()

    def close(self) -> None:
        """As of the file."""
        self._stream.close()


@dataclass(slots=True)
class RecorderCounters:
    """One recording since its start."""

    put: int = 0
    """Handed over."""
    written: int = 0
    """In the file, in a chunk that is whole."""
    refused: int = 0
    """Not taken: the queue was full, or the disk had failed."""
    lost: int = 0
    """Taken, but the disk failed before they were written."""
    failed: str = ""
    """Why nothing is written any more; empty while all is well."""


class McapRecorder:
    """One file, from opening to `close`. `put` is for one thread, as a rule the event loop's."""

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        flush_s: float = FLUSH_S,
        capacity: int = CAPACITY,
        wall: Clock = wall_ns,
        stream: BinaryIO | None = None,
    ) -> None:
        """Create the file, which must not be there yet: no recording is ever written over.

        `stream` is written to instead of a file of that path. Raises RecordingError.
        """
        self.path = path
        self.counters = RecorderCounters()
        self._wall = wall
        self._flush_ns = to_ns(flush_s)
        self._queue: queue.Queue[_Item | None] = queue.Queue(capacity)
        hidden = path.with_name(f".{path.name}.{token_hex(4)}")
        self._stream = _HashedStream(create(hidden, path) if stream is None else stream)
        self._whole = 0
        self._unflushed = 0
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        try:
            self._writer = Writer(cast(BinaryIO, self._stream))
            self._writer.start(library="tandem")
            self._writer.add_metadata(METADATA, dict(metadata))
            self._flush()
            if stream is None:
                _reveal(hidden, path)
        except (OSError, RecordingError) as error:
            with suppress(OSError):  # it flushes once more, and fails as before
                self._stream.close()
            hidden.unlink(missing_ok=True)
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(f"{path}: cannot be written ({error.strerror or error})") from None
        self._thread = threading.Thread(target=self._run, name=f"recorder {path.name}", daemon=True)
        self._thread.start()

    def put(self, topic: str, payload: bytes, monotonic_ns: int) -> bool:
        """Hand a message over, stamped by this host's monotonic clock; False where it was dropped."""
        self.counters.put += 1
        if not self.counters.failed:
            try:
                self._queue.put_nowait(_Item(topic, payload, self._wall(), monotonic_ns))
            except queue.Full:
                pass
            else:
                return True
        self.counters.refused += 1
        return False

    def close(self) -> None:
        """Write what waits and the index, then close. May be called again."""
        if self._thread.is_alive():
            try:
                self._queue.put(None, timeout=CLOSE_S)
            except queue.Full:
                log.error("%s: the disk does not respond; the end of the recording is lost", self.path)
                return
            self._thread.join(CLOSE_S)

    def summary(self) -> dict[str, object]:
        """The counters as plain values."""
        return {"file": self.path.name, **asdict(self.counters)}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        try:
            self._work()
        except Exception as error:  # whatever it is, the process that is recorded goes on
            self._fail(error)
            while self._queue.get() is not None:
                self.counters.lost += 1
        else:
            self._stream.close()

    def _work(self) -> None:
        due_ns = monotonic_ns() + self._flush_ns
        while True:
            try:
                item = self._queue.get(timeout=max(0.001, (due_ns - monotonic_ns()) / 1e9))
            except queue.Empty:
                pass
            else:
                if item is None:
                    break
                self._write(item)
            if monotonic_ns() >= due_ns:
                self._flush()
                due_ns = monotonic_ns() + self._flush_ns
        self._flush()
        self._writer.finish()
        self._stream.flush()

    def _write(self, item: _Item) -> None:
        self._unflushed += 1
        topic = item.topic
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, ENCODING, 0)
            self._sequence[topic] = 0
        self._sequence[topic] += 1
        # the wall clock orders the file, as readers of MCAP expect; the monotonic one is what was measured by
        self._writer.add_message(
            self._channels[topic], item.wall_ns, item.payload, item.monotonic_ns, self._sequence[topic]
        )

    def _flush(self) -> None:
        self._writer.flush()
        # after each chunk, and at the head: nothing else is written by this writer before its end
        if self._unflushed or not self._whole:
            self._writer.add_metadata(CHAIN, self._stream.chain.link().record())
            self._stream.flush()
        self._whole = self._stream.tell()
        self.counters.written += self._unflushed
        self._unflushed = 0

    def _fail(self, error: Exception) -> None:
        counters = self.counters
        counters.failed = (error.strerror if isinstance(error, OSError) else None) or str(error)
        counters.lost += self._unflushed
        log.error("%s: the recording ends here: %s; the process continues", self.path, counters.failed)
        with suppress(OSError):  # it flushes once more, and fails as before
            self._stream.close()
        try:  # so that the file ends with a whole chunk
            os.truncate(self.path, self._whole)
        except OSError as second:
            log.info("%s: the incomplete chunk at its end could not be cut off: %s", self.path, second)


def _reveal(hidden: Path, path: Path) -> None:
    """Give a file its own name. Raises RecordingError where another file has it, else OSError."""
    try:
        os.link(hidden, path)  # unlike a renamed file, a linked one never replaces another
    except FileExistsError:
        raise _taken(path) from None
    except OSError:  # a file system without hard links, such as a memory stick's
        if path.exists():
            raise _taken(path) from None
        hidden.rename(path)
    else:
        hidden.unlink()


def _taken(path: Path) -> RecordingError:
    return RecordingError(f"{path}: is there already; name another file, or move it away")


def create(path: Path, named: Path | None = None) -> BinaryIO:
    """Open a new file for writing. Raises RecordingError where it is there already: none is written over.

    `named`: the file that an error is about, where it is another one.
    """
    named = named or path
    try:
        return path.open("xb")
    except FileExistsError:
        raise _taken(named) from None
    except OSError as error:
        raise RecordingError(f"{named}: cannot be written ({error.strerror})") from None
