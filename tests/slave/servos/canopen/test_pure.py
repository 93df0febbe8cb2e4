"""Words, state machine, packing and transfers: each against the standard's tables or another's code."""

from __future__ import annotations

import struct
from typing import Any

import canopen
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deploy.sim.drives.machine import after, statusword
from deploy.sim.drives.wire import EDS, Wire
from slave.servos.canopen import pdo
from slave.servos.canopen.answers import SyncAnswers
from slave.servos.canopen.cia402 import _PATTERNS, FAULT_RESET, Power, power, towards_enabled
from slave.servos.canopen.emergency import emergency
from slave.servos.canopen.sdo import Read, Write, answer, request

QUICK = settings(max_examples=60, deadline=None, derandomize=True)


def test_no_statusword_tells_two_states() -> None:
    for word in range(1 << 16):
        matching = [state for mask, value, state in _PATTERNS if word & mask == value]
        assert len(matching) <= 1
        assert power(word) == (matching[0] if matching else None)


@pytest.mark.parametrize("state", list(Power))
def test_a_state_is_told_and_understood(state: Power) -> None:
    assert power(statusword(state)) is state


@pytest.mark.parametrize("state", list(Power))
@pytest.mark.parametrize("reset", [True, False])
def test_the_way_to_enabled(state: Power, reset: bool) -> None:
    seen, last = [state], 0x00
    for _ in range(8):
        word = towards_enabled(seen[-1], last, reset)
        seen.append(after(seen[-1], word, last))
        last = word
    stays = state in (Power.NOT_READY, Power.FAULT_REACTION) or (state is Power.FAULT and not reset)
    assert seen[-1] is (state if stays else Power.ENABLED)
    if state is Power.QUICK_STOP:
        # never let go on the way
        assert set(seen) == {Power.QUICK_STOP, Power.ENABLED}


@QUICK
@given(st.sampled_from(list(Power)), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_no_controlword_leads_out_of_fault_but_a_reset_s_edge(state: Power, word: int, last: int) -> None:
    then = after(state, word, last)
    if state is Power.FAULT:
        edge = bool(word & FAULT_RESET) and not last & FAULT_RESET
        assert then is (Power.SWITCH_ON_DISABLED if edge else Power.FAULT)
    if state not in (Power.SWITCHED_ON, Power.ENABLED, Power.QUICK_STOP):
        assert then is not Power.ENABLED


@QUICK
@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1)), min_size=1, max_size=40))
def test_targets_are_packed_as_struct_packs_them(rows: list[tuple[int, int]]) -> None:
    words, targets = zip(*rows, strict=True)
    packed = pdo.pack_targets(np.array(words, np.uint16), np.array(targets, np.int32))
    assert packed == [struct.pack("<Hi", *row) for row in rows]


@QUICK
@given(
    st.lists(
        st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1)),
        min_size=1,
        max_size=30,
    ),
    st.randoms(use_true_random=False),
)
def test_answers_in_any_order_are_read_as_struct_reads_them(rows, random) -> None:  # type: ignore[no-untyped-def]
    answers = SyncAnswers(len(rows))
    order = list(range(len(rows)))
    random.shuffle(order)
    for done, i in enumerate(order):
        assert not answers.complete
        assert answers.of(0).fresh.sum() == done
        assert answers.take(i, struct.pack("<HHi", *rows[i]))
        assert answers.take(i, struct.pack("<HHi", *rows[i]))
    assert answers.complete
    read = answers.of(7)
    columns = (read.statusword.tolist(), read.encoder_counts.tolist(), read.position.tolist())
    assert list(zip(*columns, strict=True)) == [(s, word & 0x0FFF, p) for s, word, p in rows]
    assert read.encoder_valid.tolist() == [word & 0xC000 == 0 for _, word, _ in rows]
    assert read.synced_ns == 7
    answers.begin()
    assert not answers.complete
    assert not answers.of(0).fresh.any()


@QUICK
@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.binary(max_size=20))
def test_an_emergency_is_words_whatever_it_says(code: int, register: int, rest: bytes) -> None:
    said = emergency(struct.pack("<HB", code, register) + rest)
    if len(rest) != 5:
        assert said is None
        return
    assert said is not None
    assert f"{code:04X}" in said.words
    assert said.over == (code == 0)


class Served:
    """An SDO server by the `canopen` library, and what it answers."""

    def __init__(self) -> None:
        self.said: list[bytes] = []
        self.node: Any = canopen.LocalNode(5, str(EDS))
        self.node.associate_network(Wire(lambda _, data: self.said.append(data)))

    def ask(self, transfer: Read | Write) -> bytes:
        self.said.clear()
        self.node.sdo.on_request(0x605, request(transfer), 0.0)
        (answered,) = self.said
        return answered


SIGNED = {0x607A: 4, 0x605A: 2, 0x6060: 1}


@QUICK
@given(st.sampled_from(sorted(SIGNED)), st.integers(-(2**31), 2**31 - 1))
def test_what_is_written_is_what_the_library_s_server_holds(index: int, value: int) -> None:
    served, size = Served(), SIGNED[index]
    half = 1 << 8 * size - 1
    value = (value + half) % (2 * half) - half
    transfer = Write(index, 0, size, value)
    said = answer(transfer, served.ask(transfer))
    assert said is not None
    assert said.done
    assert served.node.sdo[index].raw == value
    mask = 2 * half - 1
    read = Read(index, 0, mask, value & mask, "the value")
    answered = served.ask(read)
    assert answer(read, answered) is not None
    assert answer(read, answered).done  # type: ignore[union-attr]
    wrong = Read(index, 0, mask, ~value & mask, "another value")
    assert "another value expected" in answer(wrong, answered).words  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("transfer", "words"),
    [
        (Write(0x5000, 0, 4, 1), "object 5000:0: there is no such object"),
        (Write(0x1018, 9, 4, 1), "object 1018:9: there is no such subindex"),
        (Write(0x6041, 0, 2, 1), "object 6041:0: cannot be written"),
        (Write(0x607A, 0, 2, 1), "object 607A:0: wrong length"),
    ],
)
def test_what_the_library_s_server_refuses_is_told(transfer: Write, words: str) -> None:
    said = answer(transfer, Served().ask(transfer))
    assert said is not None
    assert (said.done, said.words) == (False, words)


@QUICK
@given(st.binary(max_size=10))
def test_any_bytes_are_an_answer_or_none(data: bytes) -> None:
    for transfer in (Write(0x6060, 0, 1, 8), Read(0x1000, 0, 0xFFFF, 402, "a drive")):
        said = answer(transfer, data)
        assert said is None or data[1:4] == request(transfer)[1:4]
