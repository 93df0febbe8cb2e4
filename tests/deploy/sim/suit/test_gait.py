from __future__ import annotations

from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.sim.suit.gait import Curve, Gait, GaitError, Strides
from deploy.sim.suit.motion import load_motion, parse_motion

NAMES = ("left", "right", "tail")
CURVE = Curve(0.2, (0.5, -0.1), (0.3, 0.05, -0.02))
STRIDES = Strides(period_s=12.0, start_s=1.0, stop_s=11.0, ramp_s=1.5, stride_s=1.1)
LEGS = load_skeleton("lower_limb")
WALK = (resources.files("deploy.sim.suit") / "walk.toml").read_text("utf-8")


def gait() -> Gait:
    return Gait(NAMES, {"left": (CURVE, 0.5), "right": (CURVE, 0.0)}, STRIDES)


@given(st.floats(2.5, 9.5))
def test_in_full_stride_it_is_the_series(t_s: float) -> None:
    def series(phase: float) -> float:
        cosines = sum(a * np.cos((k + 1) * phase) for k, a in enumerate(CURVE.cos_rad))
        sines = sum(b * np.sin((k + 1) * phase) for k, b in enumerate(CURVE.sin_rad))
        return CURVE.mean_rad + float(cosines + sines)

    position, _, _ = gait().state(t_s)
    phase = 2.0 * np.pi * (t_s - 1.0) / 1.1
    np.testing.assert_allclose(position, [series(phase + np.pi), series(phase), 0.0], atol=1e-12)


@given(st.floats(0.0, 1e4))
def test_it_loops(t_s: float) -> None:
    for here, later in zip(gait().state(t_s), gait().state(t_s + 12.0), strict=True):
        np.testing.assert_allclose(here, later, atol=1e-6)


def test_it_stands_still_before_and_after() -> None:
    for values in gait().state(np.array([0.0, 0.5, 1.0, 11.0, 11.7])):
        np.testing.assert_allclose(values, 0.0, atol=1e-12)


def test_velocity_and_acceleration_are_the_derivatives() -> None:
    h = 1e-5
    t_s = np.linspace(0.0, 12.0, 1201) + 1e-3
    before, at, after = (gait().state(t) for t in (t_s - h, t_s, t_s + h))
    np.testing.assert_allclose(at[1], (after[0] - before[0]) / (2.0 * h), atol=1e-7)
    np.testing.assert_allclose(at[2], (after[1] - before[1]) / (2.0 * h), atol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"stride_s": 0.0}, "stride_s and ramp_s must be more than 0"),
        ({"ramp_s": 6.0}, "leave time for ramp_s twice"),
        ({"stop_s": 12.5}, "stops at 12.5 s, past the period of 12 s"),
    ],
)
def test_times_out_of_order_are_refused(change: dict[str, float], said: str) -> None:
    times = {name: getattr(STRIDES, name) for name in Strides.__slots__} | change
    with pytest.raises(GaitError, match=said):
        Gait(NAMES, {}, Strides(**times))


def test_a_gait_of_another_skeleton_is_refused() -> None:
    with pytest.raises(ConfigError, match="a curve of right_hip_flexion, which is none of the skeleton's"):
        parse_motion(WALK, load_skeleton("nursing"), "walk")
    strides = "[strides]\nstart_s = 1\nstop_s = 2\nramp_s = 1\nstride_s = 1\n[ahead]\n[curve]"
    with pytest.raises(ConfigError, match=r"walk: strides = .*leave time"):
        parse_motion(f"period_s = 3.0\n{strides}", LEGS, "walk")


def test_the_walk_is_a_persons() -> None:
    """Ranges of level walking (Perry and Burnfield): half a stride apart, and the knee as fast as a knee."""
    walk = load_motion("walk", LEGS)
    t_s = np.arange(6.0, 20.0, 0.005)
    position, velocity, _ = (np.degrees(values) for values in walk.state(t_s))
    joints = {name: position[:, j] for j, name in enumerate(LEGS.joint_names)}
    assert 40.0 < np.ptp(joints["right_hip_flexion"]) < 45.0
    assert 0.0 < joints["right_knee_flexion"].min() < 10.0
    assert 58.0 < joints["right_knee_flexion"].max() < 65.0
    assert 25.0 < np.ptp(joints["right_ankle_flexion"]) < 35.0
    assert 300.0 < np.abs(velocity[:, LEGS.joint_names.index("left_knee_flexion")]).max() < 450.0
    later, _, _ = walk.state(t_s + 0.55)
    np.testing.assert_allclose(np.degrees(later[:, :5]), position[:, 5:], atol=1e-9)
