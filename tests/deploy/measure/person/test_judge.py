"""A suit is accepted on a good person, and each planted fault is refused for its own reason."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from common.recording.node import NodeRecording
from deploy.measure.person.axes import axis_scales
from deploy.measure.person.joints import shared_joint
from deploy.measure.person.judge import PersonJudgement, judge_person
from deploy.measure.person.steps import STEP_S, STEPS, expected
from tests.deploy.measure.person.led import PARENTS, RATE_HZ, led_person

Nodes = dict[str, NodeRecording]
NODE = "right_forearm"


@cache
def person() -> Nodes:
    return led_person()


def judged(nodes: Nodes, led: bool = True) -> PersonJudgement:
    return judge_person(nodes, PARENTS, led)


def changed(name: str, change: Callable[[NodeRecording], NodeRecording]) -> Nodes:
    return {**person(), name: change(person()[name])}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_good_person_is_accepted(seed: int) -> None:
    result = judged(led_person(seed))
    assert result.findings == ()
    assert result.accepted
    arms = [axis for axis in result.not_judged if "arm" in axis or "hand" in axis]
    assert len(arms) <= 3, "the steps show nearly each axis of the arms"


def _swap(one: str, other: str) -> Callable[[], Nodes]:
    return lambda: {**person(), one: person()[other], other: person()[one]}


def _scaled(gyr: float, acc: float = 1.0) -> Callable[[], Nodes]:
    return lambda: changed(NODE, lambda n: replace(n, gyr_rad_s=n.gyr_rad_s * gyr, acc_m_s2=n.acc_m_s2 * acc))


def _mirrored(axis: int, of_acc: bool = False) -> Callable[[], Nodes]:
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    if of_acc:
        return lambda: changed(NODE, lambda n: replace(n, acc_m_s2=n.acc_m_s2 * sign))
    return lambda: changed(NODE, lambda n: replace(n, gyr_rad_s=n.gyr_rad_s * sign))


def _drifting() -> Nodes:
    """The bias grows to 5 °/s from the middle on."""

    def drift(node: NodeRecording) -> NodeRecording:
        grown = np.clip(np.linspace(-1.0, 1.0, len(node.gyr_rad_s)), 0.0, 1.0)
        return replace(node, gyr_rad_s=node.gyr_rad_s + np.radians(5.0) * grown[:, None] * [0.6, 0.8, 0.0])

    return changed(NODE, drift)


def _frozen(seconds: float) -> Callable[[], Nodes]:
    def freeze(node: NodeRecording) -> NodeRecording:
        begin = round(50.0 * RATE_HZ)
        until = begin + round(seconds * RATE_HZ)
        acc, gyr = node.acc_m_s2.copy(), node.gyr_rad_s.copy()
        acc[begin:until], gyr[begin:until] = acc[begin], gyr[begin]
        return replace(node, acc_m_s2=acc, gyr_rad_s=gyr)

    return lambda: changed(NODE, freeze)


def _silent() -> Nodes:
    def lose(node: NodeRecording) -> NodeRecording:
        gyr = node.gyr_rad_s.copy()
        gyr[1000:2000] = np.nan
        return replace(node, gyr_rad_s=gyr)

    return changed(NODE, lose)


FAULTS: dict[str, tuple[Callable[[], Nodes], set[tuple[str, str]]]] = {
    "left and right": (
        _swap("left_forearm", "right_forearm"), {("left_forearm", "swapped"), ("right_forearm", "swapped")}
    ),
    "along one arm": (
        _swap("right_upper_arm", "right_forearm"),
        {("right_upper_arm", "swapped"), ("right_forearm", "swapped")},
    ),
    "gyro's x mirrored": (_mirrored(0), {(NODE, "mirrored")}),
    "gyro's y mirrored": (_mirrored(1), {(NODE, "mirrored")}),
    "gyro's z mirrored": (_mirrored(2), {(NODE, "mirrored")}),
    "accelerometer's y mirrored": (_mirrored(1, of_acc=True), {(NODE, "mirrored")}),
    "gyro reads 70 %": (_scaled(0.7), {(NODE, "scale")}),
    "gyro reads 140 %": (_scaled(1.4), {(NODE, "scale")}),
    "gyro in degrees": (_scaled(57.3), {(NODE, "rate")}),
    "accelerometer reads 88 %": (_scaled(1.0, 0.88), {(NODE, "scale")}),
    "drifting": (_drifting, {(NODE, "drifts")}),
    "frozen for 2 s": (_frozen(2.0), {(NODE, "frozen")}),
    "silent for 10 s": (_silent, {(NODE, "silent")}),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_each_planted_fault_is_refused_for_its_own_reason(fault: str) -> None:
    make, expects = FAULTS[fault]
    found = judged(make()).findings
    assert {(one.node, one.what) for one in found} == expects, [one.words for one in found]


def test_what_is_named_as_mirrored_is_what_was_mirrored() -> None:
    for axis in range(3):
        [one] = judged(_mirrored(axis)()).findings
        assert f"axis {'xyz'[axis]}" in one.words
    [one] = judged(_mirrored(1, of_acc=True)()).findings
    assert "accelerometer's axis y" in one.words


def test_a_node_that_slipped_is_refused() -> None:
    def slipped(node: NodeRecording) -> NodeRecording:
        turned = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # by 120°
        half = len(node.gyr_rad_s) // 2
        acc, gyr = (np.vstack([x[:half], x[half:] @ turned.T]) for x in (node.acc_m_s2, node.gyr_rad_s))
        return replace(node, acc_m_s2=acc, gyr_rad_s=gyr)

    found = judged(changed(NODE, slipped)).findings
    assert {one.node for one in found} == {NODE}


def test_who_does_nothing_is_told_so() -> None:
    still = {
        name: replace(
            node,
            gyr_rad_s=np.tile(node.gyr_rad_s[:1000], (12, 1)),
            acc_m_s2=np.tile(node.acc_m_s2[:1000], (12, 1)),
        )
        for name, node in person().items()
    }
    assert {one.what for one in judged(still).findings} == {"idle"}


def test_the_steps_are_ten_and_two_minutes_and_each_arm_is_told_from_the_other() -> None:
    assert len(STEPS) == 10
    assert STEP_S * len(STEPS) == 120.0
    names = (
        "left_upper_arm",
        "left_forearm",
        "left_hand",
        "right_upper_arm",
        "right_forearm",
        "right_hand",
        "head",
    )
    signs = {name: tuple(expected(step, name) for step in STEPS) for name in names}
    for one in names:
        for other in names:
            differ = any({a, b} == {0.0, 1.0} for a, b in zip(signs[one], signs[other], strict=True))
            assert differ or one == other or "head" in (one, other), (one, other)


DATA = Path(os.environ.get("TANDEM_DATA", "/nonexistent"))
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="TANDEM_DATA names no folder with real recordings")
BODY = {
    "head": "upper_back", "lower_back": "hip", "upper_back": "lower_back",
    **{f"{part}_{side}": f"{above}_{side}" for side in ("left", "right") for part, above in (
        ("forearm", "upper_arm"), ("hand", "forearm"))},
}  # fmt: skip


@needs_data
def test_a_real_person_who_was_not_led_is_accepted() -> None:
    with np.load(DATA / "human_full_body.npz") as file:
        nodes = {
            name: NodeRecording(
                name, 100.0, file[f"{name}_acc"].astype(float), file[f"{name}_gyr"].astype(float)
            )
            for name in (key[:-4] for key in file if key.endswith("_acc"))
        }
    result = judge_person(nodes, BODY, led=False)
    assert result.findings == ()
    arm = nodes["forearm_left"]
    for axis in range(3):
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        broken = {**nodes, "forearm_left": replace(arm, gyr_rad_s=arm.gyr_rad_s * sign)}
        found = judge_person(broken, BODY, led=False).findings
        assert "forearm_left" in {one.node for one in found}, "xyz"[axis]
    crossed = {**nodes, "forearm_left": nodes["hand_right"], "hand_right": arm}
    assert {one.what for one in judge_person(crossed, BODY, led=False).findings} >= {"apart"}
    for name, node in crossed.items():
        (acc := node.acc_m_s2.copy())[100] = np.nan
        crossed[name] = replace(node, acc_m_s2=acc)
    lossy = judge_person(crossed, BODY, led=False).findings
    assert {one.what for one in lossy} >= {"apart"}, "one answer that was lost hides nothing"


@needs_data
@pytest.mark.parametrize(
    "name", ["broad_02_undisturbed_slow_rotation_B", "broad_06_undisturbed_fast_rotation_A"]
)
def test_a_real_sensor_is_sound_and_its_planted_faults_are_measured(name: str) -> None:
    with np.load(DATA / f"{name}.npz") as file:
        acc, gyr, rate_hz = file["acc"].astype(float), file["gyr"].astype(float), float(file["rate_hz"])
    answered = np.isfinite(acc).all(axis=1) & np.isfinite(gyr).all(axis=1)
    for factor in ([1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 0.8, 1.0], [1.0, 1.0, 1.3]):
        found = axis_scales(acc, gyr * factor, rate_hz, answered).scale
        known = np.isfinite(found)
        assert known.sum() >= 2
        assert found[known] == pytest.approx(1.0 / np.array(factor)[known], abs=0.06)


def test_an_answer_that_was_lost_does_not_hide_the_joint() -> None:
    random = np.random.default_rng(1)
    sides = [tuple(random.normal(size=(800, 3)) for _ in range(2)) for _ in range(2)]
    (one, _), (other, _) = sides
    whole = shared_joint((one, sides[0][1]), (other, sides[1][1]), RATE_HZ)
    one[10] = np.nan
    found = shared_joint((one, sides[0][1]), (other, sides[1][1]), RATE_HZ)
    assert found.residual_m_s2 == pytest.approx(whole.residual_m_s2, rel=0.05)
    assert found.motion_m_s2 == pytest.approx(whole.motion_m_s2, rel=0.05)
