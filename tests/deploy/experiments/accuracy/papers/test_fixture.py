from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import normalise
from common.skeleton import load_skeleton
from deploy.experiments.accuracy.papers.fixture import (
    FIELD_UT,
    Wave,
    Waves,
    ideal_readings,
    record,
    turntable,
)
from deploy.sim.suit.imperfections import Imperfections
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import IdealSensors


def test_all_times_at_once_read_as_the_suits_own_sensors() -> None:
    skeleton = load_skeleton("lower_limb")
    motion = load_motion("walk", skeleton)
    alignment = normalise(np.random.default_rng(0).standard_normal((len(skeleton.segments), 4)))
    t_s = np.arange(4.0, 7.0, 0.01)
    at_once = ideal_readings(skeleton, motion, t_s, alignment)
    sensors = IdealSensors(skeleton, FIELD_UT, alignment)
    one_by_one = np.array([sensors.read(*(part[k] for part in motion.state(t_s))) for k in range(len(t_s))])
    error = np.abs(at_once - one_by_one).max(axis=(0, 1))
    assert error[:3].max() < 5e-4
    assert error[3:6].max() < 1e-4
    assert error[6:].max() < 1e-9


def test_waves_derivatives_are_those_of_their_positions() -> None:
    waves = Waves(("a", "b"), {"a": [Wave(0.5, 0.3), Wave(0.2, 1.1, 1.0)], "b": [Wave(1.0, 0.2, 2.0)]}, 1.0)
    t_s, h = np.linspace(0.5, 5.0, 91), 1e-5
    before, now, after = (waves.state(t_s + step) for step in (-h, 0.0, h))
    assert (after[0] - before[0]) / (2 * h) == pytest.approx(now[1], abs=1e-6)
    assert (after[1] - before[1]) / (2 * h) == pytest.approx(now[2], abs=1e-3)
    assert not waves.state(0.9)[0].any(), "still until it begins"


def test_the_same_seed_gives_the_same_take_and_units_keep_their_errors() -> None:
    skeleton = turntable()
    motion = Waves(skeleton.joint_names, {"yaw": [Wave(1.0, 0.5)]})
    one, other = (
        record(skeleton, motion, 1.0, 100.0, Imperfections("raw", 2, 3), [0, 0]).samples for _ in range(2)
    )
    assert one.shape == (100, 3, 2, 3)
    assert (one == other).all()
    units = Imperfections("raw", 2, 3)
    means = [
        record(skeleton, motion, 0.9, 100.0, units, [0, 0]).samples[:20, 1].mean(axis=0) for _ in range(2)
    ]
    assert means[0] == pytest.approx(means[1], abs=2e-3), "the same bias, other noise"
