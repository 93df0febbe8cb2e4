"""Answers to questionnaires as a session keeps them, and all of a study's as one table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from common.errors import TandemError
from deploy.study.marks import MarkKind
from deploy.study.questionnaire import Answers, load_questionnaire
from deploy.study.session import SESSION, Session

COLUMNS = ("subject", "session", "step", "questionnaire", "item", "value", "score")


@dataclass(frozen=True, slots=True)
class GivenAnswers:
    """One questionnaire, answered once."""

    subject: str
    session: str
    step: str
    questionnaire: str
    answers: Answers

    @property
    def score(self) -> float:
        """Computed from the answers, whatever was shown."""
        return load_questionnaire(self.questionnaire).scored(self.answers)


def give_answers(session: Session, questionnaire: str, answers: object) -> float:
    """Write the answers into the session's marks; their score.

    Raises TandemError where they are none to this questionnaire, or the session has ended.
    """
    asked = load_questionnaire(questionnaire)
    checked = asked.check(answers)
    told = {"questionnaire": questionnaire, "step": session.step, "answers": checked}
    session.mark(MarkKind.ANSWERS, json.dumps(told))
    return asked.scored(checked)


def answers_of(session: Session) -> Iterator[GivenAnswers]:
    """All of a session, in their order. Raises TandemError where some are damaged."""
    for mark in session.marks():
        if mark.kind is not MarkKind.ANSWERS:
            continue
        try:
            told = json.loads(mark.text)
            name, step = str(told["questionnaire"]), str(told["step"])
            checked = load_questionnaire(name).check(told["answers"])
        except (ValueError, KeyError, TypeError):
            raise TandemError(f"{session.path}: a mark of answers is damaged") from None
        yield GivenAnswers(session.head.subject, session.head.session, step, name, checked)


def answers_in(root: Path) -> list[GivenAnswers]:
    """All of a study, by subject and session. Raises TandemError."""
    folders = sorted(path.parent for path in root.glob(f"sub-*/ses-*/{SESSION}"))
    return [given for folder in folders for given in answers_of(Session(folder))]


def as_table(found: Sequence[GivenAnswers]) -> str:
    """CSV, a row an item; the questionnaire's score stands in each of its rows."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for given in found:
        for item, value in given.answers.items():
            head = (given.subject, given.session, given.step, given.questionnaire)
            writer.writerow((*head, item, value, f"{given.score:g}"))
    return out.getvalue()
