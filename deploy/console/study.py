"""What the page shows and asks of the study's session that is under way: steps, marks, questionnaires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from common.clock import to_s
from common.errors import TandemError
from deploy.study.answers import answers_of, give_answers
from deploy.study.marks import MarkKind, write_mark
from deploy.study.protocol import ProtocolStep
from deploy.study.questionnaire import load_questionnaire, questionnaire_names
from deploy.study.session import Session
from deploy.study.under_way import session_under_way

LONGEST = 200
"""Characters of a mark."""


@dataclass(frozen=True, slots=True)
class StudyDesk:
    """The study's folder, and that of the recordings, as far as this host has them."""

    root: Path | None = None
    """None: no session is led from the page."""
    recordings: Path | None = None
    """`[recording] folder`: where marks go while no session is under way."""

    def mark(self, text: str) -> str:
        """Note an event; where it is noted, in words. Raises TandemError where it cannot be written."""
        text = text[:LONGEST]
        session = self._session()
        try:
            if session is not None:
                session.mark(MarkKind.EVENT, text)
                return f"noted in session {session.head.session} of {session.head.subject}"
            if self.recordings is not None:
                write_mark(self.recordings, MarkKind.EVENT, text)
                return "noted in this host's recordings"
        except OSError as error:
            raise TandemError(f"the mark cannot be written: {error.strerror}") from None
        return "noted on every page of this console, and in no recording: [recording] folder is not set"

    def act(self, body: Mapping[str, object]) -> str:
        """Begin the next step, end the session, or take answers; words for the person. Raises TandemError."""
        session = self._session()
        if session is None:
            raise TandemError("no session is under way: `tandem session start` begins one")
        match body.get("do"):
            case "next":
                begun = session.next_step()
                return "all steps have begun" if begun is None else f"step {begun}"
            case "end":
                session.mark(MarkKind.END, "page")
                return "the session has ended"
            case "answers":
                score = give_answers(session, str(body.get("questionnaire")), body.get("answers"))
                return f"kept; score {score:g}"
            case other:
                raise TandemError(f"do: expected next, end or answers, not {str(other)[:20]!r}")

    def shown(self, now_ns: int) -> dict[str, object] | None:
        """As the page has it; None without a session."""
        try:
            session = self._session()
            return None if session is None else _shown(session, now_ns)
        except TandemError:
            return None

    def _session(self) -> Session | None:
        return None if self.root is None else session_under_way(self.root)


def _shown(session: Session, now_ns: int) -> dict[str, object]:
    begun = [mark for mark in session.marks() if mark.kind is MarkKind.STEP]
    steps = {step.name: step for step in session.steps}
    here = steps.get(begun[-1].text) if begun else None
    left = session.steps_left
    return {
        "subject": session.head.subject,
        "session": session.head.session,
        "protocol": session.protocol.name,
        "step": None if here is None else _step(here),
        "since_s": round(to_s(now_ns - begun[-1].monotonic_ns), 1) if begun else None,
        "next": _step(left[0]) if left else None,
        "done": len(begun),
        "steps": len(session.steps),
        "answered": [[one.step, one.questionnaire] for one in answers_of(session)],
    }


def _step(step: ProtocolStep) -> dict[str, object]:
    return {
        "name": step.name,
        "text": step.text,
        "seconds": step.seconds,
        "questionnaire": step.questionnaire,
    }


def questionnaires() -> dict[str, object]:
    """All of them, for the page: items with their words in each language."""
    return {
        name: load_questionnaire(name).model_dump(exclude={"score", "name"}) for name in questionnaire_names()
    }
