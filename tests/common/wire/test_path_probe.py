"""Questions of one size, answers of another."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.path_probe import LARGEST_BYTES, answer_probe, probe


@given(st.integers(4, 20_000), st.integers(0, 2**32 - 1))
def test_each_size_is_as_asked_and_the_answer_is_bounded(question: int, answer: int) -> None:
    assert len(probe(question, answer)) == question
    assert len(answer_probe(probe(question, answer))) == min(answer, LARGEST_BYTES)


def test_a_question_without_a_size_is_refused() -> None:
    with pytest.raises(CodecError, match="3 bytes, expected 4 or more"):
        answer_probe(b"abc")
