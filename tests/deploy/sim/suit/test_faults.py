from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from common.can.frame import CanFrame
from common.clock import NS_PER_MS, to_ns
from deploy.sim.suit.faults import Faults, FaultsConfig, NodeAnswer, Outgoing
from master.suit.crc import frame_crc

NODES = ("chest", "head", "left_hand")
SEED = 11


def answers(frames_each: int = 1) -> list[NodeAnswer]:
    out = []
    for i, node in enumerate(NODES):
        frames = []
        for k in range(frames_each):
            frame_id = 0x101 + i + 0x80 * k
            covered = bytes(range(7 * i, 7 * i + 7))
            frames.append(CanFrame(frame_id, covered + bytes([frame_crc(frame_id, covered)]), fd=False))
        out.append(NodeAnswer(node, "suit", frames))
    return out


def sound() -> list[Outgoing]:
    return [Outgoing("suit", frame, 0) for answer in answers() for frame in answer.frames]


def faults(**config: Any) -> Faults:
    return Faults(FaultsConfig.model_validate(config), SEED)


def nodes_of(outgoing: Sequence[Outgoing]) -> list[str]:
    return [NODES[o.frame.id - 0x101] for o in outgoing]


def test_without_faults_everything_goes_out_at_once_in_order() -> None:
    assert faults().apply(answers(), 0) == sound()


def test_a_lost_node_is_silent_from_its_loss_to_its_return() -> None:
    losing = faults(lose=[{"node": "head", "from_s": 1.0, "until_s": 2.0}])
    begin, end = to_ns(1.0), to_ns(2.0)
    for t_ns, answering in ((begin - 1, 3), (begin, 2), (end - 1, 2), (end, 3)):
        assert len(losing.apply(answers(), t_ns)) == answering
    assert nodes_of(losing.apply(answers(), begin)) == ["chest", "left_hand"]


def test_a_loss_without_an_end_is_for_good() -> None:
    assert len(faults(lose=[{"node": "head"}]).apply(answers(), to_ns(1e6))) == 2


def test_a_lost_node_takes_all_its_classic_frames_with_it() -> None:
    assert len(faults(lose=[{"node": "head"}]).apply(answers(frames_each=3), 0)) == 6


def test_a_late_node_sends_all_its_frames_later() -> None:
    late = faults(delay=[{"node": "head", "delay_ms": 7.5, "from_s": 1.0, "until_s": 2.0}])
    assert [o.delay_ns for o in late.apply(answers(), to_ns(0.999))] == [0, 0, 0]
    assert [o.delay_ns for o in late.apply(answers(2), to_ns(1.0))] == [0, 0, *[7_500_000] * 2, 0, 0]
    assert [o.delay_ns for o in late.apply(answers(), to_ns(2.0))] == [0, 0, 0]


def test_a_delay_without_a_node_is_everyones_and_adds_up() -> None:
    late = faults(delay=[{"delay_ms": 1}, {"node": "head", "delay_ms": 2}])
    assert [o.delay_ns // NS_PER_MS for o in late.apply(answers(), 0)] == [1, 3, 1]


def test_a_delay_happens_at_its_rate() -> None:
    late = faults(delay=[{"delay_ms": 1, "rate": 0.3}])
    share = np.mean([o.delay_ns > 0 for _ in range(1000) for o in late.apply(answers(), 0)])
    assert share == pytest.approx(0.3, abs=0.04)


def test_corrupt_frames_differ_in_one_byte_and_fail_their_check() -> None:
    corrupt = faults(corrupt_rate=1.0)
    places = set()
    for _ in range(200):
        for good, bad in zip(sound(), corrupt.apply(answers(), 0), strict=True):
            assert (bad.frame.id, bad.frame.fd, bad.bus) == (good.frame.id, good.frame.fd, good.bus)
            pairs = zip(good.frame.data, bad.frame.data, strict=True)
            wrong = [i for i, (a, b) in enumerate(pairs) if a != b]
            assert len(wrong) == 1
            places.add(wrong[0])
            assert frame_crc(bad.frame.id, bad.frame.data[:-1]) != bad.frame.data[-1]
    assert places == set(range(8))


def test_frames_are_corrupted_at_the_rate() -> None:
    corrupt = faults(corrupt_rate=0.2)
    good = sound()
    bad = sum(o != g for _ in range(1000) for o, g in zip(corrupt.apply(answers(), 0), good, strict=True))
    assert bad / 3000 == pytest.approx(0.2, abs=0.03)


def test_duplicate_frames_follow_their_original() -> None:
    assert faults(duplicate_rate=1.0).apply(answers(), 0) == [o for o in sound() for _ in range(2)]


def test_frames_are_duplicated_at_the_rate() -> None:
    twice = faults(duplicate_rate=0.25)
    count = sum(len(twice.apply(answers(), 0)) for _ in range(1000))
    assert count / 3000 == pytest.approx(1.25, abs=0.04)


def test_the_seed_decides() -> None:
    config = FaultsConfig.model_validate(
        {"corrupt_rate": 0.5, "duplicate_rate": 0.5, "delay": [{"delay_ms": 1, "rate": 0.5}]}
    )
    one, same, other = (
        [out for _ in range(20) for out in [f.apply(answers(), 0)]]
        for f in (Faults(config, 1), Faults(config, 1), Faults(config, 2))
    )
    assert one == same
    assert one != other


def test_faults_can_be_changed_while_it_runs() -> None:
    troubled = faults()
    troubled.config = FaultsConfig.model_validate({"lose": [{"node": "chest"}]})
    assert nodes_of(troubled.apply(answers(), 0)) == ["head", "left_hand"]
    troubled.config = FaultsConfig()
    assert troubled.apply(answers(), 0) == sound()
