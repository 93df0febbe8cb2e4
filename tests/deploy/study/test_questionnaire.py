"""Questionnaires: scores by hand, what is no answer, and the table of a study."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError, TandemError
from deploy.examples import profiles
from deploy.study.answers import answers_in, as_table, give_answers
from deploy.study.marks import MarkKind
from deploy.study.protocol import load_protocol
from deploy.study.questionnaire import Answers, load_questionnaire, questionnaire_names
from deploy.study.session import begin

CUP = Path(profiles.__file__).parent / "study" / "cup.toml"
TLX, SUS = load_questionnaire("nasa-tlx"), load_questionnaire("sus")


def sus(*values: int) -> Answers:
    return {f"s{i + 1}": value for i, value in enumerate(values)}


@pytest.mark.parametrize(
    ("values", "score"),
    [
        ([5, 1] * 5, 100.0),
        ([1, 5] * 5, 0.0),
        ([3] * 10, 50.0),
        ([4, 2, 4, 2, 4, 2, 4, 2, 4, 2], 75.0),
        ([5, 2, 4, 1, 5, 2, 4, 1, 5, 2], 87.5),  # 4+3+3+4+4+3+3+4+4+3 = 35
    ],
)
def test_sus_is_scored_as_its_author_says(values: list[int], score: float) -> None:
    assert SUS.scored(SUS.check(sus(*values))) == score


@given(st.lists(st.integers(0, 20), min_size=6, max_size=6))
def test_raw_tlx_is_the_mean_of_six_scales(steps: list[int]) -> None:
    answers = {item.id: 5 * value for item, value in zip(TLX.item, steps, strict=True)}
    assert TLX.scored(TLX.check(answers)) == pytest.approx(5 * sum(steps) / 6)
    assert 0.0 <= TLX.scored(answers) <= 100.0


@pytest.mark.parametrize("value", [-5, 105, 33, 50.0, "50", True, None])
def test_what_is_no_answer_is_named_by_its_item(value: object) -> None:
    answers = {**{item.id: 50 for item in TLX.item}, "effort": value}
    with pytest.raises(TandemError, match="nasa-tlx, effort: expected 0 to 100 in steps of 5"):
        TLX.check(answers)
    del answers["effort"]
    with pytest.raises(TandemError, match="effort"):
        TLX.check(answers)
    with pytest.raises(TandemError, match="no item 'dance'"):
        TLX.check({**dict.fromkeys((item.id for item in TLX.item), 50), "dance": 1})


def test_each_has_words_in_both_languages_and_names_its_source() -> None:
    for name in questionnaire_names():
        asked = load_questionnaire(name)
        assert "own" in asked.source
        for words in (
            asked.title,
            *(part for item in asked.item for part in (item.text, item.low, item.high)),
        ):
            assert words.keys() == {"en", "zh"}, name
    assert len(TLX.item) == 6
    assert len(SUS.item) == 10


def test_a_protocol_names_questionnaires_that_there_are(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(CUP.read_text("utf-8").replace("nasa-tlx", "nasa"), "utf-8")
    with pytest.raises(ConfigError, match=r"step\.questionnaire = 'nasa'.*nasa-tlx, sus"):
        load_protocol(path)
    with pytest.raises(TandemError, match="expected a questionnaire"):
        load_questionnaire("nasa")


def test_answers_are_a_table_with_scores_computed_anew(tmp_path: Path) -> None:
    for subject in ("k7pd", "b2fh"):
        session = begin(tmp_path, CUP, subject)
        session.next_step()
        assert give_answers(session, "sus", sus(*[4] * 10)) == 50.0
    session.mark(MarkKind.EVENT, "no answers")
    rows = [line.split(",") for line in as_table(answers_in(tmp_path)).splitlines()]
    assert rows[0] == ["subject", "session", "step", "questionnaire", "item", "value", "score"]
    assert [row[0] for row in rows[1:]] == ["b2fh"] * 10 + ["k7pd"] * 10
    assert rows[1] == ["b2fh", "01", "rest", "sus", "s1", "4", "50"]
    session.mark(MarkKind.ANSWERS, "{}")
    with pytest.raises(TandemError, match="damaged"):
        answers_in(tmp_path)
