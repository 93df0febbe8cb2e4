"""The joint fit's Jacobian, and its answers on rigid bodies whose joint is exact."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import Array
from master.calibrate.joint_fit import fit_joint
from master.calibrate.joint_residuals import JointProblem, Moving, Unknowns, step

Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
KINDS = {"hinge": [Y], "two axes": [-Y, Z], "ball": None}


def some(seed: int, count: int = 12) -> Moving:
    random = np.random.default_rng(seed)
    return Moving(
        Rotation.random(count, rng=random).as_matrix(),
        random.normal(size=(count, 3)),
        random.normal(size=(count, 3)),
        random.normal(size=(count, 3, 3)),
        Rotation.random(rng=random).as_matrix(),
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_the_jacobian_is_that_of_finite_differences(kind: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    zero = KINDS[kind]
    axes = random.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    here = Unknowns(
        None if zero is None else (axes[0], axes[1]), random.uniform(-3, 3), random.normal(size=6)
    )
    problem = JointProblem(some(2 * seed), some(2 * seed + 1), zero, stood=True)
    _, jacobian = problem.linearise(here)
    for k in range(jacobian.shape[1]):
        x = np.zeros(jacobian.shape[1])
        x[k] = 1e-6
        ends = [problem.linearise(step(here, s * x))[0] for s in (1.0, -1.0)]
        np.testing.assert_allclose(jacobian[:, k], (ends[0] - ends[1]) / 2e-6, rtol=1e-4, atol=1e-4)


def jointed(seed: int, kind: str, count: int = 500) -> tuple[Moving, Moving, dict[str, Array | float]]:
    """Two bodies on a joint whose centre is pushed about, sampled at 20 Hz, and the truth."""
    random = np.random.default_rng(seed)
    dt = 0.05

    def curve(channels: int, scale: float) -> Array:
        t = np.arange(count + 4) * dt
        f, phase = random.uniform(0.15, 0.6, (2, 3, channels, 1))
        out: Array = scale * np.sin(2.0 * math.pi * (f * t + phase)).sum(axis=0).T / 2.0
        # everything begins with a moment in the zero pose
        out *= np.clip((t - 0.5) / 1.0, 0.0, 1.0)[:, None]
        return out

    parent = Rotation.from_rotvec(curve(3, 0.8))
    bend = curve(3, 1.0)
    bend[:, 0] = 0.0 if kind != "ball" else bend[:, 0]
    turns = Rotation.from_rotvec(bend[:, 1:2] * Y)
    if kind == "two axes":
        turns = turns * Rotation.from_rotvec(bend[:, 2:] * Z)
    elif kind == "ball":
        turns = (
            turns * Rotation.from_rotvec(bend[:, 2:] * Z) * Rotation.from_rotvec(bend[:, :1] * Y[[1, 0, 2]])
        )
    child = parent * turns
    push = curve(3, 3.0) + np.array([0.0, 0.0, 9.81])
    offset = float(random.uniform(-math.pi, math.pi))
    mounts = Rotation.random(2, rng=random)
    levers = random.uniform(-0.3, 0.3, (2, 3))
    own = (Rotation.identity(), Rotation.from_euler("z", -offset))
    out = []
    for body, mount, lever, frame in zip((parent, child), mounts, levers, own, strict=True):
        sensor = body * mount  # world from sensor
        rate = (sensor[1:] * sensor[:-1].inv()).as_rotvec() / dt
        rate = 0.5 * (rate[1:] + rate[:-1])
        r = (frame * sensor).as_matrix()[1:-1]
        in_sensor = np.einsum("tji,tj->ti", r, frame.apply(rate))
        change = np.gradient(in_sensor, dt, axis=0)
        spin, swing = (np.stack([np.cross(w, np.eye(3)).T for w in v]) for v in (in_sensor, change))
        k = r @ (swing + spin @ spin)
        force = frame.apply(push[1:-1]) + k @ lever
        out.append(Moving(r, frame.apply(rate), force, k, r[0]))
    axes = (Y, Z) if kind == "two axes" else (Y, Y)
    truth: dict[str, Array | float] = {
        "offset": offset,
        "axis1": mounts[0].inv().apply(axes[0]),
        "axis2": mounts[1].inv().apply(axes[1]),
        "levers": levers,
    }
    return out[0], out[1], truth


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(2))
def test_it_finds_what_the_joint_is(kind: str, seed: int) -> None:
    parent, child, truth = jointed(seed, kind)
    found = fit_joint(parent, child, KINDS[kind], 0.05)
    assert abs(math.degrees(math.remainder(found.offset_rad - truth["offset"], 2.0 * math.pi))) < 1.5
    assert found.rival > 2.0
    if found.axes is not None:
        for axis, key in zip(found.axes, ("axis1", "axis2"), strict=True):
            assert math.degrees(math.acos(min(1.0, abs(float(axis @ truth[key]))))) < 1.5
    if kind == "ball":
        np.testing.assert_allclose(found.levers_m, truth["levers"], atol=0.05)


def test_a_joint_that_stands_still_leaves_the_heading_open() -> None:
    random = np.random.default_rng(0)
    parent = Moving(
        np.tile(np.eye(3), (300, 1, 1)),
        np.zeros((300, 3)),
        np.tile([0.0, 0.0, 9.81], (300, 1)) + 0.02 * random.normal(size=(300, 3)),
        np.zeros((300, 3, 3)),
        np.eye(3),
    )
    assert fit_joint(parent, parent, None, 0.05).offset_sigma_rad > math.radians(20.0)
