"""A real person for 100 s, tick by tick as the master goes: sensors askew, no magnetometer, no truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.full_body import RECORDED_AS
from master.calibrate.alignment import find_alignment
from master.calibrate.recording import load_recordings
from master.joint_angles.decomposition import JointAngles
from master.orientation.affine import Calibration, identity
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from tests.master.orientation.perfect import Node, Readings

pytestmark = pytest.mark.long
CONFIG = EstimationConfig.model_validate(
    {"constraints": "online", "zero_pose_s": 1.0}
    | {f"{sensor}_cutoff_hz": 0.0 for sensor in ("accelerometer", "gyroscope", "magnetometer")}
)


@dataclass(frozen=True, slots=True)
class Person:
    skeleton: Skeleton
    rate_hz: float
    angles_deg: Array
    """(T, J) of every tick, once all that was recorded is valid."""


@pytest.fixture(scope="module", params=["nursing", "lower_limb"])
def person(request: pytest.FixtureRequest, real_person: Path) -> Person:
    whole = load_skeleton(request.param)
    there = load_recordings(real_person)
    segments = tuple(s for s in whole.segments if s.name in RECORDED_AS)
    angles = {angle for segment in segments for angle in segment.angles}
    skeleton = Skeleton(whole.name, segments, tuple(j for j in whole.joints if set(j.drives) <= angles))
    nodes = {segment.name: there[RECORDED_AS[segment.name]] for segment in segments}
    found = find_alignment(nodes, skeleton)
    assert found.refused == {}
    alignment = np.array([found.nodes[segment.name].q_sensor_from_segment for segment in segments])
    known = np.ones(len(segments), dtype=np.bool_)
    calibration = Calibration(identity(len(segments)).affine, alignment, known)
    rate_hz = next(iter(nodes.values())).rate_hz
    estimator = Estimator(CONFIG, [Node()] * len(segments), rate_hz, calibration, skeleton)
    solver = JointAngles(skeleton)
    all_, none = np.ones(len(segments), dtype=np.bool_), np.zeros(len(segments), dtype=np.bool_)
    no_field = np.full((len(segments), 3), np.nan)
    solved = []
    for acc, gyr in zip(
        np.stack([node.acc_m_s2 for node in nodes.values()], axis=1),
        np.stack([node.gyr_rad_s for node in nodes.values()], axis=1),
        strict=True,
    ):
        estimator.update(Readings(acc, gyr, no_field, all_, none))
        now = estimator.posture()
        if now.valid.all():
            solved.append(solver.solve(now.q_world_from_segment, now.rate_rad_s)[0])
    assert len(solved) > 97.0 * rate_hz
    return Person(skeleton, rate_hz, np.degrees(solved))


def by_kind(person: Person) -> list[tuple[str, str, Array]]:
    """Each joint's kind, name and angles (T,)."""
    return [
        (name.removeprefix("left_").removeprefix("right_"), name, person.angles_deg[:, j])
        for j, name in enumerate(person.skeleton.joint_names)
    ]


def test_every_angle_is_one_that_a_person_has(
    person: Person, possible_deg: Mapping[str, tuple[float, float]]
) -> None:
    for kind, name, angle in by_kind(person):
        low, high = possible_deg[kind]
        assert low < angle.min(), name
        assert angle.max() < high, name


def test_elbows_and_knees_bend_one_way_only_and_far(person: Person) -> None:
    bending = [
        (name, angle) for kind, name, angle in by_kind(person) if kind in ("elbow_pitch", "knee_flexion")
    ]
    assert len(bending) == 2
    for name, angle in bending:
        assert np.quantile(angle, 0.99) > 60.0, name
        assert np.quantile(angle, 0.05) > -15.0, name


def test_no_joint_jumps(person: Person, fastest_deg_s: Mapping[str, float]) -> None:
    for kind, name, angle in by_kind(person):
        if kind == "ankle_flexion":
            continue  # this person's right foot hardly turned: its axes are known to 5° only
        assert np.abs(np.diff(angle)).max() * person.rate_hz < fastest_deg_s[kind], name


def test_100_s_without_a_magnetometer_nothing_has_drifted(person: Person) -> None:
    """They walk to the end; over the last strides each joint swings about where it did over the first."""
    rate = round(person.rate_hz)
    strides = [slice(56 * rate, 66 * rate), slice(87 * rate, 97 * rate)]
    for _, name, angle in by_kind(person):
        first, last = (float(np.median(angle[stride])) for stride in strides)
        assert abs(last - first) < 25.0, name
