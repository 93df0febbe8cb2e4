"""From a recording's messages to the figures: frames of two nodes, states, and the hosts' clocks."""

from __future__ import annotations

import re
from dataclasses import replace

import msgpack
import numpy as np
import pytest

from common.clock import NS_PER_MS, NS_PER_S
from common.errors import TandemError
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import RobotState, Statistics
from deploy.experiments.prove.recorded import NodeRates, RecordedRun
from deploy.measure.proof import ENCODER, HAND_TO_HAND, SERVO, ProofRow, prove
from deploy.recorded.recompute import Recorded
from master.journal.calls import FRAME, FRAMES, TICK, VERSION
from master.suit.number import number_of
from master.suit.protocol import SuitProtocol
from tests.published import slave_metrics

SKELETON = load_skeleton("nursing")
PROTOCOL = SuitProtocol.load()
WRIST = SKELETON.joint_names.index("right_wrist_yaw")
HAND, WORN, TAPED = "right_hand", 8, 100
AHEAD_NS = 5_000 * NS_PER_S
"""The robot's clock minus the operator's."""
LATE_S, SERVO_S = 0.08, 0.03
SECONDS = 26.0


def angle(t_s: Array) -> Array:
    """Irregular, as a person is asked to move."""
    waves = ((0.41, 0.5), (0.83, 0.35), (1.27, 0.2), (0.63, 0.3))
    out: Array = np.sum([size * np.sin(2 * np.pi * hz * t_s + 3 * hz) for hz, size in waves], axis=0)
    return out


def rate(t_s: float) -> Array:
    """About an axis askew, with a bias, as of a node that sits anyhow and was never calibrated."""
    speed = float(angle(np.array(t_s + 1e-4)) - angle(np.array(t_s - 1e-4))) / 2e-4
    out: Array = speed * np.array([0.6, 0.0, 0.8]) + np.array([0.02, -0.03, 0.01])
    return out


def frames(fd: bool, by_robots_clock: bool = False, nodes: tuple[int, ...] = (WORN, TAPED)) -> list[Recorded]:
    entries = []
    for tick in range(round(SECONDS * 200)):
        t_s = tick / 200
        now_ns = round(t_s * NS_PER_S) + (AHEAD_NS if by_robots_clock else 0)
        calls: list[tuple[object, ...]] = [(TICK, tick, now_ns)]
        for node in nodes:
            counts = np.zeros(9)
            counts[3:6] = rate(t_s - (LATE_S if node == TAPED else 0.0)) / PROTOCOL.gyr_scale
            raw = np.rint(counts).astype(np.int16)
            calls += [
                (FRAME, "suit", one.id, bytes(one.data), now_ns + NS_PER_MS)
                for one in PROTOCOL.encode_sample(node, raw, number_of(tick), 0, fd)
            ]
        entries.append(Recorded(FRAMES, msgpack.packb((VERSION, calls))))
    return entries


def states(encoder_late_s: float = 0.0) -> list[Recorded]:
    entries = []
    for i in range(round(SECONDS * 50)):
        t_s = i / 50
        setpoint, position = SKELETON.zero_rad.copy(), SKELETON.zero_rad.copy()
        setpoint[WRIST] += 0.5 * float(angle(np.array(t_s - LATE_S + SERVO_S)))
        position[WRIST] += 0.5 * float(angle(np.array(t_s - LATE_S - encoder_late_s)))
        at_ns = AHEAD_NS + round(t_s * NS_PER_S)
        state = RobotState(
            "robot-1", i, at_ns, at_ns, "track", "", "nurse-1", np.ones(len(position), np.bool_), position,
            setpoint, None, -AHEAD_NS, NS_PER_MS,
        )  # fmt: skip
        entries.append(Recorded("tandem/robot-1/state", encode(state)))
    entries.append(Recorded("tandem/robot-1/statistics", encode(Statistics(1, slave_metrics()))))
    return entries


