"""The printed formulas of paper A, Eqs 13 to 24, against the solver where the paper's arccos hold.

The paper's axes are x down, y right, z ahead: left-handed, and its quaternions follow the algebra of their
components all the same. A rotation R in our axes is P R Pᵀ in the paper's.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import Array, conjugate, multiply
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from master.joint_angles.decomposition import JointAngles

SKELETON = load_skeleton("nursing")
SOLVER = JointAngles(SKELETON)

PAPER_FROM_OURS = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
M_X, M_Y, M_Z = np.eye(4)[1:]


def in_paper_axes(q: Array) -> Array:
    matrix = Rotation.from_quat(q, scalar_first=True).as_matrix()
    turned = Rotation.from_matrix(PAPER_FROM_OURS @ matrix @ PAPER_FROM_OURS.T)
    return turned.as_quat(scalar_first=True)


def along(q: Array, axis: Array) -> Array:
    """Eqs 13 to 15 and 23: a segment's axis seen from the body."""
    return multiply(multiply(q, axis), conjugate(q))


def cross(a: Array, b: Array) -> Array:
    """The vector product in left-handed axes: Eq. 18 has its sign from that, and Eq. 22 must have it too."""
    return -np.cross(a[1:], b[1:])


def shoulder_yaw(q_upper: Array) -> float:
    """Eqs 16, 17. Abduction by its nature, not yaw."""
    return float(np.arccos(along(q_upper, M_X) @ M_Y))


def shoulder_pitch(q_upper: Array) -> float:
    """Eqs 18 to 20."""
    x = along(q_upper, M_X)
    normal = cross(x, M_Y)
    assert np.array_equal(normal, [x[3], 0.0, -x[1]])  # as printed
    return float(np.arccos(normal @ M_Z[1:] / np.linalg.norm(normal)))


def elbow_pitch(q_upper: Array, q_fore: Array) -> float:
    """Eq. 21."""
    return float(np.arccos(along(q_upper, M_X) @ along(q_fore, M_X)))


def elbow_roll(q_upper: Array, q_fore: Array) -> float:
    """Eqs 22 to 24."""
    normal = cross(along(q_upper, M_X), along(q_fore, M_X))
    return float(np.arccos(np.clip(normal @ along(q_fore, M_Y)[1:] / np.linalg.norm(normal), -1.0, 1.0)))


def right_arm(**angles_deg: float) -> tuple[Array, dict[str, float]]:
    """The arm's orientations in the paper's axes, body upright, and the solver's answer in degrees."""
    position = np.zeros(len(SKELETON.joints))
    for joint, angle in angles_deg.items():
        position[SKELETON.joint_names.index(f"right_{joint}")] = np.radians(angle)
    q = orientations(SKELETON, position)
    solved, _ = SOLVER.solve(q, np.zeros((len(q), 3)))
    upper = in_paper_axes(q[SKELETON.segment_names.index("right_upper_arm")])
    fore = in_paper_axes(q[SKELETON.segment_names.index("right_forearm")])
    named = dict(zip(SKELETON.joint_names, np.degrees(solved), strict=True))
    return np.array([upper, fore]), {name: named[f"right_{name}"] for name in angles_deg}


arms = st.fixed_dictionaries(
    {
        "shoulder_pitch": st.floats(1.0, 150.0),
        "shoulder_roll": st.floats(-15.0, 80.0),
        "shoulder_yaw": st.floats(-80.0, 80.0),
        "elbow_pitch": st.floats(1.0, 140.0),
        "elbow_roll": st.floats(1.0, 85.0),
    }
)


@given(arms)
def test_the_paper_s_angles_are_the_solver_s(angles_deg: dict[str, float]) -> None:
    (upper, fore), solved = right_arm(**angles_deg)
    paper = {
        # the arm's angle from the lateral axis
        "shoulder_roll": 90.0 - np.degrees(shoulder_yaw(upper)),
        # printed, a hanging arm is at 180° and one stretched ahead at 90°
        "shoulder_pitch": 180.0 - np.degrees(shoulder_pitch(upper)),
        "elbow_pitch": np.degrees(elbow_pitch(upper, fore)),
        "elbow_roll": np.degrees(elbow_roll(upper, fore)),
    }
    for name, angle in paper.items():
        assert angle == pytest.approx(solved[name], abs=1e-5), name
        assert solved[name] == pytest.approx(angles_deg[name], abs=1e-9), name


def test_the_paper_s_arccos_loses_the_sign_and_ours_keeps_it() -> None:
    for sign in (-1.0, 1.0):
        (upper, fore), solved = right_arm(
            shoulder_pitch=sign * 30.0, elbow_pitch=60.0, elbow_roll=sign * 40.0
        )
        assert np.degrees(elbow_roll(upper, fore)) == pytest.approx(40.0)
        assert 180.0 - np.degrees(shoulder_pitch(upper)) == pytest.approx(30.0)
        assert solved["elbow_roll"] == pytest.approx(sign * 40.0)
        assert solved["shoulder_pitch"] == pytest.approx(sign * 30.0)


def test_the_paper_s_arccos_is_ill_conditioned_and_ours_is_not() -> None:
    tiny_deg = 1e-7
    (upper, fore), solved = right_arm(elbow_pitch=tiny_deg)
    cosine = min(1.0, float(along(upper, M_X) @ along(fore, M_X)))
    assert abs(np.degrees(np.arccos(cosine)) - tiny_deg) > 0.1 * tiny_deg
    assert solved["elbow_pitch"] == pytest.approx(tiny_deg, rel=1e-6)
