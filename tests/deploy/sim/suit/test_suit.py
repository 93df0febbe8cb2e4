from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from common.can.config import BusConfig
from common.clock import to_ns
from common.quaternion import rotate
from common.skeleton import Skeleton
from common.skeleton.full_body import RECORDED_AS
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.faults import FaultsConfig
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import GRAVITY_M_S2
from deploy.sim.suit.suit import SimulatedSuit, SuitAnswer, build_suit
from master.suit.nodes import NodeConfig
from master.suit.number import number_of
from master.suit.protocol import NO_VALUE, SuitProtocol

START_NS = 123_456_789_000
PERIOD_NS = 5_000_000


def varied(config: SuitConfig, **changes: Any) -> SuitConfig:
    return config.model_copy(update=changes)


def run(suit: SimulatedSuit, ticks: int) -> list[SuitAnswer]:
    return [suit.on_sync(k, START_NS + k * PERIOD_NS) for k in range(ticks)]


def raw_of(answer: SuitAnswer, protocol: SuitProtocol) -> np.ndarray[Any, Any]:
    return protocol.fd.parts[0].raw(b"".join(o.frame.data for o in answer.frames))


def test_every_node_answers_with_the_tick_it_was_asked(config: SuitConfig, protocol: SuitProtocol) -> None:
    answer = build_suit(config, protocol).on_sync(4711, START_NS)
    assert [o.frame.id for o in answer.frames] == [0x100 + i for i in range(1, 37)]
    assert {(o.bus, o.delay_ns, o.frame.fd) for o in answer.frames} == {("suit", 0, True)}
    decoded = protocol.fd.parts[0].decode(b"".join(o.frame.data for o in answer.frames))
    assert set(decoded.tick.tolist()) == {4711}
    assert set(decoded.status.tolist()) == {0}


def test_the_same_seed_gives_the_same_bytes_and_another_one_others(
    config: SuitConfig, protocol: SuitProtocol
) -> None:
    one, same, other = (
        run(build_suit(varied(config, seed=seed), protocol), 50) for seed in (1, 1, 2)
    )  # fmt: skip
    assert [a.frames for a in one] == [a.frames for a in same]
    assert [a.frames for a in one] != [a.frames for a in other]


def test_time_begins_with_the_first_sync(config: SuitConfig, protocol: SuitProtocol) -> None:
    ideal = varied(config, grade="ideal")
    early, late = build_suit(ideal, protocol), build_suit(ideal, protocol)
    shift_ns = to_ns(1000.0)
    for k in (0, 800, 900):
        a = early.on_sync(k, START_NS + k * PERIOD_NS)
        b = late.on_sync(k, START_NS + shift_ns + k * PERIOD_NS)
        assert a.frames == b.frames


def test_the_truth_is_the_motion_at_the_instant_of_sync(
    config: SuitConfig, protocol: SuitProtocol, skeleton: Skeleton
) -> None:
    suit = build_suit(config, protocol)
    suit.on_sync(0, START_NS)
    answer = suit.on_sync(number_of(900), START_NS + to_ns(4.5))
    assert answer.truth is not None
    position, velocity, _ = load_motion("bottle", skeleton).state(4.5)
    assert (answer.truth.tick, answer.truth.sampled_ns) == (900, START_NS + to_ns(4.5))
    np.testing.assert_array_equal(answer.truth.position_rad, position)
    np.testing.assert_array_equal(answer.truth.velocity_rad_s, velocity)
    assert np.abs(velocity).max() > 0.5


def test_standing_still_the_calibrated_nodes_read_gravity_and_field(
    config: SuitConfig, protocol: SuitProtocol
) -> None:
    suit = build_suit(varied(config, motion="calibration_pose"), protocol)
    mean = np.mean([raw_of(a, protocol) for a in run(suit, 200)], axis=0) * protocol.fd.scale
    up_and_north = np.array([0.0, 0.0, GRAVITY_M_S2, 0.0, 0.0, 0.0, 0.0, 25.0, -43.301])
    allowed = np.repeat([0.1, np.radians(0.5), 0.7], 3)
    assert (np.abs(mean - up_and_north) < allowed).all()


