"""Puts all that a process hands to its tap into a recording: sensors' frames, what it sends and hears."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable
from pathlib import Path

import msgpack

from common.clock import NS_PER_S, monotonic_ns, to_s
from common.errors import TandemError
from common.process.runtime import until_stopped
from common.tap.message import GREETING, TapMessage
from common.tap.reader import TapReader
from deploy.ops.record.tape import Tape
from deploy.study.marks import MARK_TOPIC, NOW_TOPIC, NewMarks
from deploy.study.session import Session
from deploy.study.under_way import session_under_way
from master.journal.calls import MISSING

GREETED_S = 5.0
PROGRESS_S = 0.5

log = logging.getLogger(__name__)


async def record_tap(
    path: Path,
    out: Path,
    stop: asyncio.Event,
    report: Callable[[str], None],
    seconds: float | None = None,
    each_s: float | None = None,
    ends_when_failed: bool = False,
    session: Session | None = None,
    study: Path | None = None,
) -> str:
    """Record until `stop` is set, the time is over or the process ends. Returns a summary for people.

    `ends_when_failed`: also once the disk takes nothing any more. `session`: of a study; its marks are
    recorded, and nothing that its subject has not consented to. `study`: its folder, where no session is
    named: whichever session is under way counts. Marks in the folder of `out` are recorded too.
    Raises TandemError where there is no tap, the disk failed, or this process was too slow for the tap.
    """
    with TapReader(path) as reader:
        try:
            first = await asyncio.wait_for(reader.read(), GREETED_S)
        except TimeoutError:
            raise TandemError(f"{path}: it says nothing; is it a tap of tandem?") from None
        head = {**_greeting(path, first), **(session.metadata() if session is not None else {})}
        marking = _Marking(out.parent, session, study)
        taking = _Taking(reader, Tape(out, head, each_s), report, ends_when_failed, marking)
        try:
            await until_stopped(stop, taking.run(seconds))
        finally:
            await taking.tape.close()
    return taking.end(out)


def _greeting(path: Path, message: TapMessage) -> dict[str, str]:
    try:
        table = msgpack.unpackb(message.payload)
        if message.topic != GREETING or not all(isinstance(text, str) for text in table.values()):
            raise ValueError
    except Exception:  # msgpack raises its own family
        raise TandemError(f"{path}: it does not say who sends; is it a tap of this version?") from None
    return dict(table)


class _Marking:
    """What is recorded of the study: marks as they come, and once a second which session and step it is."""

    def __init__(self, folder: Path, session: Session | None, study: Path | None) -> None:
        """`folder`: of the recording; marks are written there where no session is under way."""
        self._named = session
        self._session = session
        self._study = study
        self._marks = NewMarks(folder if session is None else session.path, session is not None)
        self._of_session: NewMarks | None = None
        self._now_ns = -NS_PER_S
        self._doubt = ""
        """Why it is not known whether a session is under way; empty where it is."""

    def may_record(self, topic: str) -> bool:
        """Whether the subject has consented to what a topic holds; True without a session."""
        if "/video/" in topic and self._named is None and self._study is not None:
            # at each picture: a session without video may have begun since the last look for marks
            self._look_for_session(self._study)
        if self._doubt:
            return "/video/" not in topic
        return self._session is None or self._session.may_record(topic)

    def take(self, now_ns: int) -> list[tuple[str, bytes, int]]:
        """Topic, content and time of what is new."""
        if self._named is None and self._study is not None:
            self._look_for_session(self._study)
        out = [
            (MARK_TOPIC, mark.line().encode(), mark.monotonic_ns)
            for source in (self._marks, self._of_session)
            if source is not None
            for mark in source.take()
        ]
        if self._session is not None and now_ns - self._now_ns >= NS_PER_S:
            self._now_ns = now_ns
            head = self._session.head
            who = {"subject": head.subject, "session": head.session, "scope": list(head.scope)}
            now = {**who, "step": self._session.step}
            out.append((NOW_TOPIC, json.dumps(now).encode(), now_ns))
        return out

    def _look_for_session(self, study: Path) -> None:
        try:
            self._turn_to(session_under_way(study))
            self._doubt = ""
        except TandemError as error:
            if str(error) != self._doubt:
                log.warning("%s; no pictures are recorded until it can be read", error)
            self._doubt = str(error)

    def _turn_to(self, session: Session | None) -> None:
        if (session and session.path) != (self._session and self._session.path):
            self._session = session
            self._of_session = None if session is None else NewMarks(session.path, all_of_them=True)


class _Taking:
    """One recording under way."""

    def __init__(
        self,
        reader: TapReader,
        tape: Tape,
        report: Callable[[str], None],
        ends_when_failed: bool,
        marking: _Marking,
    ) -> None:
        self._marking = marking
        self._ends_when_failed = ends_when_failed
        self.tape = tape
        self._reader = reader
        self._report = report
        self._since_ns = monotonic_ns()
        self._counts: dict[str, int] = {}
        self._missed = 0
        self._ended = ""

    async def run(self, seconds: float | None) -> None:
        """Until the time is over, the process has gone, or the task is cancelled."""
        progress = asyncio.create_task(self._progress())
        try:
            async with asyncio.timeout(seconds):
                while not (self._ends_when_failed and self.tape.failed):
                    self._take(await self._reader.read())
        except TimeoutError:
            pass
        except TandemError as error:
            self._ended = str(error)
        finally:
            progress.cancel()
            self._take_marks()

    def _take(self, message: TapMessage) -> None:
        if self._reader.missed > self._missed:
            self._missed = self._reader.missed
            self.tape.put(MISSING, b"", message.stamp_ns)
        if not self._marking.may_record(message.topic):
            return
        self._counts[message.topic] = self._counts.get(message.topic, 0) + 1
        self.tape.put(message.topic, message.payload, message.stamp_ns)

    async def _progress(self) -> None:
        while True:
            self._report(f"recording, {self._words()} (Ctrl-C ends it)")
            self._take_marks()
            await self.tape.turn()
            await asyncio.sleep(PROGRESS_S)

    def _take_marks(self) -> None:
        for topic, payload, at_ns in self._marking.take(monotonic_ns()):
            self.tape.put(topic, payload, at_ns)

    def _words(self) -> str:
        elapsed_s = max(1e-3, to_s(monotonic_ns() - self._since_ns))
        rates = ", ".join(f"{name} {count / elapsed_s:.1f} Hz" for name, count in self._counts.items())
        missed = f"; MISSING: {self._missed}" if self._missed else ""
        failed = f"; NOT WRITTEN: {self.tape.failed}" if self.tape.failed else ""
        return f"{elapsed_s:.1f} s: {rates or 'nothing is heard yet'}{missed}{failed}"

    def end(self, out: Path) -> str:
        """The summary. Raises TandemError where the recording is not whole."""
        counters = self.tape.counters()
        if counters.failed or counters.refused + counters.lost:
            why = counters.failed or "the disk was too slow"
            raise TandemError(
                f"{out}: {why}: {counters.written} messages are in it and can be read, "
                f"{counters.refused + counters.lost} are not. Make room and record again"
            )
        if self._missed:
            raise TandemError(
                f"{out}: this recorder was too slow for {self._missed} messages; what came is in it, and can "
                "be computed again from the next snapshot on. Record on a host with less to do"
            )
        ended = f"; {self._ended}" if self._ended else ""
        return f"{out}: {self._words()}{ended}"
