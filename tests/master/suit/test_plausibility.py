"""Wrong readings are not believed within 0.2 s of the evidence; those of a node that stands still are."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest

from common.quaternion import Array
from deploy.sim.suit.faults import FaultsConfig
from deploy.sim.suit.wrong_readings import WrongReadingKind
from deploy.sim.world.copy import copied
from master.suit.doubt import Weight
from master.suit.plausibility import PlausibilityWatch
from master.suit.plausibility_config import PlausibilityConfig
from tests.master.test_pipeline import Bench

NODE = "right_forearm"
JOINTS = {"right_elbow_pitch", "right_elbow_roll", "right_wrist_yaw"}
BEGINS_S = 3.0


@cache
def sound(motion: str) -> Bench:
    """Sound nodes until the tick before the wrong readings begin; to be copied."""
    bench = Bench(f'motion="{motion}"')
    bench.run(round(200 * BEGINS_S))
    return bench


def lying(kind: str, motion: str, more: str = "") -> Bench:
    bench = copied(sound(motion))
    wrong = tomllib.loads(f'wrong_reading=[{{node="{NODE}",kind="{kind}",from_s={BEGINS_S}{more}}}]')
    bench.suit.faults.config = FaultsConfig.model_validate(wrong)
    return bench


def invalid_after_s(bench: Bench, begins_s: float = BEGINS_S, most_s: float = 5.0) -> float | None:
    """From the wrong reading until a command says so; every other joint must stay valid."""
    names = bench.pipeline.skeleton.joint_names
    bench.run(round(200 * begins_s) - bench.tick)
    while bench.tick < 200 * (begins_s + most_s):
        for solved in bench.run(1):
            gone = {name for name, valid in zip(names, solved.valid, strict=True) if not valid}
            if gone:
                assert gone == JOINTS
                return (solved.tick - 1) / 200 - begins_s
    return None


AT_ONCE = [
    ("frozen", "", "frozen: repeats one reading"),
    ("zero", "", "reads zero on every axis"),
    ("ones", "", "reads all ones"),
    ("stuck", ",axis=0", "accelerometer x is stuck"),
    ("stuck", ",axis=2", "accelerometer z is stuck"),
    ("saturated", "", "saturated"),
    ("saturated", ",axis=1", "accelerometer y is saturated"),
    ("saturated", ",axis=5", "gyroscope z is saturated"),
    ("rescaled", ",factor=2.0", "2.0"),
    ("rescaled", ",factor=4.0", "g while still"),
    ("rescaled", ",factor=0.5", "0.5"),
    ("self_test", "", "g while still"),
]


@pytest.mark.parametrize(("kind", "more", "words"), AT_ONCE)
@pytest.mark.parametrize("motion", ["calibration_pose", "bottle"])
def test_a_liar_is_named_within_a_fifth_of_a_second(
    motion: str, kind: WrongReadingKind, more: str, words: str
) -> None:
    bench = lying(kind, motion, more)
    after_s = invalid_after_s(bench)
    assert after_s is not None
    assert after_s <= 0.2
    doubt = bench.pipeline.doubts[NODE]
    assert words in doubt.words
    assert doubt.weight is Weight.REFUSED


@pytest.mark.parametrize(("begins_s", "within_s"), [(3.0, 0.55), (4.6, 0.2)], ids=["at rest", "turning"])
def test_a_stuck_gyro_axis_is_named_once_chance_is_ruled_out(begins_s: float, within_s: float) -> None:
    """At rest a gyro's reading repeats by chance, and one that stands near zero does no harm yet."""
    bench = Bench(
        'motion="bottle"', f'faults.wrong_reading=[{{node="{NODE}",kind="stuck",axis=4,from_s={begins_s}}}]'
    )
    after_s = invalid_after_s(bench, begins_s=begins_s)
    assert after_s is not None
    assert after_s <= within_s
    assert "gyroscope y is stuck" in bench.pipeline.doubts[NODE].words


@pytest.mark.parametrize(
    ("kind", "more"), [("flipped_gyro", ""), ("flipped_gyro", ",axis=4"), ("dead_gyro", "")]
)
def test_a_gyro_that_contradicts_gravity_is_named_once_the_node_turns(
    kind: WrongReadingKind, more: str
) -> None:
    """The bottle's forearm begins to turn two seconds after the wrong readings begin."""
    bench = lying(kind, "bottle", more)
    after_s = invalid_after_s(bench)
    assert after_s is not None
    assert after_s < 3.2
    assert "contradicts gravity" in bench.pipeline.doubts[NODE].words


@pytest.mark.parametrize("grade", ["ideal", "calibrated"])
@pytest.mark.parametrize("motion", ["calibration_pose", "bottle", "sweep"])
def test_sound_nodes_are_believed(motion: str, grade: str) -> None:
    bench = Bench(f'motion="{motion}"', f'grade="{grade}"')
    bench.run(400)
    doubted = [solved.doubt for solved in bench.run(1600) if solved.doubt]
    assert doubted == []
    assert bench.pipeline.plausibility.doubts() == {}


def test_a_magnetometer_that_hangs_is_left_out_and_joints_stay_valid() -> None:
    bench = lying("frozen_mag", "bottle")
    assert invalid_after_s(bench) is None
    doubt = bench.pipeline.plausibility.doubts()[bench.pipeline.skeleton.segment_names.index(NODE)]
    assert "magnetometer" in doubt.words
    assert doubt.weight is Weight.NOTED


