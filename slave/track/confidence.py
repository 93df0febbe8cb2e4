"""How far to believe an extrapolation: learnt, joint by joint, from those that time has proved."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array
from slave.track.continuation import Continuation

_MEMORY_S = 2.0
_DOUBT_RAD = math.radians(2.0)
"""Movements well below this prove nothing."""
_APART_NS = to_ns(0.04)
"""Estimates closer together than this are not all remembered."""
_KEPT = 16


class Confidence:
    """Share of each foretold displacement that came true, between 0 and 1.

    Each sample tells how far a joint really went since an estimate one horizon ago, m, when f was foretold.
    The share that would have been best is the slope of m over f (least squares, fading within seconds):

        share = (Σ m f + d²) / (Σ f² + d²)

    with d so that it begins at 1, and small movements leave it there. A motion that turns back within the
    horizon, such as running seen from far away, foretells the wrong way: its share falls, and so the harm.
    """

    def __init__(self) -> None:
        self._past: deque[tuple[int, Continuation]] = deque(maxlen=_KEPT)
        self._agreed: Array | float = 0.0
        self._foretold: Array | float = 0.0
        self._newest_ns = 0

    def reset(self) -> None:
        """Forget what was proved: full confidence."""
        self._past.clear()
        self._agreed = self._foretold = 0.0

    def prove(self, sampled_ns: int, position_rad: Array, horizon_s: float) -> None:
        """Take a sample (J,) as proof of what was foretold about `horizon_s` before it."""
        if not self._past:
            return
        wanted_ns = sampled_ns - to_ns(horizon_s)
        then_ns, then = min(self._past, key=lambda past: abs(past[0] - wanted_ns))
        foretold = then.way(to_s(sampled_ns - then_ns))
        fade = math.exp(-to_s(sampled_ns - self._newest_ns) / _MEMORY_S)
        self._newest_ns = sampled_ns
        self._agreed = fade * self._agreed + foretold * (position_rad - then.motion[0])
        self._foretold = fade * self._foretold + foretold**2

    def note(self, sampled_ns: int, foretold: Continuation) -> None:
        """Remember what is foretold now, before its share is taken."""
        if not self._past:
            self._newest_ns = sampled_ns
        if not self._past or sampled_ns - self._past[-1][0] >= _APART_NS:
            self._past.append((sampled_ns, foretold))

    @property
    def share(self) -> Array:
        """(J,); one for all before anything is proved."""
        d = _DOUBT_RAD**2
        out: Array = np.minimum(np.maximum((self._agreed + d) / (self._foretold + d), 0.0), 1.0)
        return out
