"""Frames in, commands out: decimation, lost nodes, a bus that fails; against the simulated suit."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from common.clock import NS_PER_MS, NS_PER_S
from common.config.load import load_config
from common.wire.messages import Mask
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.suit import SimulatedSuit, build_suit
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.joint_angles.sample import JointAngleSample
from master.pipeline import MOST_BRIDGED, CommandWriter, MasterPipeline, bridged
from master.suit.doubt import NodeDoubt, Weight
from master.suit.protocol import SuitProtocol

EXAMPLES = Path(__file__).parents[2] / "deploy/examples"
PERIOD_NS = 5 * NS_PER_MS


class Bench:
    """A master's pipeline and a suit, wired together without time between them."""

    def __init__(self, *suit: str, examples: Path = EXAMPLES, master: tuple[str, ...] = ()) -> None:
        config = load_config(examples / "master.toml", MasterConfig, master)
        protocol = SuitProtocol.load(config.capture.dbc)
        self.pipeline = MasterPipeline(config, protocol)
        calm = ('motion="calibration_pose"', *suit)
        self.suit: SimulatedSuit = build_suit(load_config(examples / "suit.toml", SuitConfig, calm), protocol)
        self.tick = 0
        self.late_ns = 0
        """By how much the tick's SYNC goes out late."""
        self.silent = False

    @property
    def now_ns(self) -> int:
        return NS_PER_S + self.tick * PERIOD_NS + self.late_ns

    def run(self, ticks: int) -> list[JointAngleSample]:
        """What was angles in so many ticks."""
        found = []
        for _ in range(ticks):
            self.tick += 1
            sync, late = self.pipeline.tick(self.tick, self.now_ns)
            number = int.from_bytes(sync.data, "little")
            found.append(late)
            frames = [] if self.silent else self.suit.on_sync(number, self.now_ns).frames
            complete = [
                self.pipeline.frame(bus, frame.id, frame.data, self.now_ns + NS_PER_MS)
                for bus, frame, _ in frames
            ]
            if any(complete):
                assert complete.index(True) == len(complete) - 1, "only the last frame completes the tick"
                found.append(self.pipeline.close(self.now_ns + NS_PER_MS))
        return [angles for angles in found if angles is not None]


@pytest.fixture
def settled() -> Bench:
    bench = Bench()
    bench.run(320)
    return bench


def test_one_of_sixteen_ticks_is_solved(settled: Bench) -> None:
    angles = settled.run(160)
    assert [s.tick % 16 for s in angles] == [0] * 10
    assert all(s.valid.all() for s in angles)
    assert all(s.frames_in_ns - s.sampled_ns == NS_PER_MS for s in angles)


def test_nothing_is_valid_before_the_filters_have_settled() -> None:
    assert not any(s.valid.any() for s in Bench().run(160))


def test_a_lost_node_takes_just_the_joints_that_need_it() -> None:
    bench = Bench('faults.lose=[{node="left_forearm", from_s=2.0}]')
    bench.run(400)
    after = bench.run(40)[-1]
    names = bench.pipeline.skeleton.joint_names
    gone = {name for name, ok in zip(names, after.valid, strict=True) if not ok}
    assert gone == {"left_elbow_pitch", "left_elbow_roll", "left_wrist_yaw"}
    np.testing.assert_array_equal(after.position_rad[~after.valid], 0.0)


def test_a_sync_that_goes_out_late_turns_no_finger_too_far() -> None:
    """The stall of a busy host: what is sampled a millisecond late has turned on by 0.4° at 400°/s."""
    random = np.random.default_rng(5)
    late_ns = np.round(np.minimum(random.exponential(1.0, 2000), 4.0) * NS_PER_MS).astype(int)
    assert worst_finger_deg(late_ns, np.zeros(2000, dtype=np.bool_)) < 0.2


def test_missed_ticks_turn_no_finger_too_short() -> None:
    missed = np.random.default_rng(6).random(2000) < 0.2
    assert worst_finger_deg(np.zeros(2000, dtype=int), missed) < 0.3


