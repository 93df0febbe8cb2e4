"""Paper C's hinge axes on rates that a hinge gives exactly, and what becomes of them with noise."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from common.quaternion import Array
from master.calibrate.gauss_newton import along_sphere
from master.calibrate.hinge import HingeAxes, PoorMotionError, check, find_hinge, residuals

RATE_HZ = 50.0
NOISE_RAD_S = math.radians(0.05)


def smooth(random: np.random.Generator, channels: int, scale: float, seconds: float = 20.0) -> Array:
    """A sum of sines of 0.2 to 1 Hz in each channel, (T, channels)."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    f, phase = random.uniform(0.2, 1.0, (2, 4, channels, 1))
    out: Array = scale * np.sin(2.0 * math.pi * (f * t + phase)).sum(axis=0).T / 2.0
    return out


def hinge_rates(seed: int, limb: float = 1.0, bend: float = 2.0) -> tuple[Array, Array, Array, Array]:
    """Rates of both units (T, 3) in frames of their own, and the true axes: g2 = R(θ) g1 + θ̇ j."""
    random = np.random.default_rng(seed)
    axis = np.array([0.0, 1.0, 0.0])
    body, speed = smooth(random, 3, limb), smooth(random, 1, bend)[:, 0]
    angle = np.cumsum(speed) / RATE_HZ
    shank = Rotation.from_rotvec(-angle[:, None] * axis).apply(body) + speed[:, None] * axis
    mount1, mount2 = Rotation.random(2, rng=random)
    return mount1.apply(body), mount2.apply(shank), mount1.apply(axis), mount2.apply(axis)


def apart_deg(a: Array, b: Array) -> float:
    return math.degrees(math.acos(min(1.0, abs(float(a @ b)))))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_the_jacobian_is_that_of_finite_differences(seed: int) -> None:
    random = np.random.default_rng(seed)
    gyr = random.normal(size=(2, 20, 3))
    axes = random.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    _, jacobian = residuals(gyr[0], gyr[1], axes[0], axes[1])
    for k in range(4):
        x = np.zeros(4)
        x[k] = 1e-6
        ends = [
            residuals(gyr[0], gyr[1], along_sphere(axes[0], s * x[:2]), along_sphere(axes[1], s * x[2:]))[0]
            for s in (1.0, -1.0)
        ]
        np.testing.assert_allclose(jacobian[:, k], (ends[0] - ends[1]) / 2e-6, atol=1e-6)


@settings(max_examples=8, deadline=None, derandomize=True)
@given(st.integers(0, 10_000))
def test_it_finds_the_axes_within_its_own_uncertainty(seed: int) -> None:
    gyr1, gyr2, axis1, axis2 = hinge_rates(seed)
    noise = NOISE_RAD_S * np.random.default_rng([seed, 1]).normal(size=(2, *gyr1.shape))
    found = find_hinge(gyr1 + noise[0], gyr2 + noise[1], RATE_HZ)
    check(found, "knee")
    for axis, truth, sigma in (
        (found.axis1, axis1, found.sigma1_rad),
        (found.axis2, axis2, found.sigma2_rad),
    ):
        assert apart_deg(axis, truth) < min(2.0, 4.0 * math.degrees(sigma))
        assert math.degrees(sigma) < 1.0
    assert found.condition < 1000.0


def test_missing_samples_are_left_out() -> None:
    gyr1, gyr2, axis1, _ = hinge_rates(3)
    gyr1[100:120] = np.nan
    gyr2[400] = np.nan
    assert apart_deg(find_hinge(gyr1, gyr2, RATE_HZ).axis1, axis1) < 0.5


def test_a_limb_that_hardly_moves_leaves_the_still_unit_s_axis_open() -> None:
    gyr1, gyr2, _, axis2 = hinge_rates(5, limb=0.0)
    noise = NOISE_RAD_S * np.random.default_rng(0).normal(size=(2, *gyr1.shape))
    found = find_hinge(gyr1 + noise[0], gyr2 + noise[1], RATE_HZ)
    assert apart_deg(found.axis2, axis2) < 1.0
    with pytest.raises(PoorMotionError, match="while the whole limb moves about"):
        check(found, "knee")


def test_no_bending_is_refused() -> None:
    found = find_hinge(*hinge_rates(6, bend=0.05)[:2], RATE_HZ)
    with pytest.raises(PoorMotionError, match="left knee: it was hardly bent"):
        check(found, "left knee")


def test_two_units_on_no_hinge_are_refused() -> None:
    random = np.random.default_rng(7)
    found = find_hinge(smooth(random, 3, 2.0), smooth(random, 3, 2.0), RATE_HZ)
    with pytest.raises(PoorMotionError, match="do not move as on a hinge"):
        check(found, "knee")


def test_an_answer_with_a_rival_is_refused() -> None:
    found = find_hinge(*hinge_rates(8)[:2], RATE_HZ)
    check(found, "knee")
    with pytest.raises(PoorMotionError, match="a quite different axis"):
        check(dataclasses.replace(found, rival=1.05), "knee")


def test_too_little_data_is_refused() -> None:
    with pytest.raises(PoorMotionError, match="less than a second"):
        find_hinge(np.zeros((30, 3)), np.zeros((30, 3)), RATE_HZ)


def test_what_is_told_is_told_for_both_axes() -> None:
    found: HingeAxes = find_hinge(*hinge_rates(9)[:2], RATE_HZ)
    assert found.misfit_rad_s < 0.01 * found.bending_rad_s
    assert found.rival > 10.0
