"""Signals of any length, byte order and sign are read as cantools reads them."""

from __future__ import annotations

import struct

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from master.capture.bits import IntegerField, Placed, SignalReader, wrong_with


def message(signals: list[str], length: int) -> cantools.database.can.Message:
    text = f'VERSION ""\nBU_: N\nBO_ 100 M: {length} N\n' + "\n".join(signals) + "\n"
    database = cantools.database.can.Database()
    database.add_dbc_string(text)
    return database.messages[0]


def reader(described: cantools.database.can.Message, length: int) -> SignalReader:
    return SignalReader([Placed(signal) for signal in described.signals], length)


def line(
    name: str, start: int, bits: int, little: bool, signed: bool, scale: str = "1", offset: str = "0"
) -> str:
    return f' SG_ {name} : {start}|{bits}@{int(little)}{"-" if signed else "+"} ({scale},{offset}) [0|0] "" N'


@settings(deadline=None, max_examples=60)
@given(
    bits=st.integers(1, 52),
    little=st.booleans(),
    signed=st.booleans(),
    where=st.integers(0, 63),
    data=st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=5),
)
def test_a_signal_is_read_as_cantools_reads_it(
    bits: int, little: bool, signed: bool, where: int, data: list[bytes]
) -> None:
    first = where % (65 - bits)
    # the DBC numbers a big-endian signal by its highest bit, in the bytes' own counting
    start = first if little else 8 * (first // 8) + 7 - first % 8
    described = message([line("S", start, bits, little, signed, "0.5", "-3")], 8)
    read = reader(described, 8).read(b"".join(data))
    assert read[:, 0].tolist() == [described.decode_simple(frame)["S"] for frame in data]
    if not signed:
        raw = described.decode_simple(data[0], scaling=False)["S"]
        assert IntegerField(described.signals[0]).read(data[0]) == raw


@given(value=st.floats(width=32, allow_nan=False), big=st.booleans())
def test_floats_are_read(value: float, big: bool) -> None:
    text = line("S", 7 if big else 0, 32, not big, True) + "\nSIG_VALTYPE_ 100 S : 1;"
    described = message([text], 8)
    frame = struct.pack(">f" if big else "<f", value) + bytes(4)
    assert reader(described, 8).read(frame)[0, 0] == value


@pytest.mark.parametrize(("bits", "fits"), [(52, True), (53, False)])
def test_integers_beyond_a_double_are_refused(bits: int, fits: bool) -> None:
    (signal,) = message([line("S", 0, bits, little=True, signed=False)], 8).signals
    assert (wrong_with(signal) is None) is fits


def test_many_signals_at_once() -> None:
    lines = [line(f"S{k}", 8 * k, 8, little=True, signed=bool(k % 2)) for k in range(8)]
    described = message(lines, 8)
    frames = [bytes(np.random.default_rng(k).integers(0, 256, 8).tolist()) for k in range(4)]
    names = [signal.name for signal in described.signals]
    expected = [[described.decode_simple(frame)[name] for name in names] for frame in frames]
    assert reader(described, 8).read(b"".join(frames)).tolist() == expected
