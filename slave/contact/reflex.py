"""How the robot yields after a protective stop: not at all, back the way it came, or as pushed. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from common.clock import NS_PER_S, to_s
from common.quaternion import Array
from common.wire.messages import Mask
from slave.contact.config import ContactConfig, Reflex
from slave.contact.watch import ContactWatch
from slave.limit.limit import SetpointLimiter

KEPT = 400
"""So many ticks of the way are remembered: 2 s."""
MOST_M = 0.1
"""`retreat` goes back no farther than this, whatever it feels."""
REBOUND_NS = NS_PER_S // 2
"""What pushes again so soon is what the robot has just met, which springs back."""
AFTER_NS = NS_PER_S
"""A contact that comes so long after the robot was told to stop is still that of its motion."""
YIELDS_RAD_S = 0.5
"""A joint that floats turns so fast where the torque is 1.5 times its threshold, and never faster."""
GIVES_WAY = 0.5
"""It begins to at this share of the threshold: what the model may be wrong by must not move it."""
SLOW_RAD_S, SLOW_RAD_S2 = 0.5, 4.0
LEAD_S = 0.1
"""Setpoints lead the joints by the drives' 30 ms and what comes until contact is noticed. A joint that seems
further from its setpoint than it turns in this time is not where it says: nothing yields by it."""


class ContactReflex:
    """What the setpoint does in `hold` after contact. It keeps the joints' limits; its first step is a jump.

    That step puts the setpoint where the joints stand, or at the limit beyond which they were pushed: what
    the drives were behind by no longer pushes, and their damping brakes. It takes torque away and adds none.
    """

    def __init__(self, config: ContactConfig, watch: ContactWatch, joint_names: Sequence[str]) -> None:
        self._config = config
        self._watch = watch
        self._names = tuple(joint_names)
        self._way: deque[tuple[Array, Array]] = deque(maxlen=KEPT)
        """Angles (J,) and places of all segments (B, 3) while the robot moved."""
        self._moved_ns = -AFTER_NS
        self._began_ns: int | None = None
        self._apart_m: list[float] = []
        self._back = 0
        self._free_ns = 0
        self._free_m: float | None = None
        """How far it had gone back when nothing pushed any more; None: something still does."""

    @property
    def active(self) -> bool:
        """Whether it has taken over the setpoint."""
        return self._began_ns is not None

    def followed(self, now_ns: int, stand_rad: Array) -> None:
        """The robot follows somebody, and its joints are here (J,)."""
        if self._began_ns is not None or now_ns - self._moved_ns > AFTER_NS:
            self._way.clear()
        self._began_ns, self._moved_ns = None, now_ns
        self._way.append((stand_rad.copy(), self._watch.observer.data.xipos.copy()))

    def cancel(self) -> None:
        """Somebody has stopped the robot for good: it stays where it is."""
        self._began_ns = None
        self._way.clear()

    def step(
        self, now_ns: int, dt_s: float, stand_rad: Array, limiter: SetpointLimiter, doubted: Mask
    ) -> bool:
        """One turn in `hold`: moves the setpoint and returns True, or False where there is no reason to.

        `stand_rad` (J,): where the joints are. Those `doubted` (J,) brake and stay.
        """
        if self._began_ns is None and not self._begins(now_ns, stand_rad, limiter, doubted):
            return False
        if self._config.reflex is Reflex.FLOAT:
            velocity = self._yielding()
            target = limiter.position_rad + velocity * dt_s
        else:
            velocity, target = np.zeros_like(stand_rad), self._on_the_way_back(now_ns, limiter.position_rad)
        slow = np.minimum(limiter.limits.max_velocity_rad_s, SLOW_RAD_S)
        gentle = np.minimum(limiter.limits.max_acceleration_rad_s2, SLOW_RAD_S2)
        limiter.step(now_ns, dt_s, target, velocity, doubted, slow, gentle)
        return True

    def _begins(self, now_ns: int, stand_rad: Array, limiter: SetpointLimiter, doubted: Mask) -> bool:
        late = now_ns - self._moved_ns > AFTER_NS
        if self._config.reflex is Reflex.HOLD or self._watch.finding is None or late or not self._way:
            return False
        lead_rad = np.where(doubted, 0.0, np.abs(limiter.position_rad - stand_rad))
        if (lead_rad > LEAD_S * limiter.limits.max_velocity_rad_s).any():
            return False
        self._began_ns, self._back, self._free_m = now_ns, 0, None
        limiter.yield_to(np.where(doubted, limiter.position_rad, stand_rad))
        here = self._way[-1][1]
        self._apart_m = [
            float(np.linalg.norm(there - here, axis=1).max()) for _, there in reversed(self._way)
        ]
        return True

    def _on_the_way_back(self, now_ns: int, position_rad: Array) -> Array:
        """(J,) the point of the way that is to be reached by now.

        It goes back until nothing pushes, and `retreat_m` from there. Where it then meets something it stops.
        """
        pushed, config = self._watch.finding is not None, self._config
        if self._free_m is None and not pushed:
            self._free_ns, self._free_m = now_ns, self._apart_m[self._back]
        if self._free_m is not None and pushed:
            if now_ns - self._free_ns > REBOUND_NS:
                return position_rad
            self._free_m = None
        assert self._began_ns is not None
        most_m = MOST_M if self._free_m is None else min(MOST_M, self._free_m + config.retreat_m)
        allowed_m = min(most_m, config.retreat_m_s * to_s(now_ns - self._began_ns))
        while self._back + 1 < len(self._apart_m) and self._apart_m[self._back + 1] <= allowed_m:
            self._back += 1
        return self._way[-1 - self._back][0]

    def _yielding(self) -> Array:
        """(J,) velocities that give way to the torque from outside; none where it is not known."""
        share = np.nan_to_num(self._watch.observer.external_nm / self._watch.threshold_nm)
        yields = np.clip(np.abs(share) - GIVES_WAY, 0.0, 1.0) * YIELDS_RAD_S
        out: Array = np.copysign(yields, share)
        return out
