import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from common.errors import CodecError
from common.metrics.master import LeaseHeld
from common.metrics.tree import to_tree
from common.wire.codec import (
    MAX_PAYLOAD,
    VERSION,
    decode,
    encode,
)
from common.wire.fields import ANGLE_LIMIT_RAD, MAX_DOUBT, MAX_NAME, MAX_TEXT, RATE_LIMIT_RAD_S
from common.wire.messages import (
    Action,
    BaseAttitude,
    ClockQuery,
    ClockReply,
    Command,
    CommandEcho,
    CommandStamps,
    ControlReply,
    ControlRequest,
    RobotState,
    StateHead,
    Statistics,
    Truth,
)
from common.wire.numbering import number_of
from common.wire.state_form import CONTROL_BYTES
from tests.published import commanded, master_metrics, slave_metrics

counts = st.integers(0, 2**63 - 1)
signed = st.integers(-(2**63) + 1, 2**63 - 1)
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=MAX_NAME)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=MAX_TEXT)
brief = st.text(st.characters(exclude_categories=["Cs"]), max_size=16)
"""Texts of a state, so short that all of them fit and none is cut."""
flags = st.booleans()


def values(joints: int, limit: float) -> st.SearchStrategy[Any]:
    inside = float(np.nextafter(np.float32(limit), np.float32(0)))
    item = st.floats(-inside, inside, width=32)
    return st.lists(item, min_size=joints, max_size=joints).map(lambda v: np.array(v, np.float64))


def torques(joints: int) -> st.SearchStrategy[Any]:
    item = st.floats(-10_000.0, 10_000.0, width=16) | st.just(math.nan)
    return st.none() | st.lists(item, min_size=joints, max_size=joints).map(lambda v: np.array(v, np.float64))


def masks(joints: int) -> st.SearchStrategy[Any]:
    return st.lists(flags, min_size=joints, max_size=joints).map(lambda v: np.array(v, np.bool_))


@st.composite
def commands(draw: st.DrawFn, joints: int = 25) -> Command:
    return Command(
        robot=draw(names),
        lease=draw(counts),
        sequence=draw(counts),
        tick=draw(counts),
        stamps=CommandStamps(*draw(st.tuples(counts, counts, counts, counts))),
        deadman_held=draw(flags),
        valid=draw(masks(joints)),
        position_rad=draw(values(joints, ANGLE_LIMIT_RAD)),
        velocity_rad_s=draw(values(joints, RATE_LIMIT_RAD_S)),
        seen_frame=draw(counts),
        doubt=draw(st.text(max_size=MAX_DOUBT)),
        clutch_out=draw(flags),
    )


turns = st.floats(0.0, 2.0 * math.pi)
bases = st.builds(
    BaseAttitude,
    counts,
    st.floats(0.0, math.pi),
    st.none() | turns,
    st.none() | turns,
    st.floats(0.0, math.pi),
)


@st.composite
def states(draw: st.DrawFn, joints: int = 25) -> RobotState:
    echo = draw(st.none() | st.tuples(*[counts] * 5))
    return RobotState(
        robot=draw(brief),
        sequence=draw(counts),
        sent_ns=draw(counts),
        encoder_ns=draw(counts),
        guard=draw(brief),
        reason=draw(brief),
        operator=draw(brief),
        encoder_valid=draw(masks(joints)),
        position_rad=draw(values(joints, ANGLE_LIMIT_RAD)),
        setpoint_rad=draw(values(joints, ANGLE_LIMIT_RAD)),
        echo=None if echo is None else CommandEcho(*echo),
        master_offset_ns=draw(signed),
        offset_bound_ns=draw(signed),
        faults=draw(st.dictionaries(brief, brief, max_size=2)),
        base=draw(st.none() | bases),
        resting=draw(st.lists(brief, max_size=2).map(tuple)),
        effort_nm=draw(torques(joints)),
        external_nm=draw(torques(joints)),
        blind_m=tuple(draw(st.lists(st.floats(0.0, 100.0), max_size=5))),
        blind_s=draw(st.floats(0.0, 100.0)),
        clamped=(lambda mask: mask if mask.any() else None)(draw(masks(joints))),
    )


