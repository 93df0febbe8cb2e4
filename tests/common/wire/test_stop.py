"""The stop's bytes, for ever: whoever changes one of these makes a robot that another version cannot stop."""

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire.codec import VERSION, encode
from common.wire.messages import Action, ControlRequest
from common.wire.stop import StopAnswer, pack_stop, pack_stop_answer, read_stop, read_stop_answer

REQUEST = bytes.fromhex("98a7636f6e74726f6c02a7726f626f742d31a56573746f70a76e757273652d31a00000")
ANSWER = bytes.fromhex("97aa636f6e74726f6c6c656402c3a56573746f70a773746f70706564ceabcdef1200")
ANSWER_2 = bytes.fromhex("97aa636f6e74726f6c6c656402c3a56573746f70a773746f707065640000")
"""What a robot of schema 2 answers."""


def test_the_bytes_are_as_they_always_were() -> None:
    assert pack_stop("robot-1", "nurse-1") == REQUEST
    assert pack_stop_answer(StopAnswer(True, "estop", "stopped", 0xABCDEF12)) == ANSWER


def test_they_are_read_as_they_always_were() -> None:
    assert read_stop(REQUEST) == "nurse-1"
    assert read_stop_answer(ANSWER) == StopAnswer(True, "estop", "stopped", 0xABCDEF12)
    assert read_stop_answer(ANSWER_2) == StopAnswer(True, "estop", "stopped", 0)


@pytest.mark.parametrize("version", [1, 2, VERSION, VERSION + 1, 99, -1, "7", None])
def test_a_stop_of_any_version_is_read_with_whatever_follows(version: object) -> None:
    for more in ([], ["nurse-1"], ["nurse-1", "", 0, 0, {"later": 1}, None]):
        payload = msgpack.packb(["control", version, "robot-1", "estop", *more])
        assert read_stop(payload) == ("nurse-1" if more else "")


def test_the_codec_s_own_form_of_a_stop_is_one_too() -> None:
    assert read_stop(encode(ControlRequest("r", Action.ESTOP, "anna"))) == "anna"


@pytest.mark.parametrize("action", sorted(set(Action) - {Action.ESTOP}))
def test_nothing_else_is_a_stop(action: Action) -> None:
    assert read_stop(encode(ControlRequest("r", action, "estop"))) is None


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, "control"), (1, 3), (1, "2"), (2, 1), (2, None), (3, 1), (4, b"text"), (5, -1), (5, "1"), (6, None)],
)
def test_only_a_true_answer_counts_as_one(place: int, value: object) -> None:
    fields = ["controlled", 2, True, "estop", "stopped", 1, 0]
    assert read_stop_answer(msgpack.packb(fields)) is not None
    fields[place] = value
    changed = read_stop_answer(msgpack.packb(fields))
    assert changed is None or place == 6  # the last field is kept for later


@pytest.mark.parametrize("answer", [StopAnswer(False, "estop", ""), StopAnswer(True, "track", "")])
def test_stopped_is_done_and_in_the_e_stop(answer: StopAnswer) -> None:
    assert not answer.stopped
    assert StopAnswer(True, "estop", "").stopped


@given(st.binary(max_size=200))
def test_no_bytes_raise(payload: bytes) -> None:
    read_stop(payload)
    read_stop_answer(payload)


@given(st.text(max_size=200), st.text(max_size=200))
def test_whatever_somebody_is_called_he_can_stop(robot: str, operator: str) -> None:
    assert read_stop(pack_stop(robot + "\ud800", operator + "\ud800")) is not None
