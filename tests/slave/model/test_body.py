"""Kinematics, Jacobians and capsules of the body, against MuJoCo's of the same table."""

import mujoco
import numpy as np
import pytest

from common.skeleton import load_skeleton
from slave.model.body import BodyModel
from slave.model.build import build_model, unit_rates

PROFILES = pytest.mark.parametrize("profile", ["nursing", "hand", "lower_limb"])


@PROFILES
def test_a_point_and_its_jacobian_are_those_of_the_rigid_body_model(profile: str) -> None:
    skeleton = load_skeleton(profile)
    body, model = BodyModel(skeleton), build_model(skeleton)
    data, rates = mujoco.MjData(model), unit_rates(skeleton, model)
    rng = np.random.default_rng(3)
    expected = np.empty((3, model.nv))
    for _ in range(6):
        position = rng.uniform(skeleton.lower_rad, skeleton.upper_rad)
        data.qpos[:] = position @ rates
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        posture, local = body.at(position), rng.normal(0.0, 0.1, 3)
        for i, name in enumerate(skeleton.segment_names):
            bone = data.body(name)
            point = posture.point_m(i, local)
            np.testing.assert_allclose(point, bone.xpos + bone.xmat.reshape(3, 3) @ local, atol=1e-12)
            mujoco.mj_jac(model, data, expected, None, point, bone.id)
            np.testing.assert_allclose(posture.jacobian(i, point), expected @ rates.T, atol=1e-12)


@PROFILES
def test_the_model_s_segments_have_the_body_s_capsules(profile: str) -> None:
    skeleton = load_skeleton(profile)
    model = build_model(skeleton)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    posture = BodyModel(skeleton).at(np.zeros(len(skeleton.joints)))
    shown: list[int] = []
    for name in skeleton.segment_names:
        bone = model.body(name)
        shown += range(int(bone.geomadr[0]), int(bone.geomadr[0] + bone.geomnum[0]))
    assert len(shown) == len(posture.body.capsules)
    for geom, capsule in zip(shown, posture.body.capsules, strict=True):
        assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
        assert model.body(model.geom_bodyid[geom]).name == skeleton.segment_names[capsule.segment]
        begin, end = posture.ends_m(capsule)
        np.testing.assert_allclose(data.geom_xpos[geom], 0.5 * (begin + end), atol=1e-9)
        assert model.geom_size[geom, 0] == pytest.approx(capsule.radius_m)
