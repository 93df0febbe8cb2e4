"""`[contact]`: when the robot counts as pushed, and how it yields."""

from __future__ import annotations

from enum import StrEnum

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.skeleton import Skeleton

JUDGED_HZ = 200.0
"""The loop for which `effort_late_s` stands, and in which all thresholds were judged."""


class Reflex(StrEnum):
    """What follows the protective stop."""

    HOLD = "hold"
    """Brakes at the joints' limits and keeps the position."""
    RETREAT = "retreat"
    """Gives up the drives' lead at once, then goes back slowly along the way it came."""
    FLOAT = "float"
    """Gives up the drives' lead at once, then yields to who pushes it. Gravity stays held."""


class ContactJoint(Section):
    """`[contact.joints.NAME]`: one joint."""

    threshold_nm: float = Field(gt=0.0, le=10_000.0, allow_inf_nan=False)
    """External torque from which it counts as pushed, in place of the model's own noise."""


class ContactConfig(Section):
    """How contact is noticed."""

    required: bool = False
    """Whether the robot refuses to engage, and holds, while any watched joint has no contact detection."""
    # from a file it comes as text, which strict sections would refuse
    reflex: Reflex = Field(Reflex.RETREAT, strict=False)
    """What follows the protective stop."""
    time_constant_s: float | None = Field(None, ge=0.002, le=0.1)
    """Shortest 1/K of the observer: shorter is sooner, and raises the thresholds with its inverse square. Not
    set: 10 ms by the 12-bit output encoders, 4 ms where the drives tell their own, finer angles."""
    model_error: float = Field(0.15, ge=0.0, le=1.0)
    """Share of the torque that the model asks for by which it may be wrong: masses, payload, gears."""
    effort_late_s: float = Field(0.006, ge=0.0, le=0.05)
    """A motor's torque may be older than the angle beside it by so much: a cycle of the drives of 4 ms, and
    half of one, for how fast the torque changes is known as late."""
    retreat_m: float = Field(0.03, gt=0.0, le=0.2)
    """How far `retreat` goes on once nothing pushes any more: no part of the robot moves farther."""
    retreat_m_s: float = Field(0.1, gt=0.0, le=0.25)
    """How fast."""
    torque_limit: bool = True
    """While the robot follows, its drives may push no harder than moving needs and 1.25 thresholds more: no
    contact has to be noticed for that. Backends that cannot limit torque say so."""
    drive_hz: float = Field(8.0, ge=1.0, le=100.0)
    """Bandwidth of the drives' position control, by which the torque is foretold: they lag by 0.23 s /
    `drive_hz` behind their setpoints. With less than the true one the robot follows more softly."""
    joints: dict[str, ContactJoint] = Field(default_factory=dict)
    """Single joints, by name. Fingers are watched only where they are named: they are meant to touch."""

    def for_loop(self, loop_hz: float) -> ContactConfig:
        """The same for a loop that reads the drives so often.

        Between two readings a torque is known as if it changed evenly. In a longer gap it does not, and where
        readings came a cycle of the drives late besides, that feigned pushes at 100 Hz (README.md).
        """
        slower = max(1.0, JUDGED_HZ / loop_hz)
        return self.model_copy(update={"effort_late_s": self.effort_late_s * slower**2})

    def mistakes_for(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """Joints that the robot does not have."""
        return [
            ConfigMistake(f"contact.joints.{name}", name, f"a joint of the {skeleton.name} profile")
            for name in self.joints
            if name not in skeleton.joint_names
        ]
