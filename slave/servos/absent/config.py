"""`[servos.absent]`: where joints without a servo stand."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from common.errors import ConfigMistake
from common.quaternion import Array
from common.skeleton import Joint, Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import BackendConfig


class AbsentConfig(BackendConfig):
    """`[servos.absent]`."""

    angle_deg: dict[str, Annotated[float, Field(ge=-360.0, le=360.0)]] = Field(default_factory=dict)
    """Where a joint stands, fixed by a bracket or left out; else at 0, or as near to it as its range lets."""

    def angle_rad(self, joint: Joint) -> float:
        """Where a joint stands."""
        stated = self.angle_deg.get(joint.name)
        nearest = min(max(0.0, joint.lower_rad), joint.upper_rad)
        return nearest if stated is None else math.radians(stated)

    def angles_rad(self, skeleton: Skeleton) -> Array:
        """(J,) where the joints stand."""
        return np.array([self.angle_rad(joint) for joint in skeleton.joints])

    def not_driven(self, skeleton: Skeleton) -> dict[str, str]:
        """All of them."""
        return {
            joint.name: f"has no servo; the file states that it stands at {self._shown(joint)}"
            for joint in skeleton.joints
        }

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """All of them."""
        return dict.fromkeys(skeleton.joint_names, "they have no servo")

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """Angles of joints that have a servo, or beyond a joint's range."""
        joints = {joint.name: joint for joint in skeleton.joints}
        key, mistakes = "servos.absent.angle_deg", []
        for name, angle_deg in self.angle_deg.items():
            joint = joints.get(name)
            if joint is None:
                mistakes.append(ConfigMistake(f"{key}.{name}", angle_deg, "a joint that is listed as absent"))
            elif not joint.lower_rad <= math.radians(angle_deg) <= joint.upper_rad:
                low, high = math.degrees(joint.lower_rad), math.degrees(joint.upper_rad)
                mistakes.append(ConfigMistake(f"{key}.{name}", angle_deg, f"within {low:g} to {high:g}"))
        return mistakes

    def _shown(self, joint: Joint) -> str:
        return f"{math.degrees(self.angle_rad(joint)):.1f}°"
