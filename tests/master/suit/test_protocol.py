from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError
from master.suit.crc import frame_crc
from master.suit.nodes import NodeConfig
from master.suit.protocol import (
    CLASSIC_MESSAGES,
    FD_MESSAGES,
    NO_VALUE,
    READINGS,
    SHIPPED_DBC,
    SuitProtocol,
)

PROTOCOL = SuitProtocol.load()
DATABASE: Any = cantools.database.load_file(SHIPPED_DBC)

counts = st.lists(st.integers(-32768, 32767), min_size=9, max_size=9).map(lambda c: np.array(c, np.int16))
node_ids = st.integers(1, 127)
ticks = st.integers(0, 2**40)
statuses = st.integers(0, 3)


def messages(fd: bool) -> tuple[str, ...]:
    return FD_MESSAGES if fd else CLASSIC_MESSAGES


@pytest.mark.parametrize("fd", [True, False], ids=["fd", "classic"])
@given(raw=counts, node_id=node_ids, tick=ticks, status=statuses)
def test_answers_are_encoded_as_cantools_does(
    fd: bool, raw: np.ndarray, node_id: int, tick: int, status: int
) -> None:
    frames = PROTOCOL.encode_sample(node_id, raw, tick, status, fd)
    assert len(frames) == len(messages(fd))
    for frame, name in zip(frames, messages(fd), strict=True):
        message = DATABASE.get_message_by_name(name)
        signals = dict(zip(READINGS, raw.tolist(), strict=True))
        signals = {s.name: signals[s.name] for s in message.signals if s.name in signals}
        crc = frame_crc(message.frame_id + node_id, frame.data[:-1])
        tick_bits = message.get_signal_by_name("TICK").length
        signals |= {"TICK": tick % 2**tick_bits, "STATUS": status, "CRC": crc}
        assert frame.data == message.encode(signals, scaling=False, strict=False)
        assert frame.id == message.frame_id + node_id
        assert frame.fd == message.is_fd == fd


@pytest.mark.parametrize("fd", [True, False], ids=["fd", "classic"])
@given(data=st.data())
def test_batches_are_decoded_as_cantools_does_message_by_message(fd: bool, data: st.DataObject) -> None:
    form = PROTOCOL.answer_format(fd)
    frames = data.draw(
        st.lists(st.binary(min_size=form.length, max_size=form.length), min_size=1, max_size=40)
    )
    for part, name in zip(form.parts, messages(fd), strict=True):
        decoded = part.decode(b"".join(frames))
        readings = [s for s in READINGS if s in {x.name for x in DATABASE.get_message_by_name(name).signals}]
        for row, frame in enumerate(frames):
            raw = DATABASE.decode_message(name, frame, decode_choices=False, scaling=False)
            assert decoded.raw[row].tolist() == [raw[s] for s in readings]
            assert decoded.tick[row] == raw["TICK"]
            assert decoded.status[row] == raw["STATUS"]
            scaled = DATABASE.decode_message(name, frame, decode_choices=False)
            assert (decoded.raw[row] * part.scale).tolist() == [scaled[s] for s in readings]


def test_units_are_those_of_the_sensors() -> None:
    assert pytest.approx(9.80665 / 4096, rel=1e-9) == PROTOCOL.acc_scale
    assert pytest.approx(np.radians(2000) / 32768, rel=1e-9) == PROTOCOL.gyr_scale
    assert pytest.approx(100 / 1090, rel=1e-9) == PROTOCOL.mag_scale


@given(tick=ticks)
def test_a_sync_tells_its_tick(tick: int) -> None:
    frame = PROTOCOL.sync(tick)
    assert frame.id == 0x080
    assert not frame.fd
    assert PROTOCOL.parse_sync(frame.data) == tick % 2**32
    assert DATABASE.decode_message("SYNC", frame.data) == {"TICK": tick % 2**32}


@pytest.mark.parametrize("length", [0, 3, 5, 8])
def test_a_sync_of_another_length_is_refused(length: int) -> None:
    with pytest.raises(ValueError, match=f"4 bytes, not {length}"):
        PROTOCOL.parse_sync(bytes(length))


def test_answers_have_the_published_identifiers_and_lengths() -> None:
    raw = np.full(9, NO_VALUE, dtype=np.int16)
    assert [(f.id, len(f.data)) for f in PROTOCOL.encode_sample(5, raw, 0, 0, True)] == [(0x105, 24)]
    classic = PROTOCOL.encode_sample(127, raw, 0, 0, False)
    assert [(f.id, len(f.data)) for f in classic] == [(0x27F, 8), (0x2FF, 8), (0x37F, 8)]


def test_no_two_nodes_share_an_identifier() -> None:
    bases = [part.base_id for form in (PROTOCOL.fd, PROTOCOL.classic) for part in form.parts]
    taken = [base + node for base in bases for node in range(1, 128)] + [PROTOCOL.sync_id]
    assert len(set(taken)) == len(taken)
    assert max(taken) <= 0x7FF