@st.composite
def truths(draw: st.DrawFn, joints: int = 25) -> Truth:
    position, velocity = draw(values(joints, ANGLE_LIMIT_RAD)), draw(values(joints, RATE_LIMIT_RAD_S))
    return Truth(draw(counts), draw(counts), position, velocity)


messages = st.one_of(
    commands(),
    states(),
    truths(),
    st.builds(
        ControlRequest,
        names,
        st.sampled_from(Action),
        names,
        texts,
        counts,
        counts,
        st.lists(names).map(tuple),
    ),
    st.builds(ControlReply, flags, names, texts, counts, counts, counts, texts),
    st.builds(ClockQuery, counts, counts, counts, counts),
    st.builds(ClockReply, counts, counts, counts, counts),
    st.builds(Statistics, counts, st.sampled_from([master_metrics(), slave_metrics()])),
)


def same(one: Any, two: Any) -> Any:
    if is_dataclass(one) and type(one) is type(two):
        return all(same(getattr(one, f.name), getattr(two, f.name)) for f in fields(one))
    if isinstance(one, np.ndarray):
        return one.dtype == two.dtype and one.tobytes() == two.tobytes()  # -0.0 is not 0.0 here
    return type(one) is type(two) and one == two


@settings(deadline=None)
@given(messages)
def test_what_is_encoded_is_decoded(message: Any) -> None:
    assert same(decode(encode(message), type(message), 25), message)


@given(st.integers(0, 40).flatmap(lambda n: st.tuples(st.just(n), commands(n))))
def test_any_number_of_joints(sized: tuple[int, Command]) -> None:
    joints, command = sized
    payload = encode(command)
    assert same(decode(payload, Command, joints), command)
    with pytest.raises(CodecError, match=r"float32 values|flags"):
        decode(payload, Command, joints + 1)


COMMAND = Command(
    "robot-1", 7, 1, 2, CommandStamps(1, 2, 3, 4), True, np.ones(3, np.bool_), np.zeros(3), np.zeros(3)
)
STATE = RobotState(
    "robot-1", 1, 2, 3, "hold", "", "", np.ones(3, np.bool_), np.zeros(3), np.zeros(3),
    CommandEcho(1, 2, 3, 4, 5), -5, 6, {"left_elbow_pitch": "over-current"},
    BaseAttitude(7, 0.1, None, 0.2, 0.1),
)  # fmt: skip


def tampered(message: Any, change: Callable[[list[Any]], None]) -> bytes:
    """The message's bytes with its array changed; the first two entries are kind and version."""
    array = msgpack.unpackb(encode(message))
    change(array)
    out: bytes = msgpack.packb(array)
    return out


def put(index: int, value: object) -> Callable[[list[Any]], None]:
    def change(array: list[Any]) -> None:
        array[index] = value

    return change


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3.4e38, -13.0, 12.567])
def test_an_angle_that_is_no_angle_is_refused(value: float) -> None:
    bad = np.array([0.0, value, 0.0])
    with pytest.raises(CodecError, match="not finite, or beyond"):
        decode(encode(replace(COMMAND, position_rad=bad)), Command, 3)
    with pytest.raises(CodecError, match="not finite, or beyond"):
        decode(encode(replace(STATE, setpoint_rad=bad)), RobotState, 3)


@pytest.mark.parametrize("value", [math.nan, math.inf, 100.1, -100.1])
def test_a_rate_that_is_no_rate_is_refused(value: float) -> None:
    bad = replace(COMMAND, velocity_rad_s=np.array([0.0, 0.0, value]))
    with pytest.raises(CodecError, match="not finite, or beyond"):
        decode(encode(bad), Command, 3)


@pytest.mark.parametrize(
    "base", [(1, math.nan, None, 0.0), (1, -0.1, None, 0.0), (1, 0.1, 6.3, 0.0), (1, 0.1, None), "level"]
)
def test_a_base_that_cannot_stand_so_is_refused(base: object) -> None:
    with pytest.raises(CodecError):
        decode(tampered(STATE, put(15, base)), RobotState, 3)


@pytest.mark.parametrize("faults", [[], {1: "x"}, {"x": 1}, {"x" * 65: ""}, {"": "x" * 513}])
def test_faults_that_are_not_words_are_refused(faults: object) -> None:
    with pytest.raises(CodecError):
        decode(tampered(STATE, put(14, faults)), RobotState, 3)