@pytest.mark.parametrize("kind", ["zero", "ones", "overflow_mag"])
def test_what_no_magnetometer_can_read_is_no_reading(kind: WrongReadingKind) -> None:
    bench = lying(kind, "calibration_pose")
    bench.run(20)
    node = bench.pipeline.skeleton.segment_names.index(NODE)
    assert np.isnan(bench.pipeline.poll.readings[node, 6:]).all()


def test_a_mended_liar_settles_before_its_joints_are_valid() -> None:
    bench = lying("frozen", "calibration_pose", ",until_s=3.5")
    assert invalid_after_s(bench) is not None
    valid_at = next(s.tick / 200 for _ in range(1200) for s in bench.run(1) if s.valid.all() and not s.doubt)
    # wrong until 3.5 s; then nothing may be wrong for `clear_s`, and the filter settles for a second
    assert 3.5 + 2.0 + 1.0 <= valid_at < 3.5 + 2.0 + 1.0 + 0.3


def test_one_zero_reading_is_left_out() -> None:
    """A unit that resets itself now and then: each zero is no sample, and the node stays believed."""
    calm = Bench("faults.wrong_reading=[]")
    calm.run(400)
    odd = Bench(
        "faults.wrong_reading=["
        + ",".join(
            f'{{node="{NODE}",kind="zero",from_s={2 + k / 10},until_s={2 + k / 10 + 0.004}}}'
            for k in range(9)
        )
        + "]"
    )
    odd.run(400)
    last_calm, last_odd = calm.run(200)[-1], odd.run(200)[-1]
    assert last_odd.valid.all()
    assert np.degrees(np.abs(last_calm.position_rad - last_odd.position_rad).max()) < 0.1


@cache
def still_counts() -> np.ndarray:
    """A unit at rest, 40 s at 200 Hz, of a gyro with 0.5 counts of noise and an accelerometer of 2."""
    random = np.random.default_rng(7)
    truth = np.repeat([[0.3, 0.2, 4096.4, 0.0, 0.3, 0.6, 0.0, 0.0, 0.0]], 8000, axis=0)
    noise = random.standard_normal(truth.shape) * np.repeat([2.0, 0.5, 1.0], 3)
    counts: Array = np.rint(truth + noise)
    return counts


def judged(counts: np.ndarray, **settings: object) -> list[str]:
    """Words that were said of a single node."""
    from master.suit.protocol import SuitProtocol
    from master.suit.sweep import Sweep

    scale = SuitProtocol.load().fd.scale
    watch = PlausibilityWatch(PlausibilityConfig.model_validate(settings), 1, 200.0, scale)
    said, yes, no = [], np.array([True]), np.array([False])
    for tick, row in enumerate(counts * scale):
        values = row[None]
        sweep = Sweep(tick, 5_000_000 * tick, 0, values[:, :3], values[:, 3:6], values[:, 6:], yes, no)
        watch.take(sweep, values)
        said += [doubt.words for doubt in watch.doubts().values()]
    return sorted(set(said))


def test_a_quiet_gyro_at_rest_is_not_stuck() -> None:
    assert judged(still_counts()) == []


def test_readings_without_noise_are_frozen_unless_declared() -> None:
    exact = np.repeat([[0.0, 0.0, 4096.0, 0.0, 0.0, 0.0, 200.0, 0.0, -470.0]], 400, axis=0)
    assert "frozen" in judged(exact)[0]
    assert judged(exact, noise_free=True) == []


@pytest.mark.parametrize(("ticks", "frozen"), [(19, False), (24, True)])
def test_the_time_of_a_repeat(ticks: int, frozen: bool) -> None:
    counts = still_counts()[:400].copy()
    counts[200 : 200 + ticks, :6] = counts[199, :6]
    assert bool(judged(counts)) == frozen


@pytest.mark.parametrize(("clipped", "doubted"), [(3, False), (8, True)])
def test_the_share_of_a_gyro_that_is_clipped(clipped: int, doubted: bool) -> None:
    counts = still_counts()[:400].copy()
    counts[200 : 200 + clipped, 4] = 32767
    assert bool(judged(counts)) == doubted


def test_a_slow_steady_turn_is_no_bias() -> None:
    """An arm raised at 20 °/s: steady enough to look like rest, but gravity goes through the node."""
    from master.suit.protocol import SuitProtocol

    rate = np.repeat(np.radians([0.0, 20.0, 0.0, -20.0, 0.0]), [600, 1000, 400, 1000, 600])
    angle = np.cumsum(rate) / 200.0
    none = np.zeros_like(rate)
    truth = np.stack([9.81 * np.sin(angle), none, 9.81 * np.cos(angle), none, -rate, none], axis=1)
    counts = truth / SuitProtocol.load().fd.scale[:6]
    noise = np.random.default_rng(3).standard_normal((len(rate), 9)) * np.repeat([8.0, 0.8, 1.0], 3)
    said = judged(np.rint(np.concatenate([counts, np.full((len(rate), 3), 300.0)], axis=1) + noise))
    assert said == [] or "contradicts" in said[0]
    turned = counts * [1, 1, 1, -1, -1, -1]
    other = judged(np.rint(np.concatenate([turned, np.full((len(rate), 3), 300.0)], axis=1) + noise))
    assert [bool(said), bool(other)].count(True) == 1, "one sign is right, the other contradicts gravity"
