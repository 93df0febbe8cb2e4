"""`[camera.calibration]`: where a real camera stands on the robot, and how its lens bends what it sees.

A simulated robot's eye is known. Without a calibration the page draws nothing over the camera's picture.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.metrics.lens import Lens
from common.skeleton import Skeleton
from slave.model.capsules import links
from slave.model.eye import FOCAL, LINK, NAME, POSITION_M, Q_LINK_FROM_CAMERA

_UNIT = 1e-3
"""A quaternion that is rounded to three digits is still one."""
_ALIKE = 0.01
"""Shapes of pictures that differ by less are one."""

Pixels = Annotated[float, Field(gt=0.0, le=10_000.0, allow_inf_nan=False)]
Metres = Annotated[float, Field(ge=-5.0, le=5.0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=-1.0, le=1.0, allow_inf_nan=False)]


class CalibrationConfig(Section):
    """One camera's, as OpenCV's calibration gives it."""

    size: Annotated[list[Annotated[int, Field(ge=16)]], Field(min_length=2, max_length=2)]
    """Width and height of the pictures that it was calibrated with, pixels."""
    fx: Pixels
    fy: Pixels
    """Focal lengths, pixels of those pictures."""
    cx: Pixels
    cy: Pixels
    """Where the optical axis meets them."""
    k1: Share = 0.0
    k2: Share = 0.0
    """Radial distortion."""
    link: str = ""
    """The body of the profile that carries the camera; empty: the robot's base."""
    position_m: Annotated[list[Metres], Field(min_length=3, max_length=3)]
    """In that body's frame."""
    q_link_from_camera: Annotated[list[Share], Field(min_length=4, max_length=4)]
    """[w, x, y, z]; the camera's axes: x to the right of the picture, y down, z ahead."""

    def mistakes_for(self, skeleton: Skeleton, width: int, height: int) -> list[ConfigMistake]:
        """A body that the profile has, a quaternion that is one, pictures of the shape that is sent."""
        found, bodies = [], [link.name for link in links(skeleton)]
        if self.link and self.link not in bodies:
            expected = f"empty (the base), or a body of the profile {skeleton.name}: {', '.join(bodies)}"
            found.append(ConfigMistake("link", self.link, expected))
        if abs(math.hypot(*self.q_link_from_camera) - 1.0) > _UNIT:
            expected = "[w, x, y, z] of length 1"
            found.append(ConfigMistake("q_link_from_camera", self.q_link_from_camera, expected))
        if abs(self.size[0] * height / (self.size[1] * width) - 1.0) > _ALIKE:
            expected = f"pictures of the shape that is sent: camera.width × height is {width} × {height}"
            found.append(ConfigMistake("size", self.size, expected))
        return found

    @property
    def lens(self) -> Lens:
        """In shares of the picture."""
        width, height = self.size
        length = math.hypot(*self.q_link_from_camera)
        w, x, y, z = (each / length for each in self.q_link_from_camera)
        ahead, left, up = self.position_m
        return Lens(
            link=self.link,
            position_m=(ahead, left, up),
            q_link_from_camera=(w, x, y, z),
            focal=(self.fx / width, self.fy / height),
            centre=(self.cx / width, self.cy / height),
            radial=(self.k1, self.k2),
        )


def eye(skeleton: Skeleton, camera: str, width: int, height: int) -> Lens | None:
    """Of a simulated robot's own eye; None for a camera that its model has not: it shows the whole robot."""
    # a robot's own model has cameras of its own, or none
    if camera != NAME or skeleton.own_links or LINK not in [link.name for link in links(skeleton)]:
        return None
    focal = FOCAL * height / width, FOCAL
    return Lens(LINK, POSITION_M, Q_LINK_FROM_CAMERA, focal, (0.5, 0.5))
