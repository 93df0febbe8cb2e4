"""Where the joints stand, and which of their encoders are believed: life, plausibility and placement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from common.clock import to_ns
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Mask
from slave.guard.config import GuardConfig
from slave.guard.placed import Placement
from slave.guard.plausible import EncoderPlausibility
from slave.guard.watchdog import EncoderLife


class JointReadings:
    """What the guard knows of the J joints by their encoders, their drives and the written setpoint."""

    def __init__(self, skeleton: Skeleton, config: GuardConfig, last_known_rad: Mapping[str, float]) -> None:
        names = skeleton.joint_names
        self.life = EncoderLife(names, to_ns(config.encoder_timeout_s))
        self.plausible = EncoderPlausibility(names, skeleton.max_velocity_rad_s, config)
        self.placement = Placement(
            names, skeleton.lower_rad, skeleton.upper_rad, last_known_rad=last_known_rad
        )
        self.held_rad: Array = np.zeros(len(names))
        """(J,) the setpoint that was written last: where the joints are held."""
        self.at_rest = True
        """Whether that setpoint stands still."""
        self.seated = False
        """Whether it was known once where every joint stands, so that there is a setpoint."""
        self._names = names
        self._engage_window_rad = config.engage_window_rad
        self._drive_rad: Array | None = None

    def read(
        self,
        position_rad: Array,
        valid: Mask,
        read_ns: int,
        drive_rad: Array | None,
        *,
        moving: bool,
    ) -> tuple[list[str], str | None]:
        """Take a reading (J,), and the same angles by the drives' own encoders where they have any.

        Returns the joints whose encoder is doubted from now on, and which joint moves uncommanded, in words.
        """
        self.life.update(position_rad, valid, read_ns)
        self._drive_rad = drive_rad
        doubted = self.plausible.judge(position_rad, valid, read_ns, moving)
        if self.seated and self.plausible.span is None:
            return doubted, None  # an old reading
        uncommanded = self.placement.take(
            read_ns,
            position_rad,
            valid & np.isfinite(position_rad),
            # a joint whose drive tells no angle has its encoder's alone
            drive_rad=None if drive_rad is None else np.where(np.isnan(drive_rad), position_rad, drive_rad),
            span=self.plausible.span,
            under_way=moving,
        )
        return doubted, uncommanded

    def written(self, now_ns: int, position_rad: Array, velocity_rad_s: Array) -> None:
        """Take the setpoint (J,) that is written now."""
        self.held_rad, self.at_rest = position_rad, not velocity_rad_s.any()
        self.plausible.note(now_ns, position_rad)

    def unplaced(self, now_ns: int) -> tuple[str | None, bool]:
        """Why it is not known where every joint stands, or None; and whether an encoder is silent."""
        silent = self.life.silence(now_ns)
        if silent is not None:
            return silent, True
        return self.placement.unplaced(self.life.position_rad), False

    def seat(self, position_rad: Array) -> Array:
        """Hold the joints here (J,) from now on, at rest."""
        self.held_rad, self.at_rest, self.seated = position_rad, True, True
        return position_rad

    @property
    def stand_rad(self) -> Array:
        """(J,) where to hold the joints: by the drives' own angles where there are any.

        Drives take setpoints by their own angles. Held at the encoders' they would walk by the difference.
        """
        return self._by_drive(self.life.position_rad)

    def after_estop_rad(self) -> Array | None:
        """(J,) where to hold joints that may have been moved by hand; None: where they are held already.

        A drive that is switched on stays where it stands, by its own angle. Without such angles, a joint
        whose encoder is not believed stays where it was held.
        """
        if self.strayed() is not None:
            stay = np.where(self.plausible.doubted, self.held_rad, self.life.position_rad)
            return self._by_drive(stay)
        return None if self._drive_rad is None else self._by_drive(self.held_rad)

    def _by_drive(self, otherwise_rad: Array) -> Array:
        """(J,) by the drives' own angles, and of joints whose drives tell none, these."""
        if self._drive_rad is None:
            return otherwise_rad
        return np.where(np.isnan(self._drive_rad), otherwise_rad, self._drive_rad)

    def strayed(self) -> str | None:
        """The joint that is farthest from where it is held, if that is too far."""
        gap = np.abs(self.life.position_rad - self.held_rad)
        worst = int(gap.argmax())
        if gap[worst] <= self._engage_window_rad:
            return None
        return f"{self._names[worst]} is {gap[worst]:.2f} rad from where it is held"
