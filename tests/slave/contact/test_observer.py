"""The observer against the torque that MuJoCo itself applies from outside."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.contact.observer import SUDDEN, MomentumObserver
from slave.encoders.counts import RAD_PER_COUNT
from slave.model.build import build_model, unit_rates
from slave.servos.mujoco.effort import MotorTorque

STEP_NS = 4_000_000
T_S = 0.01
SKELETON = load_skeleton("nursing")
ELBOW = SKELETON.joint_names.index("left_elbow_pitch")
SHOULDER = SKELETON.joint_names.index("left_shoulder_pitch")


def moving(
    observer: MomentumObserver,
    push_n: float,
    *,
    count_rad: float = 0.0,
    from_step: int = 500,
    steps: int = 750,
) -> tuple[Array, Array]:
    """External torques, estimated and true, (T, J): both arms swing, and the left forearm is pushed."""
    model = build_model(SKELETON)
    data = mujoco.MjData(model)
    rates, torque = unit_rates(SKELETON, model), MotorTorque(SKELETON, model, data)
    middle, span = 0.5 * (SKELETON.lower_rad + SKELETON.upper_rad), SKELETON.upper_rad - SKELETON.lower_rad
    data.qpos[:] = middle @ rates
    forearm = model.body("left_forearm").id
    joint_per_hinge = np.linalg.pinv(rates)
    jacobian = np.empty((3, model.nv))
    estimated, true = [], []
    for k in range(steps):
        data.ctrl[:] = middle + 0.1 * span * np.sin(2 * np.pi * 0.4 * k * 0.004 + np.arange(len(middle)))
        data.xfrc_applied[forearm, :3] = (0.0, 0.0, push_n if k >= from_step else 0.0)
        torque.before()
        mujoco.mj_step(model, data)
        torque.after()
        position = data.qpos @ joint_per_hinge
        if count_rad:
            position = np.rint(position / count_rad) * count_rad
        observer.update((k + 1) * STEP_NS, position, torque.joint_nm)
        mujoco.mj_jacBodyCom(model, data, jacobian, None, forearm)
        estimated.append(observer.external_nm.copy())
        true.append(rates @ (jacobian.T @ data.xfrc_applied[forearm, :3]))
    return np.array(estimated), np.array(true)


def test_the_residual_is_the_torque_from_outside() -> None:
    observer = MomentumObserver(SKELETON, (T_S,))
    estimated, true = moving(observer, push_n=40.0)
    assert observer.ready
    assert np.abs(true[-1, ELBOW]) > 2.0
    for joint in (ELBOW, SHOULDER):
        gap = estimated[-100:, joint] - true[-100:, joint]
        assert np.abs(gap).max() < 0.1 * np.abs(true[-100:, joint]).max()


def test_without_a_push_motion_alone_leaves_almost_nothing() -> None:
    estimated, _ = moving(MomentumObserver(SKELETON, (T_S,)), push_n=0.0)
    assert np.abs(estimated[100:, SHOULDER]).max() < 1.0
    assert np.abs(estimated[100:, ELBOW]).max() < 0.2


def test_the_residual_follows_with_three_poles() -> None:
    """After three time constants a third-order low-pass shows 58 %, after nine 99 %."""
    estimated, true = moving(MomentumObserver(SKELETON, (T_S,)), push_n=40.0)
    share = estimated[500:, ELBOW] / true[500:, ELBOW]
    assert share[0] < 0.1
    assert 0.3 < share[round(3 * T_S / 0.004)] < 0.75
    assert share[round(9 * T_S / 0.004)] > 0.9


@pytest.mark.parametrize("joint", [SHOULDER, ELBOW])
def test_quantised_angles_add_noise_and_no_bias(joint: int) -> None:
    observer = MomentumObserver(SKELETON, (T_S,))
    estimated, true = moving(observer, push_n=40.0, count_rad=RAD_PER_COUNT, steps=900)
    gap = estimated[600:, joint] - true[600:, joint]
    assert abs(gap.mean()) < 0.2 * np.abs(true[600:, joint]).mean()


def test_a_joint_without_effort_is_not_known_and_the_others_are() -> None:
    observer = MomentumObserver(SKELETON, (T_S,))
    position, effort = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad), np.zeros(25)
    for k in range(10):
        effort[ELBOW] = np.nan if k < 5 else 0.0
        observer.update((k + 1) * STEP_NS, position, effort.copy())
        if k == 4:
            assert np.isnan(observer.external_nm[ELBOW])
            assert np.isfinite(np.delete(observer.external_nm, ELBOW)).all()
    assert np.isfinite(observer.external_nm).all()


def test_a_gap_in_the_readings_makes_it_begin_anew() -> None:
    observer = MomentumObserver(SKELETON, (T_S,))
    moving(observer, push_n=0.0, steps=100)
    assert observer.ready
    observer.update(100 * STEP_NS + 26_000_000, np.zeros(25), np.zeros(25))
    assert not observer.ready


def told_late(push_nm: float) -> tuple[MomentumObserver, Array]:
    """A robot at rest whose torque rises by 1 N m a reading more than it is told, and somebody pushes."""
    observer = MomentumObserver(SKELETON, (T_S, 2.0 * T_S), effort_late_s=0.006)
    position, rise = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad), np.eye(25)[SHOULDER]
    observer.update(0, position, np.zeros(25))
    for k in range(1, 200):
        observer.update(k * STEP_NS, position, (k - push_nm) * rise)
    return observer, rise > 0.0


@pytest.mark.parametrize(("push_nm", "allowed"), [(300.0, True), (-300.0, False)])
def test_a_rising_torque_excuses_a_push_along_it_and_none_against_it(push_nm: float, allowed: bool) -> None:
    observer, pushed = told_late(push_nm)
    assert (np.sign(observer.external_nm[pushed]) > 0.0).all() == allowed
    # 1 N m in 4 ms, 6 ms late
    assert observer.late_nm[:, pushed].max() == pytest.approx(1.5 if allowed else 0.0, abs=0.05)


def test_a_jump_that_is_foretold_is_excused_less_the_longer_the_time_constant() -> None:
    observer = MomentumObserver(SKELETON, (T_S, 2.0 * T_S), effort_late_s=0.006)
    position = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad)
    for k in range(300):
        observer.update(k * STEP_NS, position, np.zeros(25), sudden_nm=10.0)
    late = observer.late_nm[:, SHOULDER]
    assert late == pytest.approx(10.0 * SUDDEN * 0.006 / np.array([T_S, 2.0 * T_S]), rel=1e-3)
