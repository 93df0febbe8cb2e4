"""Whatever arrives, decoding gives a message or a CodecError: nothing else, and no warning."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import CodecError
from common.wire.codec import VERSION, decode, encode
from common.wire.messages import (
    Action,
    ClockQuery,
    ClockReply,
    Command,
    CommandEcho,
    CommandStamps,
    ControlReply,
    ControlRequest,
    RobotState,
    Statistics,
    Truth,
)
from tests.published import master_metrics

J = 25
ones, zeros = np.ones(J, np.bool_), np.zeros(J)
SEEDS: dict[str, Any] = {
    "command": Command("robot-1", 2**40, 9, 99, CommandStamps(1, 2, 3, 4), True, ones, zeros, zeros),
    "state": RobotState(
        "robot-1",
        1,
        2,
        3,
        "track",
        "all is well",
        "nurse",
        ones,
        zeros,
        zeros,
        CommandEcho(1, 2, 3, 4, 5),
        -9,
        5,
    ),
    "control": ControlRequest("robot-1", Action.REST, "nurse", "key", groups=("left_arm", "head")),
    "controlled": ControlReply(True, "hold", "claimed", 2**40),
    "clock": ClockQuery(2**50, 2**49, 2**48),
    "clocked": ClockReply(1, 2, 3),
    "statistics": Statistics(5, master_metrics()),
    "truth": Truth(5, 6, zeros, zeros),
}
KINDS = [type(seed) for seed in SEEDS.values()]

leaves = (
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=80)
    | st.binary(max_size=300) | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=8))
    | st.sampled_from([*SEEDS, VERSION, bytes(J), bytes(8 * J), *Action])
)  # fmt: skip
keys = st.text(max_size=8) | st.binary(max_size=8)
trees = st.recursive(
    leaves, lambda t: st.lists(t, max_size=14) | st.dictionaries(keys, t, max_size=4), max_leaves=30
)


def survives(payload: bytes) -> None:
    for kind in KINDS:
        try:
            message = decode(payload, kind, J)
        except CodecError as error:
            said = str(error)
        else:
            said = "a message"
            assert type(message) is kind
            decode(encode(message), kind, J)  # what was let in can be passed on
        assert 0 < len(said) < 300


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_arbitrary_bytes(payload: bytes) -> None:
    survives(payload)


@settings(deadline=None)
@given(trees)
def test_arbitrary_msgpack(tree: object) -> None:
    survives(msgpack.packb(tree))


@settings(deadline=None)
@given(st.sampled_from(list(SEEDS)), st.lists(trees, max_size=14))
def test_right_heads_with_arbitrary_bodies(kind: str, body: list[object]) -> None:
    survives(msgpack.packb([kind, VERSION, *body]))


@settings(deadline=None)
@given(st.sampled_from(list(SEEDS)), st.data())
def test_one_field_of_a_valid_message_replaced(kind: str, data: st.DataObject) -> None:
    array = msgpack.unpackb(encode(SEEDS[kind]))
    array[data.draw(st.integers(0, len(array) - 1))] = data.draw(trees)
    survives(msgpack.packb(array))


@settings(deadline=None)
@given(st.sampled_from(list(SEEDS)), st.data())
def test_bytes_of_a_valid_message_changed_cut_and_added(kind: str, data: st.DataObject) -> None:
    payload = bytearray(encode(SEEDS[kind]))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    start = data.draw(st.integers(0, len(payload)))
    end = data.draw(st.integers(start, len(payload)))
    survives(bytes(payload))
    survives(bytes(payload[start:end]))
    survives(bytes(payload) + data.draw(st.binary(max_size=8)))


@pytest.mark.parametrize(
    "payload",
    [
        b"\xdd\xff\xff\xff\xff",  # an array of 2**32 - 1
        b"\xdf\xff\xff\xff\xff",  # a map
        b"\xc6\xff\xff\xff\xff",  # bytes
        b"\xdb\xff\xff\xff\xff",  # a text
        b"\xc9\xff\xff\xff\xff\x05",  # an extension
        b"\x93\xaastatistics\x01\xdd\x00\x0f\xff\xff",
        b"\x91" * 100_000,  # arrays in arrays
        b"\x81\xa1a" * 50_000,
        b"\x94" * 4 + b"\xc0" * 13,
        b"\xc1",  # never used
        b"\xd7\xff" + bytes(8),  # a time stamp
        b"\x95\xaastatistics\x01\xa1m\x05\x81\xa1a\xd6\xff\xff\xff\xff\xff",
        b"\xa1\xff",  # not UTF-8
        b"\x00" * (256 * 1024 + 1),
    ],
    ids=lambda p: p[:6].hex(),
)
def test_known_traps(payload: bytes) -> None:
    survives(payload)
