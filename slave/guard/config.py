"""`[guard]`: how old, how long, how far, how fast."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.skeleton import Joint, Skeleton
from slave.guard.limits import MotionLimits
from slave.guard.zones import Zone, zone_mistakes

_Limit = Annotated[float | None, Field(allow_inf_nan=False)]


class JointLimits(Section):
    """`[guard.joints.NAME]`: limits of one joint, tighter than the skeleton's; what is not set stays."""

    lower_deg: _Limit = None
    """Lower position limit, °; not below the skeleton's."""
    upper_deg: _Limit = None
    """Upper position limit, °; not above the skeleton's."""
    max_velocity_deg_s: _Limit = None
    """Velocity limit, °/s; above 0, not above the skeleton's."""
    max_acceleration_deg_s2: _Limit = None
    """Acceleration limit, °/s²; above 0, not above the skeleton's."""


class GuardConfig(Section):
    """What the guard asks for before it lets a robot move, and how it lets it move."""

    max_age_s: float = Field(0.3, gt=0.0, le=2.0)
    """A command older than this, the offset's bound added, is refused; on a long line somewhat more."""
    max_age_ceiling_s: float = Field(0.6, gt=0.0, le=2.0)
    """So much more at most, whatever the line would need (`times.py`)."""
    future_tolerance_s: float = Field(0.02, ge=0.0, le=0.5)
    """A command from further ahead than this plus the offset's bound is refused."""
    command_timeout_s: float = Field(0.2, gt=0.0, le=2.0)
    """Without an accepted command for longer than this the robot holds; somewhat later on a rough line."""
    command_timeout_ceiling_s: float = Field(0.4, gt=0.0, le=2.0)
    """So much later at most, whatever the line would need; and never later than `lease_timeout_s`."""
    lease_timeout_s: float = Field(1.0, gt=0.0, le=60.0)
    """Without an accepted command for longer than this, by arrival, the operator's lease lapses."""
    offer_timeout_s: float = Field(60.0, gt=0.0, le=600.0)
    """An offer of the lease to another operator that is not taken within this lapses."""
    encoder_timeout_s: float = Field(0.1, gt=0.0, le=1.0)
    """Without a valid reading of every joint for longer than this the robot holds."""

    align_velocity_rad_s: float = Field(0.5, gt=0.0, le=2.0)
    """Speed towards the operator's posture, of all joints in `align` and of a joint that comes back."""
    align_acceleration_rad_s2: float = Field(2.0, gt=0.0, le=20.0)
    """Acceleration on that way."""
    align_window_rad: float = Field(0.05, gt=0.0, le=0.5)
    """Distance between setpoint and operator within which a joint counts as aligned."""
    align_dwell_s: float = Field(0.2, ge=0.0, le=5.0)
    """How long every valid joint must have been aligned before `track` begins."""
    align_timeout_s: float = Field(15.0, gt=0.0, le=120.0)
    """`align` that takes longer ends in `hold`."""
    clutch_max_s: float = Field(60.0, gt=0.0, le=600.0)
    """An operator who releases the clutch for longer than this must engage again."""
    jump_window_rad: float = Field(0.7, gt=0.0, le=4.0)
    """When in `track` any joint is further than this from its target, all come back at the speed of `align`.
    Followed motion stays within 0.55 (measured: three profiles, `latest` and `predict`, 60 ms one way)."""
    engage_window_rad: float = Field(0.1, gt=0.0, le=1.0)
    """`engage` is refused where an encoder is further than this from the held setpoint."""

    follow_lag_s: float = Field(0.1, gt=0.0, le=1.0)
    """How late a servo may be: an encoder is compared with where the setpoint was during this time."""
    follow_window_rad: float = Field(0.1, gt=0.0, le=1.0)
    """An encoder further than this from there is not believed."""
    follow_patience_s: float = Field(0.1, gt=0.0, le=1.0)
    """For how long it must be so before the joint is held."""
    max_doubted_joints: int = Field(3, ge=0, le=100)
    """With more joints than these held for their encoders, the whole robot holds."""
    max_tilt_deg: float = Field(10.0, gt=0.0, le=90.0)
    """A base that tilts by more than this makes the robot hold; asked of a base that carries a sensor."""
    base_timeout_s: float = Field(0.5, gt=0.0, le=10.0)
    """And so does a base whose sensor is silent for longer than this."""
    max_video_age_s: float = Field(3.0, ge=0.0, le=30.0)
    """An operator who had the robot's pictures and whose newest is older than this is not followed; 0: is."""

    velocity_scale: float = Field(1.0, gt=0.0, le=1.0)
    """Share of the velocity limits that is used."""
    acceleration_scale: float = Field(1.0, gt=0.0, le=1.0)
    """Share of the acceleration limits that is used."""
    joints: dict[str, JointLimits] = Field(default_factory=dict)
    """Tighter limits of single joints, by name."""
    max_blind_cm: float | None = Field(None, ge=1.0, le=200.0)
    """No hand goes farther than this if the line dies, braking included: they are slowed so that it holds.
    Unset: how far is told, and nothing slowed."""
    max_step_s: float = Field(0.025, gt=0.0, le=0.1)
    """A step that comes later than this after the last one moves the setpoint as if it came then."""

    self_margin_cm: float = Field(2.0, ge=0.0, le=20.0)
    """No part of the robot comes nearer than this to another that does not hang on it, or to its stand."""
    zones: list[Zone] = Field(default_factory=list)
    """What stands around the robot."""

    reset_key: str = Field("", repr=False, max_length=512)
    """Required to reset an e-stop. Empty: only a restart of the slave resets it."""
    events_kept: int = Field(256, ge=1, le=100_000)
    """Newest events that are remembered."""

    @property
    def age_ceiling_s(self) -> float:
        """The most that `max_age_s` becomes: a file that sets it above the default ceiling means it."""
        return max(self.max_age_s, self.max_age_ceiling_s)

    @property
    def timeout_ceiling_s(self) -> float:
        """The most that `command_timeout_s` becomes."""
        return max(self.command_timeout_s, min(self.command_timeout_ceiling_s, self.lease_timeout_s))

    def mistakes_for(self, skeleton: Skeleton, section: str = "guard") -> list[ConfigMistake]:
        """Contradictions between keys, joints that do not exist, and limits looser than the skeleton's."""
        return [
            ConfigMistake(f"{section}.{key}", value, expected)
            for key, value, expected in (
                *self._contradictions(),
                *self._loosened(skeleton),
                *zone_mistakes(skeleton, self.self_margin_cm, self.zones),
            )
        ]

    def limits(self, skeleton: Skeleton) -> MotionLimits:
        """The skeleton's limits, tightened."""
        joints = skeleton.joints
        tighter = [self.joints.get(joint.name, JointLimits()) for joint in joints]

        def pick(key: str, own: str) -> list[float]:
            values = [getattr(t, key) for t in tighter]
            return [
                getattr(joint, own) if v is None else math.radians(v)
                for joint, v in zip(joints, values, strict=True)
            ]

        return MotionLimits(
            lower_rad=np.array(pick("lower_deg", "lower_rad")),
            upper_rad=np.array(pick("upper_deg", "upper_rad")),
            max_velocity_rad_s=self.velocity_scale
            * np.array(pick("max_velocity_deg_s", "max_velocity_rad_s")),
            max_acceleration_rad_s2=self.acceleration_scale
            * np.array(pick("max_acceleration_deg_s2", "max_acceleration_rad_s2")),
        )

    def _contradictions(self) -> Iterator[tuple[str, object, str]]:
        if self.lease_timeout_s < self.command_timeout_s:
            yield (
                "lease_timeout_s",
                self.lease_timeout_s,
                f"at least command_timeout_s, {self.command_timeout_s}",
            )
        for key in ("max_age", "command_timeout"):
            least, ceiling = getattr(self, f"{key}_s"), getattr(self, f"{key}_ceiling_s")
            if f"{key}_ceiling_s" in self.model_fields_set and ceiling < least:
                yield f"{key}_ceiling_s", ceiling, f"at least {key}_s, {least}"
        if self.follow_window_rad < self.engage_window_rad:
            yield (
                "follow_window_rad",
                self.follow_window_rad,
                f"at least engage_window_rad, {self.engage_window_rad}",
            )
        if self.align_timeout_s <= self.align_dwell_s:
            yield "align_timeout_s", self.align_timeout_s, f"more than align_dwell_s, {self.align_dwell_s}"

    def _loosened(self, skeleton: Skeleton) -> Iterator[tuple[str, object, str]]:
        known = {joint.name: joint for joint in skeleton.joints}
        for name, tighter in self.joints.items():
            if name not in known:
                yield f"joints.{name}", tighter.model_dump(exclude_none=True), f"a joint of {skeleton.name}"
                continue
            for key, value, expected in _looser(known[name], tighter):
                yield f"joints.{name}.{key}", value, expected


def _looser(joint: Joint, tighter: JointLimits) -> Iterator[tuple[str, float, str]]:
    lower_deg, upper_deg = math.degrees(joint.lower_rad), math.degrees(joint.upper_rad)
    for key, angle in (("lower_deg", tighter.lower_deg), ("upper_deg", tighter.upper_deg)):
        if angle is not None and not joint.lower_rad <= math.radians(angle) <= joint.upper_rad:
            yield key, angle, f"within the skeleton's {lower_deg:g} to {upper_deg:g}"
    for key, rate, most in (
        ("max_velocity_deg_s", tighter.max_velocity_deg_s, joint.max_velocity_rad_s),
        ("max_acceleration_deg_s2", tighter.max_acceleration_deg_s2, joint.max_acceleration_rad_s2),
    ):
        if rate is not None and not 0.0 < math.radians(rate) <= most:
            yield key, rate, f"above 0, at most the skeleton's {math.degrees(most):g}"
    lower = lower_deg if tighter.lower_deg is None else tighter.lower_deg
    upper = upper_deg if tighter.upper_deg is None else tighter.upper_deg
    if lower >= upper:
        yield "lower_deg", lower, f"below upper_deg, {upper:g}"
