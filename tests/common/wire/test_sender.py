from __future__ import annotations

import pytest
import zenoh
from hypothesis import example, given
from hypothesis import strategies as st

from common.wire.sender import operator_chunk, operator_of
from common.wire.topics import COMMAND, CONTROL, STATE


@given(st.text(max_size=64))
@example("-")
@example("nurse 1/ward*2?#$@")
@example("Zoë")
@example("{robot}")
def test_every_name_comes_back_from_its_keys(name: str) -> None:
    for topic in (COMMAND, CONTROL):
        key = topic.of(name).key_for("robot-1")
        assert operator_of(str(zenoh.KeyExpr(key))) == name.encode("utf-8", "replace").decode()


@given(st.text(max_size=8), st.text(max_size=8))
def test_two_names_never_share_a_key(one: str, other: str) -> None:
    assert (operator_chunk(one) == operator_chunk(other)) == (one == other)


@pytest.mark.parametrize(
    "key",
    [
        "tandem/r/operator/%61nna/command", "tandem/r/operator/*/command", "tandem/r/operator/**",
        "tandem/r/operator/%zz/command", "tandem/r/operator/%FF/command", "tandem/r/operator/a b/command",
        "tandem/r/operator/anna", "tandem/r/operator/anna/command/x", "tandem/r/command", "x/r/operator/a/b",
        "tandem/r/operator//command", "tandem/r/operator/%2d/command", STATE.key_for("r"), "", "**",
    ],
)  # fmt: skip
def test_no_other_spelling_is_anybody_s_key(key: str) -> None:
    assert operator_of(key) is None


def test_nobody_is_no_name_that_a_person_can_bear() -> None:
    assert operator_of(COMMAND.of("").key_for("r")) == ""
    assert operator_of(COMMAND.of("-").key_for("r")) == "-"