def test_a_signalling_nan_is_refused_without_a_warning() -> None:
    payload = tampered(COMMAND, put(12, b"\x01\x00\xa0\x7f" * 6))
    with pytest.raises(CodecError, match="not finite"):
        decode(payload, Command, 3)


def test_a_torque_that_is_not_known_stays_so_without_a_warning() -> None:
    signalling = b"\x01\x7c" + np.array([-1.5, 10_000.0], "<f2").tobytes()
    decoded = decode(tampered(STATE, put(19, signalling)), RobotState, 3)
    assert decoded.effort_nm is not None
    np.testing.assert_array_equal(decoded.effort_nm, [math.nan, -1.5, 10_000.0])
    assert decoded.external_nm is None


def test_a_torque_is_told_to_a_thousandth() -> None:
    told_nm = np.array([0.012, -3.456, 287.6])
    decoded = decode(encode(replace(STATE, external_nm=told_nm)), RobotState, 3)
    assert decoded.external_nm is not None
    np.testing.assert_allclose(decoded.external_nm, told_nm, rtol=1e-3)


def test_the_limits_themselves_pass() -> None:
    edge = np.array([ANGLE_LIMIT_RAD, -ANGLE_LIMIT_RAD, -0.0])
    rate = np.array([RATE_LIMIT_RAD_S, -RATE_LIMIT_RAD_S, -0.0])
    decoded = decode(encode(replace(COMMAND, position_rad=edge, velocity_rad_s=rate)), Command, 3)
    assert np.allclose(decoded.position_rad, edge, atol=1e-6)
    assert (decoded.velocity_rad_s == rate).all()
    assert np.signbit(decoded.position_rad[2])


@pytest.mark.parametrize("index", range(3, 10))
@pytest.mark.parametrize("value", [-1, 2**63, 1.0, True, None, "1", b"1", [1]])
def test_each_count_of_a_command_is_checked(index: int, value: object) -> None:
    with pytest.raises(CodecError, match="is not a 63-bit count"):
        decode(tampered(COMMAND, put(index, value)), Command, 3)


@pytest.mark.parametrize(
    ("index", "value", "why"),
    [
        (0, "state", "kind 'state', expected command"),
        (1, VERSION + 1, f"schema version {VERSION + 1}, expected {VERSION}"),
        (0, 5, "kind 5, expected command"),
        (1, True, "schema version True"),
        (2, "x" * (MAX_NAME + 1), "text of at most 64"),
        (2, b"robot-1", "text of at most 64"),
        (10, 1, "is not a flag"),
        (11, b"\x01\x01", "mask of 3"),
        (11, b"\x01\x02\x00", "mask of 3"),
        (11, [1, 1, 1], "mask of 3"),
        (12, bytes(23), "float32 values"),
        (12, bytes(25), "float32 values"),
        (12, "x" * 24, "float32 values"),
    ],
)
def test_each_other_field_of_a_command_is_checked(index: int, value: object, why: str) -> None:
    with pytest.raises(CodecError, match=why):
        decode(tampered(COMMAND, put(index, value)), Command, 3)


@pytest.mark.parametrize(
    ("index", "value", "why"),
    [
        (4, -1, "63-bit count"),
        (6, 5, "text of at most 64"),
        (7, "x" * (MAX_TEXT + 1), "text of at most 512"),
        (9, b"\x03\x00\x00", "mask of 3"),
        (11, 5, "5 is not an array"),
        (11, [1, 2, 3, 4], "4 fields, expected 5"),
        (11, [1, 2, 3, 4, -5], "63-bit count"),
        (12, 2**63, "64-bit integer"),
        (13, 0.5, "64-bit integer"),
        (19, bytes(5), "not 3 float16 values"),
        (20, [0.0, 0.0, 0.0], "not 3 float16 values"),
        (19, b"\x00\x7c" * 3, "a torque is beyond"),
        (20, b"\x00\xf1" * 3, "a torque is beyond"),
    ],
)
def test_each_field_of_a_state_is_checked(index: int, value: object, why: str) -> None:
    with pytest.raises(CodecError, match=why):
        decode(tampered(STATE, put(index, value)), RobotState, 3)


