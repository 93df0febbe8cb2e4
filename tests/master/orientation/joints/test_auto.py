"""With `auto` joints correct headings as soon as alignments are known: no worse in a quiet field, cheap."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.quaternion import from_axis_angle
from common.skeleton import Skeleton, load_skeleton
from common.wire.messages import Mask
from deploy.sim.suit.motion import load_motion
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.heading import HeadingMemory
from master.orientation.joints.online import OnlineHeadings
from tests.master.orientation.perfect import RATE_HZ, Node, attitudes, seen_by

from .test_online import LIMBS, TOOL, Sway, of_all

ASKEW = from_axis_angle([0.0, 0.0, 1.0], np.radians(1.0))
"""One degree, so that the alignment counts as known."""


def estimator(constraints: str, aligned: Mask, skeleton: Skeleton) -> Estimator:
    config = {"constraints": constraints}
    calibration = replace(identity(len(aligned)), alignment_made=aligned)
    nodes = [Node()] * len(aligned)
    return Estimator(EstimationConfig.model_validate(config), nodes, RATE_HZ, calibration, skeleton)


@pytest.mark.parametrize(
    ("constraints", "aligned", "online"),
    [
        ("auto", ["left_upper_arm", "left_forearm"], True),
        ("auto", ["left_upper_arm", "right_forearm", "chest"], False),
        ("auto", [], False),
        ("off", ["left_upper_arm", "left_forearm"], False),
        ("online", [], True),
    ],
)
def test_it_is_on_where_both_nodes_of_a_joint_are_aligned(
    arms: Skeleton, constraints: str, aligned: list[str], online: bool
) -> None:
    subject = estimator(constraints, of_all(aligned, arms), arms)
    assert isinstance(subject._heading, OnlineHeadings if online else HeadingMemory)


def test_only_joints_between_aligned_nodes_count(arms: Skeleton) -> None:
    aligned = of_all(["left_upper_arm", "left_forearm"], arms)
    heading = estimator("auto", aligned, arms)._heading
    assert isinstance(heading, OnlineHeadings)
    child = heading._joints.child[heading._counts]
    assert {arms.segment_names[k] for k in child} == {"left_forearm"}


@pytest.mark.parametrize("profile", ["arms", "lower_limb"])
def test_auto_is_no_worse_in_a_quiet_field_and_much_better_beside_iron(
    wear: Any, arms: Skeleton, profile: str
) -> None:
    skeleton = arms if profile == "arms" else load_skeleton(profile)
    motion = Sway(arms) if profile == "arms" else load_motion("walk", skeleton)
    keys = {"q_sensor_from_segment": np.tile(ASKEW, (len(skeleton.segments), 1))}
    settings = ({"constraints": "auto"}, {"constraints": "off"})
    quiet, alone = (wear(skeleton, motion, 16.5, **keys, **more) for more in settings)
    assert quiet.rmse_deg("") < 1.1 * alone.rmse_deg("")
    assert set(LIMBS) & set(skeleton.segment_names), "the iron is at some node"
    beside, without = (wear(skeleton, motion, 16.5, disturbance=TOOL, **keys, **more) for more in settings)
    assert beside.rmse_deg("") < 0.8 * without.rmse_deg("")


@pytest.mark.bench
def test_it_costs_little_of_a_tick() -> None:
    """36 nodes: less than half of what the filters cost, on average over the 16 ticks of a correction."""
    skeleton = load_skeleton("nursing")
    count = len(skeleton.segments)
    all_: Mask = np.ones(count, np.bool_)
    readings = seen_by(attitudes(count), np.zeros((count, 3)))
    online, off = (estimator(constraints, all_, skeleton) for constraints in ("auto", "off"))

    def seconds(subject: Estimator, ticks: int = 1600) -> float:
        before = time.process_time()
        for _ in range(ticks):
            subject.update(readings)
        return (time.process_time() - before) / ticks

    best: Callable[[Estimator], float] = lambda subject: min(seconds(subject) for _ in range(3))  # noqa: E731
    assert best(online) < 1.5 * best(off)