def test_a_node_without_magnetometer_sends_the_reserved_value(
    config: SuitConfig, protocol: SuitProtocol
) -> None:
    nodes = dict(config.nodes)
    nodes["head"] = NodeConfig(id=2, bus="suit", magnetometer=False)
    raw = raw_of(build_suit(varied(config, nodes=nodes), protocol).on_sync(0, START_NS), protocol)
    assert (raw[:, 6:] == NO_VALUE).all(axis=1).tolist() == [i == 1 for i in range(36)]
    assert (raw[:, :6] != NO_VALUE).all()


def test_a_reading_beyond_its_range_is_flagged_on_its_node_only(
    config: SuitConfig, protocol: SuitProtocol
) -> None:
    strong = config.field.model_copy(update={"strength_ut": 400.0})
    nodes = dict(config.nodes)
    nodes["head"] = NodeConfig(id=2, bus="suit", magnetometer=False)
    answer = build_suit(varied(config, field=strong, nodes=nodes), protocol).on_sync(0, START_NS)
    decoded = protocol.fd.parts[0].decode(b"".join(o.frame.data for o in answer.frames))
    assert decoded.status.tolist() == [0 if i == 1 else 2 for i in range(36)]
    assert decoded.raw[0, 8] == -2047


def test_alignment_turns_the_readings_of_its_node_only(
    config: SuitConfig, protocol: SuitProtocol, skeleton: Skeleton
) -> None:
    q = np.array([0.5, 0.5, 0.5, 0.5])
    plain = varied(config, grade="ideal")
    askew = varied(plain, alignment={"left_hand": q.tolist()})
    one, other = (
        raw_of(build_suit(c, protocol).on_sync(0, START_NS), protocol) * protocol.fd.scale
        for c in (plain, askew)
    )
    hand = skeleton.segment_names.index("left_hand")
    assert np.flatnonzero((one != other).any(axis=1)).tolist() == [hand]
    np.testing.assert_allclose(rotate(q, other[hand, :3]), one[hand, :3], atol=2 * protocol.acc_scale)


def test_nodes_on_two_buses_answer_each_in_its_own_way(protocol: SuitProtocol) -> None:
    config = SuitConfig(
        buses=[
            BusConfig(name="body", interface="virtual", channel="body", fd=False),
            BusConfig(name="glove", interface="virtual", channel="glove"),
        ],
        nodes={
            "head": NodeConfig(id=2, bus="body"),
            "left_hand": NodeConfig(id=2, bus="glove"),
            "chest": NodeConfig(id=7, bus="body"),
        },
    )
    answer = build_suit(config, protocol).on_sync(0, START_NS)
    sent = [(o.bus, o.frame.id, o.frame.fd) for o in answer.frames]
    body = [("body", base + node, False) for node in (7, 2) for base in (0x200, 0x280, 0x300)]
    assert sent == [*body, ("glove", 0x102, True)]


def test_faults_act_on_the_suits_own_time(config: SuitConfig, protocol: SuitProtocol) -> None:
    faults = FaultsConfig.model_validate({"lose": [{"node": "head", "from_s": 0.01, "until_s": 0.02}]})
    suit = build_suit(varied(config, faults=faults), protocol)
    assert [len(a.frames) for a in run(suit, 6)] == [36, 36, 35, 35, 36, 36]


def test_a_replayed_person_has_no_magnetometer_truth_or_noise(
    config: SuitConfig, protocol: SuitProtocol, skeleton: Skeleton, tmp_path: Path
) -> None:
    arrays: dict[str, Any] = {"t_s": np.arange(3) * 0.01}
    for name in RECORDED_AS.values():
        arrays[f"{name}_acc"] = np.array([[0.0, 0.0, 9.0], [0.0, 2.0, 9.0], [0.0, 0.0, 900.0]])
        arrays[f"{name}_gyr"] = np.zeros((3, 3))
    np.savez(tmp_path / "person.npz", **arrays)
    suit = build_suit(varied(config, replay=tmp_path / "person.npz", grade="raw"), protocol)
    answers = run(suit, 5)
    assert all(a.truth is None for a in answers)
    raw = raw_of(answers[1], protocol)
    assert (raw[:, 6:] == NO_VALUE).all()
    expected = np.rint(np.array([0.0, 1.0, 9.0]) / protocol.acc_scale)
    off = raw[:, :3] - np.tile(expected, (36, 1))
    assert 0 < np.abs(off).max() <= 4
    statuses = protocol.fd.parts[0].decode(b"".join(o.frame.data for o in answers[4].frames)).status
    assert set(statuses.tolist()) == {2}