@pytest.mark.parametrize(
    ("message", "index", "value", "why"),
    [
        (ControlRequest("r", Action.CLAIM, "o"), 3, "jump", "action 'jump', expected one of claim, "),
        (ControlRequest("r", Action.CLAIM, "o"), 3, 1, "text"),
        (ControlReply(True, "hold", ""), 2, 1, "is not a flag"),
        (ControlReply(True, "hold", ""), 5, -1, "63-bit count"),
        (ClockQuery(1, 2, 3), 2, -1, "63-bit count"),
        (ClockReply(1, 2, 3), 4, 1.5, "63-bit count"),
        (Statistics(1, master_metrics()), 2, "suit", "statistics of 'suit', expected one of master, slave"),
        (Statistics(1, master_metrics()), 4, [], "MasterMetrics"),
        (Statistics(1, master_metrics()), 4, {}, "MasterMetrics: software: field required"),
        (Statistics(1, slave_metrics()), 4, to_tree(master_metrics()), "SlaveMetrics"),
        (Truth(1, 2, np.zeros(3), np.zeros(3)), 4, b"", "float32 values"),
    ],
)
def test_each_field_of_the_other_messages_is_checked(
    message: Any, index: int, value: object, why: str
) -> None:
    with pytest.raises(CodecError, match=why):
        decode(tampered(message, put(index, value)), type(message), 3)


@pytest.mark.parametrize(
    "message",
    [COMMAND, STATE, ControlRequest("r", Action.CLAIM, "o"), ControlReply(True, "", ""), ClockQuery(1),
     ClockReply(1, 2, 3), Statistics(1, master_metrics()), Truth(1, 2, np.zeros(3), np.zeros(3))],
    ids=lambda m: type(m).__name__,
)  # fmt: skip
def test_a_field_too_many_or_too_few_is_refused(message: Any) -> None:
    for change in (list.pop, lambda array: array.append(0)):
        with pytest.raises(CodecError, match="fields, expected"):
            decode(tampered(message, change), type(message), 3)
    for end in (b"", b"\xc0", b"\x90", b"\x91\xa5clock"):
        with pytest.raises(CodecError, match=r"not an array|not msgpack"):
            decode(end, type(message), 3)


def test_a_payload_may_be_only_so_long() -> None:
    robot = commanded(lease=LeaseHeld(True, ""))
    spare = MAX_PAYLOAD - len(encode(Statistics(1, master_metrics(robot)))) - 4
    payload = encode(Statistics(1, master_metrics(commanded(lease=LeaseHeld(True, "x" * spare)))))
    assert len(payload) == MAX_PAYLOAD
    decode(payload, Statistics)
    with pytest.raises(CodecError, match="bytes, expected at most"):
        decode(payload + b"\x00", Statistics)


def test_a_long_text_is_cut_where_a_reader_can_bear_it() -> None:
    assert len(decode(encode(ControlReply(True, "", "x" * 1000)), ControlReply).text) == MAX_TEXT


def test_what_cannot_be_encoded_is_a_codec_error_and_spoils_nothing() -> None:
    unknown = Statistics(1, master_metrics(nodes={"a": object()}))
    for bad in (
        ClockQuery(2**70),
        unknown,
        ControlReply(True, "\ud800", ""),
    ):
        with pytest.raises(CodecError, match="cannot be encoded"):
            encode(bad)
    assert decode(encode(ClockQuery(1)), ClockQuery) == ClockQuery(1)


def test_a_decoded_mask_cannot_be_written_to() -> None:
    decoded = decode(encode(COMMAND), Command, 3)
    with pytest.raises(ValueError, match="read-only"):
        decoded.valid[0] = False


@pytest.mark.bench
def test_a_command_is_encoded_and_decoded_within_15_us() -> None:
    import timeit

    random = np.random.default_rng(0)
    command = replace(
        COMMAND,
        valid=random.random(25) > 0.1,
        position_rad=random.normal(size=25),
        velocity_rad_s=np.zeros(25),
    )
    best = min(timeit.repeat(lambda: decode(encode(command), Command, 25), number=100, repeat=300))
    assert best / 100 < 15e-6


HEAD = (
    "sequence", "sent_ns", "guard", "reason", "operator", "echo", "faults", "resting", "lease_id", "instance",
    "wanted_period_ms",
)  # fmt: skip