def worst_finger_deg(late_ns: NDArray[np.int_], missed: Mask) -> float:
    """The largest error of a hand that grasps, when SYNCs go out late or not at all; calm for 300 ticks."""
    bench = Bench('grade="ideal"', 'motion="grasp"', examples=EXAMPLES / "hand")
    motion = load_motion("grasp", bench.pipeline.skeleton)
    first_ns, errors_rad = NS_PER_S + PERIOD_NS, []
    for tick in range(len(late_ns)):
        if missed[tick] and tick > 300:
            bench.tick += 1
            continue
        bench.late_ns = int(late_ns[tick]) if tick > 300 else 0
        for angles in bench.run(1):
            true_rad, _, _ = motion.state(1e-9 * (angles.sampled_ns - first_ns))
            if angles.valid.all():
                errors_rad.append(angles.position_rad - true_rad)
    assert len(errors_rad) > 80
    return math.degrees(np.abs(errors_rad).max())


@pytest.mark.parametrize(
    ("gap", "between"), [(1, 0), (2, 1), (MOST_BRIDGED + 1, MOST_BRIDGED), (MOST_BRIDGED + 2, 0)]
)
def test_a_short_gap_is_bridged_evenly_and_a_long_one_not(settled: Bench, gap: int, between: int) -> None:
    last = settled.pipeline.poll.close_window(0)
    later = replace(last, tick=last.tick + gap, gyr_rad_s=last.gyr_rad_s + 1.0)
    found = bridged(last, later)
    assert len(found) == between
    for step, sweep in enumerate(found, start=1):
        np.testing.assert_allclose(sweep.gyr_rad_s, last.gyr_rad_s + step / gap)


def test_a_failed_bus_means_no_valid_joint_but_commands_go_on(settled: Bench) -> None:
    settled.silent = True
    settled.pipeline.bus_down("suit")
    angles = settled.run(161)  # an open window closes at the next tick
    assert len(angles) == 10
    assert not any(s.valid.any() for s in angles)
    settled.silent = False
    assert settled.run(320)[-1].valid.all(), "it comes back"


def test_the_sequence_counts_up_and_the_lease_is_carried(settled: Bench) -> None:
    writer = CommandWriter("r")
    angles = settled.run(16)[0]
    first = writer.write(angles, 5, Grip(True), 10, 11)
    second = writer.write(angles, 6, Grip(False, clutch_out=True), 20, 21)
    assert (first.sequence, second.sequence) == (1, 2)
    assert (first.lease, second.lease, second.deadman_held) == (5, 6, False)
    assert (first.clutch_out, second.clutch_out) == (False, True)
    assert (second.stamps.angles_ns, second.stamps.put_ns) == (20, 21)


def test_a_doubted_node_invalidates_its_joints_and_refuses_engage(
    settled: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = settled.pipeline.skeleton.segment_names.index("left_forearm")
    doubts = {node: NodeDoubt("it repeats one reading", Weight.INVALID)}
    monkeypatch.setattr(settled.pipeline.estimator, "doubts", lambda: doubts)
    angles = settled.run(16)[-1]
    names = settled.pipeline.skeleton.joint_names
    gone = {name for name, ok in zip(names, angles.valid, strict=True) if not ok}
    assert gone == {"left_elbow_pitch", "left_elbow_roll", "left_wrist_yaw"}
    assert angles.doubt == ""
    assert settled.pipeline.doubts == {"left_forearm": doubts[node]}
    doubts[node] = NodeDoubt("two nodes answer", Weight.REFUSED)
    angles = settled.run(16)[-1]
    assert CommandWriter("r").write(angles, 1, Grip(True), 0, 0).doubt == "left_forearm: two nodes answer"
    doubts[node] = NodeDoubt("its field is odd", Weight.NOTED)
    angles = settled.run(16)[-1]
    assert angles.valid.all()
    assert angles.doubt == ""


def test_nobody_engages_before_a_zero_pose_was_good() -> None:
    config = ("estimation.zero_pose_s=0.5",)
    still = Bench(master=config)
    angles = still.run(400)
    assert "waits for the zero pose" in angles[15].doubt
    assert not angles[15].valid.any()
    assert angles[-1].doubt == ""
    assert angles[-1].valid.all()
    # it stands for 3.5 s before it reaches for the bottle
    last = Bench('motion="bottle"', master=("estimation.zero_pose_s=3.0",)).run(1000)[-1]
    assert "zero pose refused: turned" in last.doubt
    assert not last.valid.any()
