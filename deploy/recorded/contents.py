"""What is in a recording: topics, how many, how long, where one falls silent. In constant memory."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

from common.clock import to_s
from common.recording import Entry, RecordingStream
from deploy.recorded.missing import Missing


@dataclass(slots=True)
class TopicContents:
    """One topic of a recording."""

    count: int = 0
    size: int = 0
    """Bytes of payload."""
    first_ns: int = 0
    """Recording host's monotonic clock, as the next."""
    last_ns: int = 0
    longest_gap_s: float = 0.0
    """Between two messages."""
    missing: int | None = None
    """Messages that never came, by the numbers of those that did; None where they bear none."""

    def take(self, at_ns: int, size: int) -> None:
        """Count one message."""
        if self.count:
            self.longest_gap_s = max(self.longest_gap_s, to_s(at_ns - self.last_ns))
        else:
            self.first_ns = at_ns
        self.last_ns = at_ns
        self.count += 1
        self.size += size

    @property
    def rate_hz(self) -> float:
        """Mean over the time from its first to its last message; 0 where there is one only."""
        span_s = to_s(self.last_ns - self.first_ns)
        return (self.count - 1) / span_s if span_s > 0.0 else 0.0


@dataclass(slots=True)
class Contents:
    """A recording, surveyed."""

    metadata: dict[str, str] = field(default_factory=dict)
    topics: dict[str, TopicContents] = field(default_factory=dict)
    cut: str = ""
    """How it ends too early; empty where it was closed in order."""

    def tree(self) -> dict[str, object]:
        """Plain values for JSON."""
        topics = {name: {**asdict(topic), "rate_hz": topic.rate_hz} for name, topic in self.topics.items()}
        return {"metadata": self.metadata, "topics": topics, "cut": self.cut}


class Survey:
    """Counts messages as they come."""

    def __init__(self) -> None:
        self._topics: dict[str, TopicContents] = {}
        self._gaps: dict[str, Missing] = {}

    def take(self, entry: Entry) -> None:
        """One message, in the file's order."""
        if entry.topic not in self._gaps:
            self._gaps[entry.topic] = Missing(entry.topic.rpartition("/")[2])
        self._gaps[entry.topic].take(entry.payload, entry.monotonic_ns)
        self._topics.setdefault(entry.topic, TopicContents()).take(entry.monotonic_ns, len(entry.payload))

    def contents(self, stream: RecordingStream) -> Contents:
        """Of a stream that has been gone through."""
        for name, contents in self._topics.items():
            contents.missing = self._gaps[name].count
        return Contents(stream.metadata or {}, self._topics, stream.cut)


def survey(path: Path) -> Contents:
    """Read a whole file. Raises RecordingError if tandem did not write it."""
    stream, found = RecordingStream(path), Survey()
    for entry in stream:
        found.take(entry)
    return found.contents(stream)
