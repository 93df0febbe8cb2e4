from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slave.encoders.as5045 import BITS, COUNT_SHIFT, OUT_OF_RANGE, Flag, at_edge, decode, encode, faults

words = st.integers(0, 2**BITS - 1)
counts = st.integers(0, 4095)
GOOD = [Flag.OCF, Flag.OCF | Flag.MAG_INC, Flag.OCF | Flag.MAG_DEC, Flag.OCF | OUT_OF_RANGE]


def one(word: int) -> Any:
    return decode(np.array([word], np.uint32))


def told(word: int) -> str | None:
    return faults(["elbow"], np.array([word], np.uint32)).get("elbow")


def believable(word: int) -> bool:
    """The datasheet's words, bit by bit, the highest bit first."""
    bits = [int(bit) for bit in f"{word:018b}"]
    ocf, cof, lin = bits[12:15]
    return sum(bits) % 2 == 0 and (ocf, cof, lin) == (1, 0, 0)


def test_the_datasheets_order_of_bits() -> None:
    #            D11 ...      D0 OCF COF LIN INC DEC PAR
    decoded = one(0b100000000001_1_0_0_1_0_0)
    assert decoded.counts[0] == 0b100000000001
    assert decoded.valid[0] == believable(0b100000000001_1_0_0_1_0_0)
    assert decoded.flags[0] == Flag.OCF | Flag.MAG_INC


@given(st.lists(words, min_size=1, max_size=30))
def test_any_word_is_taken_apart_as_the_datasheet_says(sent: list[int]) -> None:
    decoded = decode(np.array(sent, np.uint32))
    assert decoded.counts.tolist() == [word >> 6 for word in sent]
    assert decoded.valid.tolist() == [believable(word) for word in sent]
    assert decoded.counts.dtype == np.int64


@given(counts, st.sampled_from(GOOD))
def test_every_count_comes_back(count: int, flags: Flag) -> None:
    word = int(encode(np.array([count]), flags)[0])
    assert word < 2**BITS
    assert (one(word).counts[0], one(word).valid[0]) == (count, True)


@given(counts, st.sampled_from(GOOD), st.integers(0, BITS - 1))
def test_any_one_bit_that_flips_is_noticed(count: int, flags: Flag, bit: int) -> None:
    word = int(encode(np.array([count]), flags)[0]) ^ 1 << bit
    assert not one(word).valid[0]
    assert told(word)


@given(words)
def test_what_is_not_believed_is_named_and_nothing_else(word: int) -> None:
    assert (told(word) is None) == believable(word)
    assert at_edge(np.array([word], np.uint32))[0] == (f"{word:018b}"[15:17] == "11")


@pytest.mark.parametrize("word", [0, 2**BITS - 1])
def test_a_line_that_is_cut_is_not_believed(word: int) -> None:
    assert not one(word).valid[0]
    assert told(word) == "the encoder does not answer"


@pytest.mark.parametrize("word", [1 << 18, 1 << 31, (1 << 18) + 2**17])
def test_more_than_18_bits_are_not_believed(word: int) -> None:
    word |= int(encode(np.array([5]))[0])
    assert not one(word).valid[0]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (Flag(0), "(OCF)"),
        (Flag.OCF | Flag.COF, "(COF)"),
        (Flag.OCF | Flag.LIN, "(LIN)"),
        (Flag.OCF | Flag.LIN | OUT_OF_RANGE, "(LIN)"),
    ],
)
def test_each_flag_in_words(flags: Flag, said: str) -> None:
    assert said in (told(int(encode(np.array([1234]), flags)[0])) or "")


@pytest.mark.parametrize("flags", GOOD)
def test_a_magnet_that_moves_within_its_range_is_well(flags: Flag) -> None:
    assert told(int(encode(np.array([7]), flags)[0])) is None


def test_only_the_sick_are_named() -> None:
    sent = encode(np.array([1, 2, 3]))
    sent[1] ^= 1
    assert list(faults(["a", "b", "c"], sent)) == ["b"]
    assert "parity" in faults(["a", "b", "c"], sent)["b"]
    assert COUNT_SHIFT == 6
