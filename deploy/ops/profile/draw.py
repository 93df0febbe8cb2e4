"""A picture of a robot in the operator's postures, side by side.

A process of its own, `python -m deploy.ops.profile.draw PROFILE FILE`: MuJoCo decides at its import by what
it draws, and the command has imported it already.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from common.errors import RobotError

_WIDTH, _HEIGHT = 320, 400
_AZIMUTH_DEG, _ELEVATION_DEG, _DISTANCES = 150.0, -10.0, 2.2
"""From ahead and its left, so many times the robot's extent away."""


def draw(profile: str, path: Path) -> None:
    """Write a PNG. Raises RobotError where the machine cannot draw."""
    command = [sys.executable, "-m", "deploy.ops.profile.draw", profile, str(path)]
    environment = {"MUJOCO_GL": "egl", **os.environ}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise RobotError(f"{path}: cannot draw ({last}): install EGL (Debian: libegl1 libgl1-mesa-dri)")


def _draw(profile: str, path: Path) -> None:
    import mujoco
    import numpy as np
    from matplotlib.image import imsave

    from common.skeleton import load_skeleton
    from deploy.sim.suit.postures import POSTURES, robot_posture
    from slave.model.build import build_model, unit_rates

    skeleton = load_skeleton(profile)
    model = build_model(skeleton)
    data, rates = mujoco.MjData(model), unit_rates(skeleton, model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation = _AZIMUTH_DEG, _ELEVATION_DEG
    camera.distance, camera.lookat = _DISTANCES * model.stat.extent, model.stat.center
    views = []
    with mujoco.Renderer(model, _HEIGHT, _WIDTH) as renderer:
        for posture in POSTURES.values():
            data.qpos[:] = robot_posture(skeleton, posture)[0] @ rates
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            views.append(renderer.render())
    imsave(path, np.concatenate(views, axis=1))


if __name__ == "__main__":
    _draw(sys.argv[1], Path(sys.argv[2]))
