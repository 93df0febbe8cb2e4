"""The MuJoCo hand and legs: built from their tables as the nursing robot is, and as steady."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from common.quaternion import Array, angle_between
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.kinematics import orientations, origins
from slave.model.build import STEP_S, build_model, unit_rates
from slave.model.own import leader


class Robot:
    def __init__(self, profile: str) -> None:
        self.skeleton: Skeleton = load_skeleton(profile)
        self.model = build_model(self.skeleton)
        self.rates = unit_rates(self.skeleton, self.model)
        self.leaders = np.array([self.model.joint(leader(j)[0]).qposadr[0] for j in self.skeleton.joints])

    def settled(self, posture: Array) -> mujoco.MjData:
        data = mujoco.MjData(self.model)
        data.qpos[:] = posture @ self.rates
        data.ctrl[:] = posture
        mujoco.mj_step(self.model, data, nstep=round(1.0 / STEP_S))
        return data

    @property
    def middle(self) -> Array:
        out: Array = 0.5 * (self.skeleton.lower_rad + self.skeleton.upper_rad)
        return out

    def geoms(self, body: str) -> list[int]:
        number = self.model.body(body).id
        return [g for g in range(self.model.ngeom) if self.model.geom_bodyid[g] == number]


@pytest.fixture(scope="module", params=["hand", "lower_limb"])
def robot(request: pytest.FixtureRequest) -> Robot:
    return Robot(request.param)


def test_forward_kinematics_are_those_of_the_table(robot: Robot) -> None:
    rng = np.random.default_rng(1)
    data = mujoco.MjData(robot.model)
    bodies = [robot.model.body(name).id for name in robot.skeleton.segment_names]
    for _ in range(20):
        position = rng.uniform(robot.skeleton.lower_rad, robot.skeleton.upper_rad)
        data.qpos[:] = position @ robot.rates
        mujoco.mj_kinematics(robot.model, data)
        q = orientations(robot.skeleton, position)
        assert angle_between(data.xquat[bodies], q).max() < 1e-7
        np.testing.assert_allclose(data.xpos[bodies], origins(robot.skeleton, q), atol=1e-12)


def test_the_root_is_fixed_and_the_rest_clears_the_floor(robot: Robot) -> None:
    root = robot.skeleton.segment_names[0]
    assert robot.model.body(root).dofnum[0] == 0
    data = mujoco.MjData(robot.model)
    mujoco.mj_forward(robot.model, data)
    moving = [g for g in range(robot.model.ngeom) if robot.model.geom_bodyid[g] > 0]
    half = robot.model.geom_size[moving, 1] * np.abs(data.geom_xmat[moving, 8])
    lowest = data.geom_xpos[moving, 2] - half - robot.model.geom_size[moving, 0]
    assert lowest.min() > 0.0


def test_gravity_makes_no_joint_sag_by_a_third_of_a_degree(robot: Robot) -> None:
    posture = robot.middle
    assert np.rad2deg(np.abs(robot.settled(posture).qpos[robot.leaders] - posture)).max() < 0.3


def test_every_servo_lags_a_ramp_by_28_ms(robot: Robot) -> None:
    posture, speed = robot.middle, np.deg2rad(40.0)
    for j, name in enumerate(robot.skeleton.joint_names):
        data = robot.settled(posture)
        began = data.qpos[robot.leaders[j]]
        for k in range(round(0.3 / STEP_S)):
            data.ctrl[j] = posture[j] + speed * k * STEP_S
            mujoco.mj_step(robot.model, data)
        lag_s = 0.3 - (data.qpos[robot.leaders[j]] - began) / speed
        assert lag_s == pytest.approx(0.0281, abs=0.0015), name


def test_all_joints_at_once_swing_through_their_ranges_28_ms_late(robot: Robot) -> None:
    skeleton = robot.skeleton
    swing = 0.5 * (skeleton.upper_rad - skeleton.lower_rad) - np.deg2rad(1.0)
    turn_rad_s = 0.7 * skeleton.max_velocity_rad_s / swing
    assert (turn_rad_s**2 * swing < skeleton.max_acceleration_rad_s2).all()

    def wanted(t_s: float) -> Array:
        out: Array = robot.middle + swing * np.sin(turn_rad_s * max(t_s, 0.0))
        return out

    data, worst = robot.settled(robot.middle), np.zeros(len(swing))
    for k in range(round(3.0 / STEP_S)):
        data.ctrl[:] = wanted(k * STEP_S)
        mujoco.mj_step(robot.model, data)
        late = wanted((k + 1) * STEP_S - 0.0281)
        worst = np.maximum(worst, np.abs(data.qpos[robot.leaders] - late))
    assert np.isfinite(data.qpos).all()
    # a servo is no pure delay: it rings when the motion begins, and the others shake it
    assert np.rad2deg(worst).max() < 6.0, dict(zip(skeleton.joint_names, np.rad2deg(worst), strict=True))


def test_the_hand_weighs_what_a_hand_does_and_its_palm_is_five_bones() -> None:
    hand = Robot("hand")
    assert 0.2 < hand.model.body_mass.sum() < 0.6
    assert len(hand.geoms("right_hand")) == 5
    assert len(hand.geoms("right_index_distal")) == 1


def test_the_legs_weigh_what_legs_do_and_their_feet_point_ahead() -> None:
    legs = Robot("lower_limb")
    # a third of the body is in its legs
    assert 0.7 * 70.0 / 3.0 < legs.model.body_mass.sum() < 1.3 * 70.0 / 3.0
    data = mujoco.MjData(legs.model)
    mujoco.mj_forward(legs.model, data)
    for side in ("left", "right"):
        (foot,) = legs.geoms(f"{side}_foot")
        assert data.geom_xpos[foot, 0] > data.body(f"{side}_foot").xpos[0] + 0.05
        assert (
            legs.model.body_mass[legs.model.body(f"{side}_thigh").id]
            > legs.model.body_mass[legs.model.body(f"{side}_shank").id]
        )


def test_the_nursing_robot_is_as_it_was_before_its_shapes_were_data() -> None:
    model = build_model(load_skeleton("nursing"))
    assert model.body_mass.sum() == pytest.approx(27.62, abs=0.01)
    radii = {name: model.geom_size[model.body(name).geomadr[0], 0] for name in ("chest", "head", "left_hand")}
    assert radii == {"chest": 0.1, "head": 0.07, "left_hand": 0.03}
    pedestal = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CYLINDER]
    assert model.geom_size[pedestal, :2].tolist() == [[0.12, 0.475]]