WRONG = [
    (r"SG_ ACC_Y : 16\|16@1-", "SG_ ACC_Y : 16|16@1+", "NODE_SAMPLE.ACC_Y: expected 16 signed bits"),
    (r"SG_ CRC : 184\|8@1\+ \(1,0\) \[0\|255\] \"\" MASTER\n", "\n", "NODE_SAMPLE: expected only.*CRC"),
    (r"BA_ \"VFrameFormat\" BO_ 256 14;", "", "NODE_SAMPLE: expected VFrameFormat StandardCAN_FD"),
    (r"BO_ 768 NODE_MAG", "BO_ 768 NODE_COMPASS", "a message 'NODE_MAG'"),
    (r"BO_ 128 SYNC: 4", "BO_ 128 SYNC: 8", "SYNC: expected 4 bytes"),
    (r"0\.091743119266", "0.1", "expected the factors of NODE_ACC, NODE_GYR and NODE_MAG"),
]


@pytest.mark.parametrize(("pattern", "instead", "expected"), WRONG)
def test_a_dbc_that_differs_is_refused_by_name(
    pattern: str, instead: str, expected: str, tmp_path: Path
) -> None:
    text = SHIPPED_DBC.read_text("utf-8")
    changed = re.sub(pattern, instead, text, count=1)
    assert changed != text
    path = tmp_path / "suit.dbc"
    path.write_text(changed, "utf-8")
    with pytest.raises(ConfigError, match=expected) as raised:
        SuitProtocol.load(path)
    assert str(path) in str(raised.value)


def test_a_dbc_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "suit.dbc"
    path.write_text("this is no DBC", "utf-8")
    with pytest.raises(ConfigError, match="a DBC that cantools can read"):
        SuitProtocol.load(path)
    with pytest.raises(ConfigError, match="a readable DBC"):
        SuitProtocol.load(tmp_path / "nowhere.dbc")


def test_a_field_that_moves_in_the_dbc_moves_on_the_wire(tmp_path: Path) -> None:
    """The layout is the DBC's: swap status and tick of a classic answer and the bits follow."""
    text = SHIPPED_DBC.read_text("utf-8")
    text = text.replace("SG_ TICK : 48|6@1+", "SG_ TICK : 50|6@1+").replace("54|2@1+", "48|2@1+")
    path = tmp_path / "suit.dbc"
    path.write_text(text, "utf-8")
    moved = SuitProtocol.load(path)
    raw = np.zeros(9, dtype=np.int16)
    assert PROTOCOL.encode_sample(1, raw, 0b100001, 0b10, False)[0].data[6] == 0b10_100001
    assert moved.encode_sample(1, raw, 0b100001, 0b10, False)[0].data[6] == 0b100001_10
    decoded = moved.classic.parts[0].decode(moved.encode_sample(1, raw, 0b100001, 0b10, False)[0].data)
    assert (decoded.tick[0], decoded.status[0]) == (0b100001, 0b10)


def crowded(tmp_path: Path, **moved: int) -> SuitProtocol:
    """The shipped description with some messages at other identifiers."""
    text = SHIPPED_DBC.read_text("utf-8")
    for name, frame_id in moved.items():
        old = next(line for line in text.splitlines() if line.startswith("BO_ ") and f" {name}:" in line)
        number = old.split()[1]
        text = text.replace(f"BO_ {number} ", f"BO_ {frame_id} ").replace(
            f"SG_ {number} ", f"SG_ {frame_id} "
        )
        text = text.replace(f"VAL_ {number} ", f"VAL_ {frame_id} ")
    path = tmp_path / "crowded.dbc"
    path.write_text(text, "utf-8")
    return SuitProtocol.load(path)


def node(number: int, bus: str = "arm") -> NodeConfig:
    return NodeConfig(id=number, bus=bus)


def test_two_nodes_whose_messages_get_one_identifier_are_named(tmp_path: Path) -> None:
    protocol = crowded(tmp_path, NODE_GYR=0x201)
    protocol.identifiers([node(1), node(3)], {"arm": False})
    with pytest.raises(ConfigError, match=r"0x203.*NODE_ACC of node 3 and NODE_GYR of node 2 on bus arm"):
        protocol.identifiers([node(1), node(2), node(3)], {"arm": False})


def test_a_node_must_not_get_the_identifier_of_sync(tmp_path: Path) -> None:
    protocol = crowded(tmp_path, SYNC=0x105)
    protocol.identifiers([node(4)], {"arm": True})
    with pytest.raises(ConfigError, match=r"0x105.*NODE_SAMPLE of node 5 and SYNC"):
        protocol.identifiers([node(5)], {"arm": True})


def test_nodes_of_two_buses_may_have_the_same_number(tmp_path: Path) -> None:
    crowded(tmp_path).identifiers([node(1), node(1, "leg")], {"arm": False, "leg": False})


def test_an_identifier_has_eleven_bits(tmp_path: Path) -> None:
    protocol = crowded(tmp_path, NODE_MAG=0x7F0)
    with pytest.raises(ConfigError, match="11 bits"):
        protocol.identifiers([node(16)], {"arm": False})


def test_two_messages_with_one_identifier_are_refused_when_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"NODE_SAMPLE|cantools"):
        crowded(tmp_path, SYNC=0x100)
