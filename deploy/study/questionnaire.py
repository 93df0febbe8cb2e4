"""Questionnaires: their items from a table, a check of the answers, and the score. Pure but for the table."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Literal

from pydantic import Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import TandemError

FOLDER = Path(__file__).parent / "questionnaires"
Answers = dict[str, int]
"""By the item's id."""
_AGREES = {"en": "agree", "zh": "同意"}
_DISAGREES = {"en": "disagree", "zh": "不同意"}


class QuestionItem(Section):
    """One `[[item]]`."""

    id: str = Field(pattern=r"^[a-z0-9_]{1,20}$")
    text: dict[str, str]
    """By language: en, zh."""
    low: dict[str, str] = Field(default_factory=lambda: dict(_DISAGREES))
    """What the lowest number means."""
    high: dict[str, str] = Field(default_factory=lambda: dict(_AGREES))


class Questionnaire(Section):
    """One file."""

    name: str
    title: dict[str, str]
    source: str
    """Where the instrument comes from, and whose words these are."""
    lowest: int
    highest: int
    step: int = Field(ge=1)
    score: Literal["mean", "sus"]
    item: list[QuestionItem] = Field(min_length=1)

    def check(self, answers: object) -> Answers:
        """The answers, one to each item. Raises TandemError with the item that is wrong."""
        if not isinstance(answers, Mapping):
            raise TandemError(f"{self.name}: expected answers by item")
        known = [item.id for item in self.item]
        for name in answers:
            if name not in known:
                raise TandemError(f"{self.name}: there is no item {str(name)[:20]!r}")
        for name in known:
            value = answers.get(name)
            if type(value) is not int or value not in range(self.lowest, self.highest + 1, self.step):
                raise TandemError(
                    f"{self.name}, {name}: expected {self.lowest} to {self.highest} in steps of {self.step}"
                )
        return {name: answers[name] for name in known}

    def scored(self, answers: Answers) -> float:
        """From 0 to 100. NASA-TLX: the mean, more is more load. SUS: more is better."""
        values = [answers[item.id] for item in self.item]
        if self.score == "mean":
            return fmean(values)
        # the statements speak for the system and against it in turn
        points = (value - 1 if i % 2 == 0 else 5 - value for i, value in enumerate(values))
        return 2.5 * sum(points)


@cache
def questionnaire_names() -> tuple[str, ...]:
    """Those that there are."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


@cache
def load_questionnaire(name: str) -> Questionnaire:
    """Raises TandemError where there is none of that name."""
    if name not in questionnaire_names():
        raise TandemError(f"{name!r}: expected a questionnaire: {', '.join(questionnaire_names())}")
    return load_config(FOLDER / f"{name}.toml", Questionnaire)
