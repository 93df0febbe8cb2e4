"""Two paths of the virtual world, as `[link.twin]` has them: all is sent on both, what comes first counts."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

from common.link.twin import NUMBER, FirstArrivals
from deploy.sim.network.profile import Profile, Way
from deploy.sim.world.injection import Traffic
from deploy.sim.world.link import At, VirtualLink

DEAD = Profile(both=Way(loss_percent=100.0))
_SENDER = 1


class TwinLink(VirtualLink):
    """Stands for a `VirtualLink`; the receivers take each number once, by the same rule as real ones."""

    def __init__(self, first: Profile, second: Profile | None, seed: int, at: At) -> None:
        """`second` None: there is one path."""
        super().__init__(first, seed, at)
        self._other = None if second is None else VirtualLink(second, seed + 1, at)
        self._numbers = itertools.count()
        self._firsts = FirstArrivals()
        self.sent_bytes = 0

    @property
    def duplicates(self) -> int:
        """Copies that were dropped, and messages that a newer one overtook."""
        return self._firsts.dropped

    def send(self, traffic: Traffic, now_ns: int, size: int, arrive: Callable[[], None]) -> None:
        """On both paths, under one number."""
        once = partial(self._arrive, traffic, NUMBER.pack(_SENDER, next(self._numbers)), arrive)
        self.sent_bytes += size
        super().send(traffic, now_ns, size, once)
        if self._other is not None:
            self.sent_bytes += size
            self._other.send(traffic, now_ns, size, once)

    def _arrive(self, traffic: Traffic, number: bytes, arrive: Callable[[], None]) -> None:
        if self._firsts.is_first(traffic, number):
            arrive()