@given(states())
def test_the_head_of_a_state_says_what_the_whole_one_says(state: RobotState) -> None:
    head, whole = decode(encode(state), StateHead, 25), decode(encode(state), RobotState, 25)
    assert {name: getattr(head, name) for name in HEAD} == {name: getattr(whole, name) for name in HEAD}


OF_THE_HEAD = (0, 1, 3, 4, 6, 7, 8, 9, 10, 11, 14, 16, 17, 18, 24)
"""Fields that a head has, or whose length it checks, by their place in the array."""


@pytest.mark.parametrize("at", OF_THE_HEAD)
@pytest.mark.parametrize("value", [-1, [1], {1: 2}, "x" * 600, b"12"])
def test_what_the_head_takes_is_checked(at: int, value: object) -> None:
    with pytest.raises(CodecError):
        decode(tampered(STATE, put(at, value)), StateHead, len(STATE.position_rad))


@pytest.mark.parametrize(("version", "without"), [(4, 2), (5, 1)])
def test_a_head_of_an_older_version_is_read(version: int, without: int) -> None:
    def older(array: list[object]) -> None:
        array[1] = version
        del array[-without:]

    assert decode(tampered(STATE, older), StateHead, len(STATE.position_rad)).guard == STATE.guard


@given(
    st.dictionaries(names, texts, max_size=60), texts, st.from_regex(r"[A-Za-z0-9_.-]{1,64}", fullmatch=True)
)
@example({f"joint {i}": "🤖" * MAX_TEXT for i in range(25)}, "🤖" * MAX_TEXT, "n" * MAX_NAME)
def test_a_state_fits_in_a_packet_of_every_path(faults: dict[str, str], reason: str, name: str) -> None:
    """With 25 joints, whatever there is to say of them; what is left out is counted."""
    zeros, mask = np.zeros(25), np.ones(25, np.bool_)
    most = 2**62
    state = RobotState(
        name, most, most, most, "estop", reason, name, mask, zeros, zeros,
        CommandEcho(most, most, most, most, most), -most, most, faults,
        BaseAttitude(most, 1.0, 1.0, 1.0, 1.0), most, most, effort_nm=zeros, external_nm=zeros,
        blind_m=(1.5,) * 5, blind_s=0.5, clamped=mask, wanted_period_ms=80,
    )  # fmt: skip
    payload = encode(state)
    assert len(payload) <= CONTROL_BYTES
    told = decode(payload, RobotState, 25).faults
    if len(told) < len(faults) or "others" in told:
        assert "more" in told["others"] or "others" in faults


@pytest.mark.parametrize(("version", "without"), [(4, 2), (5, 1)])
def test_a_state_of_an_older_version_is_read_and_tells_nothing_new(version: int, without: int) -> None:
    def older(array: list[object]) -> None:
        array[1] = version
        del array[-without:]

    assert same(decode(tampered(STATE, older), RobotState, 3), STATE)
    with pytest.raises(CodecError, match=f"{23 + without} fields, expected 23"):
        decode(tampered(STATE, put(1, version)), RobotState, 3)


@pytest.mark.parametrize("version", [4, 5])
def test_a_command_of_an_older_version_is_read_and_tells_no_rate(version: int) -> None:
    def older(array: list[object]) -> None:
        array[1] = version
        array.pop()

    assert decode(tampered(replace(COMMAND, period_ms=40), older), Command, 3).period_ms == 0
    assert number_of(tampered(COMMAND, older)) == number_of(encode(COMMAND))


def test_the_rate_of_commands_is_told_both_ways() -> None:
    assert decode(encode(replace(COMMAND, period_ms=40)), Command, 3).period_ms == 40
    assert decode(encode(replace(STATE, wanted_period_ms=20)), RobotState, 3).wanted_period_ms == 20


@pytest.mark.parametrize("bits", [bytes(2), b"\x80\x00", 5, None])
def test_clamped_joints_are_as_many_bits_as_joints(bits: object) -> None:
    with pytest.raises(CodecError, match="3 bits"):
        decode(tampered(STATE, put(23, bits)), RobotState, 3)
    clamped = replace(STATE, clamped=np.array([False, True, False]))
    assert len(encode(clamped)) == len(encode(STATE)) + 1
    assert same(decode(encode(clamped), RobotState, 3), clamped)