def rows(entries: list[Recorded], node_entries: list[Recorded] | None = None) -> dict[str, ProofRow]:
    operator, taped = NodeRates(PROTOCOL, WORN, "suit"), NodeRates(PROTOCOL, TAPED)
    run = RecordedRun(SKELETON, HAND)
    run.take(entries, (operator, taped) if node_entries is None else (operator,))
    if node_entries is not None:
        RecordedRun(SKELETON, HAND).take(node_entries, (taped,))
    motions = run.motions(operator.speed(), taped.speed(), on_robots_clock=node_entries is not None)
    return {row.name: row for row in prove(motions, run.claims())}


@pytest.mark.parametrize("fd", [True, False])
def test_a_node_on_the_suits_bus_gives_the_figures(fd: bool) -> None:
    found = rows(frames(fd) + states())
    assert found[HAND_TO_HAND].found_ms == pytest.approx(1e3 * LATE_S, abs=1.0)
    assert found[SERVO].found_ms == pytest.approx(1e3 * SERVO_S, abs=1.0)
    assert found[ENCODER].found_ms == pytest.approx(0.0, abs=1.0)
    assert found[HAND_TO_HAND].claimed_ms == slave_metrics().end_to_end_ms.mean
    assert found[HAND_TO_HAND].bound_ms > 1.0  # type: ignore[operator]  # the offset's bound is in it


def test_a_node_on_a_bus_at_the_robot_gives_the_same() -> None:
    at_robot = frames(True, by_robots_clock=True, nodes=(TAPED,))
    found = rows(frames(True, nodes=(WORN,)) + states(), at_robot)
    assert found[HAND_TO_HAND].found_ms == pytest.approx(1e3 * LATE_S, abs=1.0)


def test_an_encoder_that_is_20_ms_older_than_its_stamp_is_named() -> None:
    found = rows(frames(True) + states(encoder_late_s=0.02))
    assert found[ENCODER].wrong
    said = re.fullmatch(r"the encoders tell a motion (\S+) ms after the hand makes it", found[ENCODER].why)
    assert said is not None
    assert float(said[1]) == pytest.approx(20.0, abs=0.2)
    assert found[SERVO].found_ms == pytest.approx(1e3 * SERVO_S, abs=1.0)


def test_what_is_missing_is_said() -> None:
    with pytest.raises(TandemError, match="never followed"):
        rows(frames(True))
    with pytest.raises(TandemError, match="--hand left_wing: expected one of "):
        RecordedRun(SKELETON, "left_wing")
    found = rows(frames(True, nodes=(WORN,)) + states(), frames(True, nodes=()))
    assert found[HAND_TO_HAND].found_ms is None


def test_a_frame_with_a_wrong_checksum_is_left_out() -> None:
    (whole,) = PROTOCOL.encode_sample(WORN, np.full(9, 5, np.int16), 0, 0, True)
    broken = bytes([*bytes(whole.data)[:-1], bytes(whole.data)[-1] ^ 1])
    node = NodeRates(PROTOCOL, WORN)
    for now_ns, data in ((1, bytes(whole.data)), (2, broken)):
        call = [(TICK, 0, now_ns), (FRAME, "suit", whole.id, data, now_ns)]
        node.take(msgpack.packb((VERSION, call)))
    assert list(node.speed().at_ns) == [1]


def test_an_answer_that_comes_after_the_next_sync_counts_from_its_own() -> None:
    """A busy node answers late: by the newest SYNC its reading would be a tick too young."""
    node = NodeRates(PROTOCOL, WORN)
    answers = {n: PROTOCOL.encode_sample(WORN, np.full(9, n, np.int16), n, 0, True)[0] for n in (1, 2, 3)}
    calls: list[tuple[object, ...]] = []
    for number in (1, 2, 3, 4):
        calls.append((TICK, number, 10 * number))
        late = answers.get(number - 1)
        if late is not None:
            calls.append((FRAME, "suit", late.id, bytes(late.data), 10 * number + 1))
    node.take(msgpack.packb((VERSION, calls)))
    assert list(node.speed().at_ns) == [10, 20, 30]
    assert node.answers_since(20) == 2


def test_a_state_that_cannot_be_read_is_counted() -> None:
    run = RecordedRun(SKELETON, HAND)
    run.take([Recorded("tandem/robot-1/state", b"?")], ())
    assert run.unread == 1
    assert replace(run.claims()).hand_to_hand_ms is None
