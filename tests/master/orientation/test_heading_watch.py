"""A heading that drifts is said with its size and uncertainty, before anybody corrects it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array, angle_between, heading_turn
from common.skeleton import load_skeleton
from master.orientation.affine import identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.orientation.heading_watch import HeadingWatch
from master.suit.doubt import Weight

from .perfect import Node, seen_by

RATE_HZ = 100.0
LEGS = load_skeleton("lower_limb")
COUNT = len(LEGS.segments)
THIGH, SHANK = (LEGS.segment_names.index(f"left_{name}") for name in ("thigh", "shank"))


def worn(aligned: bool = False, **estimation: Any) -> tuple[Estimator, HeadingWatch]:
    """A suit of six-axis nodes that has taken its zero pose."""
    config = {"settle_s": 0.1, "zero_pose_s": 0.2, **estimation}
    cutoffs = {f"{s}_cutoff_hz": 25.0 for s in ("accelerometer", "gyroscope", "magnetometer")}
    calibration = replace(identity(COUNT), alignment_made=np.full(COUNT, aligned))
    nodes = [Node("mahony")] * COUNT  # learns no bias from rest: the drift that is planted stays
    subject = Estimator(EstimationConfig.model_validate(config | cutoffs), nodes, RATE_HZ, calibration, LEGS)
    stand(subject, 1.0)
    assert subject.has_zero_pose
    assert subject.heading_watch is not None
    return subject, subject.heading_watch


def stand(subject: Estimator, seconds: float, drift_deg_s: Array | None = None) -> None:
    """Upright and still, while the gyros say that their nodes turn."""
    rate = np.zeros((COUNT, 3))
    if drift_deg_s is not None:
        rate[:, 2] = np.radians(drift_deg_s)
    readings = replace(seen_by(heading_turn(np.zeros(COUNT)), rate), mag_ut=np.full((COUNT, 3), np.nan))
    for _ in range(round(seconds * RATE_HZ)):
        subject.update(readings)


def one(node: int, deg_s: float) -> Array:
    out = np.zeros(COUNT)
    out[node] = deg_s
    return out


def test_a_shank_that_drifts_is_found_by_its_knee_and_named_but_not_corrected() -> None:
    subject, watch = worn()
    stand(subject, 60.0, one(SHANK, 0.2))
    off, sd = np.degrees(watch.off_rad[SHANK]), np.degrees(watch.sd_rad[SHANK])
    assert off == pytest.approx(12.0, abs=3.0)
    assert abs(off - 12.0) < 3.0 * sd, "the stated uncertainty is true"
    doubt = subject.doubts()[SHANK]
    assert doubt.weight is Weight.NOTED
    assert doubt.words.startswith(f"its heading is {off:+.0f}° ± {sd:.0f}° off against left_thigh")
    q = subject.posture().q_world_from_segment[SHANK]
    assert np.degrees(2.0 * np.arcsin(abs(q[3]))) == pytest.approx(12.0, abs=1.0)


def test_without_drift_nothing_is_said() -> None:
    subject, watch = worn()
    stand(subject, 30.0)
    assert subject.doubts() == {}
    assert np.degrees(np.abs(watch.off_rad)).max() < 0.5


def test_below_the_limit_it_is_a_figure_and_no_doubt() -> None:
    subject, watch = worn(heading_limit_deg=20.0)
    stand(subject, 60.0, one(SHANK, 0.2))
    assert SHANK not in subject.doubts()
    assert watch.figures_deg()["left_shank"][0] == pytest.approx(12.0, abs=3.0)


def test_a_hip_of_which_nothing_tells_is_named_once_it_may_be_far_off() -> None:
    subject, watch = worn(online={"drift_deg_s": 0.5})
    stand(subject, 5.0)
    assert subject.doubts() == {}
    before = watch.sd_rad[THIGH]
    stand(subject, 25.0)
    assert watch.sd_rad[THIGH] > before
    words = subject.doubts()[THIGH].words
    assert "its heading may be off by ±" in words
    assert "against pelvis" in words
    assert SHANK not in subject.doubts(), "its knee tells"


def test_where_joints_correct_headings_only_their_uncertainty_is_left() -> None:
    subject, watch = worn(aligned=True, constraints="auto")
    assert watch.beside is None
    stand(subject, 60.0, one(SHANK, 0.2))
    assert watch.off_rad[SHANK] == 0.0
    assert 0.0 < np.degrees(watch.sd_rad[SHANK]) < 5.0
    q = subject.posture().q_world_from_segment
    assert np.degrees(angle_between(q[SHANK], q[THIGH])) < 2.0, "of the 12° that it would be"


def test_a_zero_pose_taken_again_ends_it() -> None:
    subject, watch = worn()
    stand(subject, 60.0, one(SHANK, 0.2))
    assert SHANK in subject.doubts()
    subject.stand_again()
    stand(subject, 1.0)
    assert subject.standing_again is not None
    assert subject.standing_again.taken.all()
    stand(subject, 5.0)
    assert np.degrees(np.abs(watch.off_rad)).max() < 2.0
    assert subject.doubts() == {}


@pytest.mark.parametrize(
    ("estimation", "there"),
    [({}, False), ({"zero_pose_s": 1.0}, True), ({"zero_pose_s": 1.0, "heading_limit_deg": 0.0}, False)],
)
def test_it_runs_where_something_is_known_of_the_alignments(estimation: Any, there: bool) -> None:
    config = EstimationConfig.model_validate(estimation)
    subject = Estimator(config, [Node()] * COUNT, 200.0, identity(COUNT), LEGS)
    assert (subject.heading_watch is not None) is there
