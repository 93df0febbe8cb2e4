"""How long a movement keeps its direction: learnt, joint by joint, from the movement of the last seconds."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array

_MEMORY_S = 4.0
_APART_NS = to_ns(0.075)
"""Velocities are differenced over at least this, so that ω does not depend on the rate of commands."""
_FORGOTTEN_NS = to_ns(0.5)
"""Over a longer silence nothing is differenced."""
_SPEED_RAD_S = math.radians(6.0)
_OMEGA_PER_S = 5.0
"""ω of a joint of which nothing is known, or that moves by much less than `_SPEED_RAD_S`."""
_SHARE = 1.15
LEAST_S, MOST_S = 0.03, 0.25
_REST_RAD_S = math.radians(3.0)
"""Sensors at rest tell some 0.5 °/s; a reach has tens."""
_RESTLESS_S, _EVEN_S = 0.1, 0.16
"""τ of a movement that has no steadiness at all, and of one that has all of it. README.md has the figures."""


class Persistence:
    """τ = 1.15 / ω with ω = RMS acceleration over RMS velocity, rad/s: one number a joint.

    A velocity that swings at an angular frequency ω has an acceleration ω times as large, and is
    worth believing for about 1 / ω. With f = exp(-dt / 4 s) and the velocity v' of at least 75 ms before:

        V ← f V + (1 - f) v²,   A ← f A + (1 - f) ((v - v') / Δt)²
        ω² = (A + Ā + (5 v₀)²) / (V + V̄ + v₀²)

    with the means Ā and V̄ of all joints: a joint that moves for the first time is expected to move as the
    person's others do.
    """

    def __init__(self) -> None:
        self._past: deque[tuple[int, Array]] = deque()
        self._velocity2: Array | float = 0.0
        self._acceleration2: Array | float = 0.0

    def reset(self) -> None:
        """Forget the movement."""
        self._past.clear()
        self._velocity2 = self._acceleration2 = 0.0

    def note(self, sampled_ns: int, velocity_rad_s: Array) -> None:
        """Take the velocity (J,) of a sample, newer than the last."""
        past = self._past
        if past:
            while len(past) > 1 and sampled_ns - past[1][0] >= _APART_NS:
                past.popleft()
            fade = math.exp(-to_s(sampled_ns - past[-1][0]) / _MEMORY_S)
            self._velocity2 = fade * self._velocity2 + (1.0 - fade) * velocity_rad_s**2
            before_ns, before_rad_s = past[0]
            if _APART_NS <= sampled_ns - before_ns <= _FORGOTTEN_NS:
                slope = (velocity_rad_s - before_rad_s) / to_s(sampled_ns - before_ns)
                self._acceleration2 = fade * self._acceleration2 + (1.0 - fade) * slope**2
        past.append((sampled_ns, velocity_rad_s.copy()))

    @property
    def omega_per_s(self) -> Array:
        """(J,) ω; of shape () before there is any movement."""
        still = _SPEED_RAD_S**2
        acceleration2 = self._acceleration2 + np.mean(self._acceleration2) + _OMEGA_PER_S**2 * still
        out: Array = np.sqrt(acceleration2 / (self._velocity2 + np.mean(self._velocity2) + still))
        return out

    @property
    def lasts_s(self) -> Array:
        """(J,) τ, s: for how long a velocity is believed."""
        out: Array = np.minimum(np.maximum(_SHARE / self.omega_per_s, LEAST_S), MOST_S)
        return out

    @property
    def moving(self) -> Array:
        """(J,) between 0 and 1: how far what is told is movement, not noise of a joint at rest."""
        velocity2 = np.asarray(self._velocity2)
        out: Array = velocity2 / (velocity2 + _REST_RAD_S**2)
        return out


def steadiness(lasts_s: Array) -> Array:
    """Like τ, between 0 and 1: how far a movement is made of long, even reaches, by its τ.

    People turn about sooner than it takes to notice: their joints' τ is about 0.1 s, their steadiness 0.
    """
    out: Array = np.minimum(np.maximum((lasts_s - _RESTLESS_S) / (_EVEN_S - _RESTLESS_S), 0.0), 1.0)
    return out
