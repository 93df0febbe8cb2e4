"""The guide on a virtual clock, with the simulated operator who calibrates raw units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from common.can.config import BusConfig
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.calibrate.live.guide import Guide, GuideOptions, StepName
from deploy.calibrate.live.steps import ZeroPoseStep
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.suit import _wearer
from deploy.sim.suit.tray import TrayConfig
from master.suit.nodes import NodeConfig

RATE_HZ = 50.0
HAND = load_skeleton("hand")
TRAY = TrayConfig(attitudes=22, still_s=2.0, tumble_s=25.0)
OPTIONS = GuideOptions(still_s=1.0, attitudes=20, tumble_s=5.0, zero_pose_s=3.0, move_joints_s=6.0)


def suit(motion: str, **changes: object) -> SuitConfig:
    return SuitConfig.model_validate({
        "profile": "hand",
        "buses": [BusConfig(name="suit", interface="virtual", channel="x")],
        "nodes": {name: NodeConfig(id=i + 1, bus="suit") for i, name in enumerate(HAND.segment_names)},
        "motion": motion,
        "grade": "raw",
        "seed": 3,
        "tray": TRAY,
        **changes,
    })  # fmt: skip


@pytest.fixture(scope="module")
def readings() -> Array:
    """(T, 15, 9): the tray once, then the hand put on, the zero pose, every joint moved; twice."""
    wearer = _wearer(suit("calibration"), HAND)
    return np.array([wearer.at(t).readings for t in np.arange(0.0, 190.0, 1.0 / RATE_HZ)])


@dataclass
class Run:
    guide: Guide
    began_s: dict[StepName, float]


def led(readings: Array, options: GuideOptions = OPTIONS, guide: Guide | None = None) -> Run:
    if guide is None:
        guide = Guide([True] * readings.shape[1], HAND.parents.tolist(), RATE_HZ, options)
    began: dict[StepName, float] = {guide.step: 0.0}
    for k in range(0, len(readings), 10):
        guide.add(readings[k : k + 10])
        began.setdefault(guide.step, (k + 10) / RATE_HZ)
    return Run(guide, began)


def test_it_leads_through_all_steps_in_order_to_the_end(readings: Array) -> None:
    run = led(readings)
    assert list(run.began_s) == ["attitudes", "tumble", "wear", "zero_pose", "move_joints", "done"]
    assert run.guide.view().nodes == []
    begin, end = run.guide.zero_pose_s
    zero_pose = readings[:, :, 3:6][round((run.began_s["zero_pose"] + begin) * RATE_HZ) :][
        : int(3.0 * RATE_HZ)
    ]
    assert end - begin == pytest.approx(OPTIONS.zero_pose_s, abs=0.3)
    assert zero_pose.std(axis=0).max() < 0.01


@pytest.mark.parametrize(
    ("what", "steps"),
    [
        (("imu",), ["attitudes", "done"]),
        (("mag",), ["tumble", "done"]),
        (("imu", "mag"), ["attitudes", "tumble", "done"]),
    ],
)
def test_it_asks_only_for_what_is_wanted(readings: Array, what: tuple[str, ...], steps: list[str]) -> None:
    options = GuideOptions(what, still_s=1.0, tumble_s=5.0)  # type: ignore[arg-type]
    assert list(led(readings, options).began_s) == steps


def test_resting_twice_in_one_attitude_counts_once(readings: Array) -> None:
    rest = readings[:100]
    between = readings[100:150]
    run = led(np.concatenate([rest, between, rest, between, rest]))
    assert run.guide.step == "attitudes"
    assert {node.text.split(" ")[0] for node in run.guide.view().nodes} == {"1"}


def test_attitudes_about_one_axis_are_not_enough() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    noise = np.random.default_rng(1)
    blocks = []
    for angle in angles:
        block = 1e-3 * noise.standard_normal((150, 2, 9))
        block[..., 0] += 9.8 * np.cos(angle)
        block[..., 1] += 9.8 * np.sin(angle)
        block[:8, :, 3] += np.linspace(0.0, 1.0, 8)[:, None]
        blocks.append(block)
    guide = Guide([True, True], [-1, 0], RATE_HZ, OPTIONS)
    run = led(np.concatenate(blocks), guide=guide)
    assert run.guide.step == "attitudes"
    assert all("alike" in node.text for node in run.guide.view().nodes)


def test_a_silent_node_is_named_and_not_waited_for(readings: Array) -> None:
    without = readings.copy()
    without[:, 4] = np.nan
    run = led(without[: round(100 * RATE_HZ)])
    assert run.guide.step != "attitudes"
    assert "silent" in run.guide.view().nodes[4].text


def test_a_suit_that_says_nothing_goes_nowhere(readings: Array) -> None:
    run = led(np.full_like(readings[:2000], np.nan))
    assert run.guide.step == "attitudes"
    assert all("silent" in node.text for node in run.guide.view().nodes)


def test_noise_about_one_direction_is_no_sphere() -> None:
    noise = np.random.default_rng(2).standard_normal((3000, 2, 9))
    noise[..., 6:] *= 0.2
    noise[..., 6:] += 30.0
    guide = Guide([True, True], [-1, 0], RATE_HZ, GuideOptions(("mag",), tumble_s=0.0))
    run = led(noise, guide=guide)
    assert run.guide.step == "tumble"
    assert all(node.share == 0.0 for node in run.guide.view().nodes)


def test_the_units_in_the_tray_do_not_count_as_worn(readings: Array) -> None:
    options = GuideOptions(("align",))
    tray = readings[: round(60 * RATE_HZ)]
    assert list(led(tray, options).began_s) == ["wear"]


def test_the_zero_pose_waits_for_the_word_where_a_person_can_give_it(readings: Array) -> None:
    options = GuideOptions(("align",), by_word=True)
    worn_from = round(led(readings).began_s["wear"] * RATE_HZ)
    run = led(readings[worn_from:], options)
    assert run.guide.step == "zero_pose"
    run.guide.word()
    led(readings[worn_from:], options, run.guide)
    assert run.guide.step in ("move_joints", "done")


def test_the_zero_pose_counts_only_once_the_countdown_is_over(readings: Array) -> None:
    options = GuideOptions(("align",), by_word=True, countdown_s=2.0, move_joints_s=6.0)
    run = led(readings)
    still_from = round((run.began_s["zero_pose"] + run.guide.zero_pose_s[0]) * RATE_HZ)
    pose = readings[still_from : still_from + 100]
    guide = Guide([True] * 15, HAND.parents.tolist(), RATE_HZ, options)
    led(readings[round(run.began_s["wear"] * RATE_HZ) :], options, guide)
    assert guide.step == "zero_pose"
    shown = guide.view().zero_pose
    assert shown is not None
    assert (shown.waits, shown.countdown_s) == (True, 0.0)
    guide.word()
    held = []
    for k in range(0, 12 * 30, 12):  # windows of 0.25 s of somebody who stands still all the time
        guide.add(pose[(k % 84) : (k % 84) + 12])
        shown = guide.view().zero_pose
        if shown is not None:
            held.append((round(shown.countdown_s, 2), round(shown.held_s, 2)))
    assert [at for at, _ in held[:3]] == [1.76, 1.52, 1.28]
    first = next(k for k, (_, seconds) in enumerate(held) if seconds > 0.0)
    assert held[first - 1][0] == 0.0
    assert all(seconds == 0.0 for at, seconds in held if at > 0.0)
    assert guide.step == "move_joints"


def test_a_second_word_calls_the_countdown_off() -> None:
    step = ZeroPoseStep(1, 3.0, True, 5.0)
    step.word()
    assert step.countdown_s == 5.0
    assert not step.waits
    step.word()
    assert step.countdown_s == 0.0
    assert step.waits


def test_a_person_may_go_on_with_what_there_is(readings: Array) -> None:
    guide = Guide([True] * 15, HAND.parents.tolist(), RATE_HZ, OPTIONS)
    guide.add(readings[:100])
    guide.word()
    guide.add(readings[100:130])
    assert guide.step == "tumble"


@pytest.mark.parametrize("length", [1, 7, 100])
def test_the_blocks_it_gets_do_not_matter(readings: Array, length: int) -> None:
    guides = [Guide([True] * 15, HAND.parents.tolist(), RATE_HZ, OPTIONS) for _ in range(2)]
    some = readings[: 12 * 70]
    guides[0].add(some)
    for k in range(0, len(some), length):
        guides[1].add(some[k : k + length])
    assert guides[0].view() == guides[1].view()
