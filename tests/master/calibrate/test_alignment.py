"""Alignment: simulated persons with sensors askew, and a real one; no magnetometer anywhere."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.config.sensor_calibration import NodeCalibration
from common.errors import TandemError
from common.quaternion import IDENTITY, Array, angle_between, conjugate, rotate
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.full_body import RECORDED_AS
from master.calibrate.alignment import SuitAlignment, find_alignment, posture
from master.calibrate.alignment_files import calibrated, write_alignment
from master.calibrate.hinge import PoorMotionError
from master.calibrate.hinge_pair import find_hinge_pair
from master.calibrate.joint_motion import zero_axes
from master.calibrate.oriented import orient
from master.calibrate.recording import NodeRecording, load_recordings
from master.joint_angles.decomposition import JointAngles
from master.orientation.hinge_angle import HingeAngleConfig, hinge_angles
from tests.master.calibrate.worn import FINGERS, RATE_HZ, Worn, wear


@pytest.fixture(scope="module")
def upper_body() -> Worn:
    return wear("nursing", 0)


@pytest.fixture(scope="module")
def upper_body_alignment(upper_body: Worn) -> SuitAlignment:
    return find_alignment(upper_body.nodes, upper_body.skeleton)


@pytest.fixture(scope="module")
def legs() -> Worn:
    return wear("lower_limb", 0)


@pytest.fixture(scope="module")
def legs_alignment(legs: Worn) -> SuitAlignment:
    return find_alignment(legs.nodes, legs.skeleton)


def errors_deg(worn: Worn, found: SuitAlignment) -> dict[str, float]:
    return {
        name: math.degrees(
            float(angle_between(node.q_sensor_from_segment, conjugate(worn.q_segment_from_sensor[name])))
        )
        for name, node in found.nodes.items()
    }


def solved_deg(nodes: dict[str, NodeRecording], skeleton: Skeleton, found: SuitAlignment, step: int) -> Array:
    """Joint angles (K, J), of every `step`-th sample."""
    q = posture(orient(nodes, list(found.nodes)), found)[::step]
    everyone = np.tile(IDENTITY, (len(q), len(skeleton.segments), 1))
    everyone[:, [skeleton.segment_names.index(name) for name in found.nodes]] = q
    solver, still = JointAngles(skeleton), np.zeros((len(skeleton.segments), 3))
    return np.degrees([solver.solve(now, still)[0] for now in everyone])


def test_every_unit_s_alignment_is_found_within_two_degrees(
    upper_body: Worn, upper_body_alignment: SuitAlignment
) -> None:
    assert upper_body_alignment.refused == {}
    errors = errors_deg(upper_body, upper_body_alignment)
    assert set(errors) == set(upper_body.nodes)
    assert max(errors.values()) < 2.0, errors


def test_it_states_its_uncertainty_honestly(upper_body: Worn, upper_body_alignment: SuitAlignment) -> None:
    for name, error in errors_deg(upper_body, upper_body_alignment).items():
        assert error < 0.5 + 3.0 * math.degrees(upper_body_alignment.nodes[name].sigma_rad), name


def test_the_arms_work_with_sensors_askew_and_no_magnetometer(
    upper_body: Worn, upper_body_alignment: SuitAlignment
) -> None:
    angles = solved_deg(upper_body.nodes, upper_body.skeleton, upper_body_alignment, 5)
    rmse = np.sqrt(np.mean((angles - np.degrees(upper_body.angles_rad[::5])) ** 2, axis=0))
    by_name = dict(zip(upper_body.skeleton.joint_names, rmse.tolist(), strict=True))
    for joint, error in by_name.items():
        if not any(finger in joint for finger in FINGERS):
            assert error < (1.0 if "elbow" in joint else 2.0), (joint, error)


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_elbow_without_a_sign_takes_the_other_one_s(upper_body: Worn, side: str) -> None:
    """One that could bend either way stays within its limits whatever the sign of its axis."""
    at = f"{side}_elbow_pitch"
    joints = [
        replace(j, lower_rad=-3.0, upper_rad=3.0) if j.name == at else j for j in upper_body.skeleton.joints
    ]
    either_way = Skeleton("either way", upper_body.skeleton.segments, tuple(joints))
    errors = errors_deg(upper_body, find_alignment(upper_body.nodes, either_way))
    assert max(errors.values()) < 2.0, errors


@pytest.mark.parametrize("which", ["upper_body", "legs"])
def test_axes_are_within_two_degrees_of_the_truth(which: str, request: pytest.FixtureRequest) -> None:
    worn: Worn = request.getfixturevalue(which)
    found: SuitAlignment = request.getfixturevalue(f"{which}_alignment")
    judged = 0
    for joint in found.joints:
        if joint.axes_known and joint.fit is not None and joint.fit.axes is not None:
            zero = zero_axes(worn.skeleton, worn.skeleton.segment_names.index(joint.segment))
            assert zero is not None
            ends = ((joint.parent, zero[0]), (joint.segment, zero[-1]))
            for (name, axis), answer in zip(ends, joint.fit.axes, strict=True):
                truth = rotate(conjugate(worn.q_segment_from_sensor[name]), axis)
                assert math.degrees(math.acos(min(1.0, abs(float(truth @ answer))))) < 2.0, joint.segment
                judged += 1
    assert judged >= 4


def test_knees_are_solved_and_a_pelvis_that_never_moved_is_refused(
    legs: Worn, legs_alignment: SuitAlignment
) -> None:
    assert set(legs_alignment.refused) == {"pelvis"}
    assert "walk some steps" in legs_alignment.refused["pelvis"]
    assert max(errors_deg(legs, legs_alignment).values()) < 2.0
    angles = solved_deg(legs.nodes, legs.skeleton, legs_alignment, 5)
    for side in ("left", "right"):
        j = legs.skeleton.joint_names.index(f"{side}_knee_flexion")
        assert np.sqrt(np.mean((angles[:, j] - np.degrees(legs.angles_rad[::5, j])) ** 2)) < 2.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hinge_between_two_units_alone_and_its_fused_angle(legs: Worn, side: str) -> None:
    one, two = legs.nodes[f"{side}_thigh"], legs.nodes[f"{side}_shank"]
    pair = find_hinge_pair(one, two)
    axis = np.array(legs.skeleton.segments[legs.skeleton.segment_names.index(two.name)].axes[0], np.float64)
    signs = []
    for name, answers in (
        (one.name, (pair.found.axis1, pair.hinge.axis1)),
        (two.name, (pair.found.axis2, pair.hinge.axis2)),
    ):
        truth = rotate(conjugate(legs.q_segment_from_sensor[name]), axis)
        for answer in answers:
            assert math.degrees(math.acos(min(1.0, abs(float(truth @ answer))))) < 2.0
            signs.append(math.copysign(1.0, float(truth @ answer)))
    assert len(set(signs)) == 1
    track = hinge_angles(
        HingeAngleConfig(), pair.hinge, RATE_HZ, one.gyr_rad_s, one.acc_m_s2, two.gyr_rad_s, two.acc_m_s2
    )
    truth_deg = np.degrees(legs.angles_rad[:, legs.skeleton.joint_names.index(f"{side}_knee_flexion")])
    assert np.sqrt(np.mean((signs[0] * np.degrees(track.angle_rad) - truth_deg) ** 2)) < 2.0


def still(worn: Worn, samples: slice) -> dict[str, NodeRecording]:
    return {
        n: replace(r, acc_m_s2=r.acc_m_s2[samples], gyr_rad_s=r.gyr_rad_s[samples])
        for n, r in worn.nodes.items()
    }


def test_without_any_motion_every_node_is_refused_with_what_to_do(upper_body: Worn) -> None:
    found = find_alignment(still(upper_body, slice(0, 290)), upper_body.skeleton)
    assert found.nodes == {}
    assert set(found.refused) == set(upper_body.nodes)
    assert "bend left_forearm against left_upper_arm ten times" in found.refused["left_forearm"]


def test_without_a_zero_pose_it_is_refused(upper_body: Worn) -> None:
    with pytest.raises(PoorMotionError, match="no node stood still"):
        find_alignment(still(upper_body, slice(500, 1500)), upper_body.skeleton)


def test_a_zero_pose_outside_the_recording_is_refused(upper_body: Worn) -> None:
    with pytest.raises(PoorMotionError, match="not in the recording"):
        find_alignment(upper_body.nodes, upper_body.skeleton, (100.0, 104.0))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda acc, gyr: (acc * 0.1, gyr), "accelerometer reads"),
        (lambda acc, gyr: (acc, gyr * 0.0), "gyroscope reads the same"),
        (lambda acc, gyr: (acc, np.where(np.arange(len(gyr))[:, None] < 900, gyr, np.nan)), "missing"),
    ],
)
def test_a_unit_that_reads_nonsense_is_named(
    upper_body: Worn, spoil: Callable[[Array, Array], tuple[Array, Array]], said: str
) -> None:
    unit = upper_body.nodes["head"]
    acc, gyr = spoil(unit.acc_m_s2, unit.gyr_rad_s)
    nodes = {**upper_body.nodes, "head": replace(unit, acc_m_s2=acc, gyr_rad_s=gyr)}
    found = find_alignment(nodes, upper_body.skeleton)
    assert set(found.refused) == {"head"}
    assert said in found.refused["head"]
    assert max(errors_deg(upper_body, found).values()) < 2.0


def test_files_carry_it_and_what_was_there_is_applied_and_kept(
    upper_body_alignment: SuitAlignment, upper_body: Worn, tmp_path: Path
) -> None:
    (tmp_path / "head.toml").write_text(
        "accelerometer = [[2.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]\n", "utf-8"
    )
    readings = calibrated(upper_body.nodes, tmp_path)
    np.testing.assert_allclose(
        readings["head"].acc_m_s2[:, 0], 2.0 * upper_body.nodes["head"].acc_m_s2[:, 0] + 1.0
    )
    assert readings["chest"] is upper_body.nodes["chest"]
    files = write_alignment(upper_body_alignment, Path("folder/session.npz"), tmp_path, date(2026, 11, 22))
    for name, path in files.items():
        said = load_config(path, NodeCalibration)
        np.testing.assert_allclose(
            said.q_sensor_from_segment, upper_body_alignment.nodes[name].q_sensor_from_segment, atol=1e-9
        )
        assert said.made.alignment is not None
        assert said.made.alignment.recording == "session.npz"
    assert load_config(files["head"], NodeCalibration).accelerometer[0][0] == 2.0


def test_raw_counts_need_a_calibration_first(upper_body: Worn, tmp_path: Path) -> None:
    counts = {"head": replace(upper_body.nodes["head"], counts=True)}
    with pytest.raises(TandemError, match="head: raw counts; calibrate it first"):
        calibrated(counts, tmp_path)


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
@pytest.mark.long
def test_a_real_person_moves_as_people_can(
    profile: str,
    real_person: Path,
    possible_deg: Mapping[str, tuple[float, float]],
    fastest_deg_s: Mapping[str, float],
) -> None:
    skeleton = load_skeleton(profile)
    there = load_recordings(real_person)
    nodes = {n: there[RECORDED_AS[n]] for n in skeleton.segment_names if n in RECORDED_AS}
    found = find_alignment(nodes, skeleton)
    assert found.refused == {}
    angles = solved_deg(nodes, skeleton, found, 2)
    for j, name in enumerate(skeleton.joint_names):
        kind = name.removeprefix("left_").removeprefix("right_")
        if kind not in possible_deg:
            continue
        low, high = possible_deg[kind]
        assert low < angles[:, j].min(), name
        assert angles[:, j].max() < high, name
        fastest = np.max(np.abs(np.diff(angles[:, j]))) * 50.0
        assert fastest < fastest_deg_s[kind], (name, fastest)
        if kind in ("elbow_pitch", "knee_flexion"):
            # bends one way only, and far
            assert np.quantile(angles[:, j], 0.99) > 60.0, name
            assert np.quantile(angles[:, j], 0.05) > -15.0, name


@pytest.mark.long
def test_what_the_real_person_s_halves_say_agrees(real_person: Path) -> None:
    """Sitting down and standing up, and walking: two motions without a sample in common, one alignment."""
    skeleton = load_skeleton("lower_limb")
    there = load_recordings(real_person)
    halves = []
    for part in (slice(0, 5300), np.r_[0:480, 5300:10000]):
        nodes = {
            n: replace(there[RECORDED_AS[n]], **{
                key: getattr(there[RECORDED_AS[n]], key)[part] for key in ("acc_m_s2", "gyr_rad_s")
            })
            for n in skeleton.segment_names
        }  # fmt: skip
        halves.append(find_alignment(nodes, skeleton, (0.2, 2.0)))
    for name in ("left_thigh", "left_shank", "right_thigh", "right_shank"):
        one, other = (half.nodes[name].q_sensor_from_segment for half in halves)
        assert math.degrees(float(angle_between(one, other))) < 10.0, name


def test_a_recording_of_a_moment_is_refused() -> None:
    up, none = np.tile([0.0, 0.0, 9.81], (4, 1)), np.zeros((4, 3))
    nodes = {name: NodeRecording(name, 5.0, up, none) for name in ("left_upper_arm", "left_forearm")}
    with pytest.raises(PoorMotionError, match=r"0\.8 s are too short"):
        find_alignment(nodes, load_skeleton("nursing"), (0.0, 0.4))


def test_one_arm_alone_leaves_trunk_and_other_arm_open(real_person: Path) -> None:
    """This person's arms are turned in by 36° each: only both together face ahead."""
    skeleton = load_skeleton("nursing")
    there = load_recordings(real_person)
    nodes = {n: there[RECORDED_AS[n]] for n in skeleton.segment_names if n in RECORDED_AS}
    del nodes["left_forearm"]
    found = find_alignment(nodes, skeleton)
    assert {"chest", "head", "left_upper_arm", "left_hand"} <= set(found.refused)
    assert set(found.nodes) == {"right_upper_arm", "right_forearm", "right_hand"}
