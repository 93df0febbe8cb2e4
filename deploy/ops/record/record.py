"""Hears one robot's topics and puts them into a recording, as they came: bytes and time of arrival."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from common.clock import monotonic_ns, to_s
from common.errors import TandemError
from common.link import Link, open_link
from common.link.config import LinkConfig
from common.metrics.recorder import RecorderMetrics
from common.metrics.tree import WriteMetrics
from common.process.runtime import until_stopped
from common.wire.topics import COMMAND, IN_ORDER, STATE, STATISTICS, VIDEO, Topic, video
from deploy.ops.record.tape import Tape
from deploy.recorded.missing import Missing, missing_in_words

LIVE = (COMMAND, STATE, STATISTICS)
"""What is always recorded."""
PROGRESS_S = 0.5


@dataclass(frozen=True, slots=True)
class RecordOptions:
    """What the command line chose."""

    link: LinkConfig
    robot: str
    out: Path
    cameras: tuple[str, ...] = ()
    seconds: float | None = None
    each_s: float | None = None
    """How long one file lasts; None: there is one."""
    may_miss: bool = False
    """Whether a recording with numbered messages missing is still a good one."""

    @property
    def topics(self) -> tuple[Topic, ...]:
        """The topics to hear; a camera's is named after it."""
        return (*LIVE, *map(video, self.cameras))

    def name(self, topic: Topic) -> str:
        """What a topic is called in the file's head: its key; commands are under their operators' keys."""
        return topic.key_for(self.robot)


@dataclass(slots=True)
class Taken:
    """What has been heard since the start, by topic name."""

    since_ns: int
    counts: dict[str, int] = field(default_factory=dict)
    gaps: dict[str, Missing] = field(default_factory=dict)
    size: int = 0
    """Bytes handed to the recording."""

    def take(self, topic: Topic, key: str, payload: bytes, arrived_ns: int) -> None:
        """Count one message."""
        self.counts[topic.name] = self.counts.get(topic.name, 0) + 1
        if key not in self.gaps:
            self.gaps[key] = Missing(topic.name)
        self.gaps[key].take(payload, arrived_ns)

    @property
    def missing(self) -> dict[str, int]:
        """Messages that never came, by key; a topic whose messages bear no number is left out."""
        return {key: gaps.count for key, gaps in self.gaps.items() if gaps.count is not None}

    def words(self, tape: Tape, now_ns: int) -> str:
        """One line for people."""
        elapsed_s = max(1e-3, to_s(now_ns - self.since_ns))
        rates = ", ".join(f"{name} {count / elapsed_s:.1f} Hz" for name, count in self.counts.items())
        line = f"{elapsed_s:6.1f} s: {rates or 'nothing is heard yet'}, {self.size / 1e6:.1f} MB"
        missing = missing_in_words(self.missing)
        line += f"; MISSING: {missing}" if missing else ""
        return f"{line}; NOT WRITTEN: {tape.failed}" if tape.failed else line


async def record(
    options: RecordOptions,
    stop: asyncio.Event,
    report: Callable[[str], None],
    write_metrics: WriteMetrics = lambda _: None,
) -> str:
    """Record until `stop` is set or the time is over. Returns a summary for people.

    If the disk fails, writing stops, one error is logged and counted, and messages are still counted. Raises
    LinkError and RecordingError if it cannot start; TandemError at the end if the recording is empty or lacks
    a message that the sender numbered.
    """
    metadata = {
        "robot": options.robot,
        "topics": " ".join(options.name(topic) for topic in options.topics),
        "payload": "msgpack, see common/wire/codec.py",
        "connect": " ".join([*options.link.connect, *options.link.listen]),
    }
    tape = Tape(options.out, metadata, options.each_s)
    taken = Taken(monotonic_ns())
    link: Link | None = None
    try:
        async with open_link(options.link, options.robot) as link:
            for topic in options.topics:
                take = partial(_take, tape, taken, topic)
                link.subscribe_keys(topic, take, in_order=IN_ORDER if topic.name == VIDEO.name else 0)
            await until_stopped(
                stop, _wait(options.seconds, tape, lambda: _report_progress(tape, taken, report))
            )
    finally:
        await tape.close()
        overwritten = _overwritten(link)
        write_metrics(_metrics(tape, taken, overwritten))
    _check(options, tape, taken, overwritten)
    summary = f"{options.out}: {taken.words(tape, monotonic_ns()).strip()}"
    if overwritten:
        summary += f"; {overwritten} came too fast to be taken one by one"
    if COMMAND.name not in taken.counts:
        summary += "; no commands: connect to where the master listens too"
    return summary


def _take(tape: Tape, taken: Taken, topic: Topic, key: str, payload: bytes, arrived_ns: int) -> None:
    taken.take(topic, key, payload, arrived_ns)
    if tape.put(key, payload, arrived_ns):
        taken.size += len(payload)


async def _wait(seconds: float | None, tape: Tape, each: Callable[[], None]) -> None:
    loop = asyncio.get_running_loop()
    end_s = None if seconds is None else loop.time() + seconds
    while end_s is None or loop.time() < end_s:
        each()
        await tape.turn()
        await asyncio.sleep(PROGRESS_S if end_s is None else max(0.0, min(PROGRESS_S, end_s - loop.time())))


def _report_progress(tape: Tape, taken: Taken, report: Callable[[str], None]) -> None:
    report(f"recording, {taken.words(tape, monotonic_ns())} (Ctrl-C ends it)")


def _overwritten(link: Link | None) -> int:
    return 0 if link is None else sum(c.overwritten for c in link.counters().values())


def _metrics(tape: Tape, taken: Taken, overwritten: int) -> RecorderMetrics:
    counters = tape.counters()
    return RecorderMetrics(
        recorded=dict(taken.counts),
        files=[path.name for path in tape.files],
        put=counters.put,
        written=counters.written,
        refused=counters.refused,
        lost=counters.lost,
        failed=counters.failed,
        overwritten=overwritten,
        missing=taken.missing,
    )


def _check(options: RecordOptions, tape: Tape, taken: Taken, overwritten: int) -> None:
    counters = tape.counters()
    if counters.failed:
        raise TandemError(
            f"{options.out}: the recording ended early: {counters.failed}; {counters.written} messages are "
            f"in it and can be read, {counters.refused + counters.lost} are not. Make room and record again"
        )
    if counters.refused + counters.lost:
        raise TandemError(
            f"{options.out}: the disk was too slow for {counters.refused + counters.lost} of {counters.put} "
            "messages; they are missing"
        )
    if not taken.counts:
        raise TandemError(
            f"{options.out}: nothing was heard of {options.robot}: is it running, is that its name, and does "
            f"a process listen at {', '.join(options.link.connect) or 'no endpoint'}?"
        )
    missing = missing_in_words(taken.missing)
    if missing and not options.may_miss:
        raise TandemError(
            f"{options.out}: messages are missing by their own numbers: {missing} ({overwritten} of all came "
            "while this recorder was busy; the rest never reached it). What came is in it and can be read; "
            "record nearer to the robot, or on a host with less to do"
        )
