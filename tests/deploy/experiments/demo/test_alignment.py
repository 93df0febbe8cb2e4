"""A real person's sensors, worn askew, drive the simulated legs: aligned from the recording itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.experiments.demo.alignment import align
from deploy.sim.world.world import VirtualWorld, WorldSettings

LEGS = load_skeleton("lower_limb")


def knees_deg(recording: Path, overrides: list[str]) -> Array:
    """What the master commands of both knees over the first steps and sitting down, (T, 2)."""
    master = ["estimation.zero_pose_s=1.0", *overrides]
    run = VirtualWorld(
        WorldSettings(
            slave_ahead_ns=0,
            slave_drift_ppm=0.0,
            one_way_ns=500_000,
            profile="lower_limb",
            overrides={"suit": [f'replay="{recording}"'], "master": master},
        )
    )
    run.run(13.0)
    positions = np.degrees([command.position_rad for command in run.commands if command.valid.all()])
    assert len(positions) > 200
    return positions[:, [LEGS.joint_names.index(f"{side}_knee_flexion") for side in ("left", "right")]]


@pytest.mark.long
def test_knees_bend_forwards_once_the_sensors_are_aligned(tmp_path: Path, real_person: Path) -> None:

    aligned = align(real_person, LEGS, tmp_path)
    assert aligned.left == {}
    knees = knees_deg(real_person, aligned.overrides)
    assert knees.min() > -10.0
    assert (knees.max(axis=0) > 90.0).all()
    # by the zero pose alone they would bend the wrong way, where the robot's stay at their end
    assert (knees_deg(real_person, []).max(axis=0) < 10.0).all()


def test_a_recording_without_a_zero_pose_leaves_all_to_it(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    arrays: dict[str, Any] = {"t_s": 0.01 * np.arange(600)}
    for name in LEGS.segment_names:
        arrays[f"{name}_acc"] = random.standard_normal((600, 3)) + [0.0, 0.0, 9.8]
        arrays[f"{name}_gyr"] = random.standard_normal((600, 3)) * 2.0
    path = tmp_path / "restless.npz"
    np.savez(path, **arrays)
    aligned = align(path, LEGS, tmp_path)
    assert aligned.overrides == []
    assert set(aligned.left) == set(LEGS.segment_names)
    assert "stood still" in aligned.left["pelvis"]
