"""The simulated robot's own eyes: MuJoCo draws what the camera in its head sees. For the camera's process."""

from __future__ import annotations

import os

from common.errors import RobotError
from common.quaternion import Array
from slave.camera.card import hold_card
from slave.camera.jpeg import Pixels
from slave.camera.room import furnish

NO_GL = "no OpenGL to draw with: install EGL (Debian: libegl1 libgl1-mesa-dri), or set camera.source to off"


class DrawnCamera:
    """Draws a posture. Without shadows, reflections and antialiasing: 3 ms a picture in software, not 100."""

    def __init__(self, profile: str, camera: str, width: int, height: int) -> None:
        """Raises RobotError where the machine cannot draw."""
        os.environ.setdefault("MUJOCO_GL", "egl")
        os.environ.setdefault("LP_NUM_THREADS", "1")  # Mesa: the other cores have better things to do
        try:
            import mujoco

            from common.skeleton import load_skeleton
            from slave.model.build import build_model, unit_rates

            skeleton = load_skeleton(profile)
            model = build_model(skeleton)
            model.vis.quality.offsamples = 0
            model.vis.headlight.ambient[:] = 0.35
            model.vis.global_.offwidth, model.vis.global_.offheight = width, height
            self._renderer = mujoco.Renderer(model, height, width)
        except Exception as error:  # what a missing library raises is AttributeError, ImportError, its own …
            raise RobotError(f"{NO_GL} ({type(error).__name__}: {error})") from error
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._renderer.scene.flags[flag] = False
        self._kinematics = mujoco.mj_kinematics, mujoco.mj_camlight
        self._model, self._data = model, mujoco.MjData(model)
        self._hinges_per_joint = unit_rates(skeleton, model)
        named = [model.camera(i).name for i in range(model.ncam)]
        self._camera: str | int = camera if camera in named else -1
        self._aspect = width / height

    @property
    def joints(self) -> int:
        """How many angles it takes."""
        return len(self._hinges_per_joint)

    def draw(self, position_rad: Array, card_ns: int | None = None) -> Pixels:
        """(height, width, 3) RGB of the robot with joint angles (J,); a card shows `card_ns` where given."""
        self._data.qpos[:] = position_rad @ self._hinges_per_joint
        for step in self._kinematics:
            step(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        furnish(self._renderer.scene)
        if card_ns is not None:
            hold_card(self._renderer.scene, card_ns, self._aspect)
        pixels: Pixels = self._renderer.render()
        return pixels
