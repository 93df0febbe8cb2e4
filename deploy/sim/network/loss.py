"""Which packets are lost: each by itself, or in bursts (Gilbert–Elliott). Pure."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from deploy.sim.network.profile import Way


@dataclass(frozen=True, slots=True)
class GilbertElliott:
    """Two states, good and bad, stepped once a packet; every figure is a probability."""

    to_bad: float
    to_good: float
    lost_in_bad: float
    lost_in_good: float

    @property
    def share_bad(self) -> float:
        """The share of packets that meet the bad state, in the long run."""
        changes = self.to_bad + self.to_good
        return self.to_bad / changes if changes else 0.0

    @property
    def mean(self) -> float:
        """The share of packets that are lost, in the long run."""
        return self.lost_in_good + self.share_bad * (self.lost_in_bad - self.lost_in_good)

    def bound(self, packets: int, sigmas: float = 3.0) -> float:
        """How far the measured share of so many packets may be from the mean, by chance.

        The variance of a mean of correlated draws: their own, and twice the sum of their covariances, which
        decay by the factor 1 - to_bad - to_good a packet. That is for many bursts; where there are few, one
        long burst decides: as long a one as chance makes as seldom is added.
        """
        memory = 1.0 - self.to_bad - self.to_good
        bad = self.share_bad
        between = (self.lost_in_bad - self.lost_in_good) ** 2 * bad * (1.0 - bad)
        variance = self.mean * (1.0 - self.mean) + 2.0 * between * memory / (1.0 - memory)
        if not packets:
            return 1.0
        by_variance = sigmas * math.sqrt(max(variance, 0.0) / packets)
        return min(by_variance + self._longest(math.erfc(sigmas / math.sqrt(2.0))) / packets, 1.0)

    def _longest(self, seldom: float) -> float:
        """Losses of a burst that is longer only with that probability; 0 where there are no bursts."""
        if self.lost_in_bad == self.lost_in_good or self.to_good >= 1.0:
            return 0.0
        return self.lost_in_bad * math.log(seldom) / math.log(1.0 - self.to_good)


def gilbert_elliott(way: Way) -> GilbertElliott:
    """The model of a way; random loss is one with the same probability in both states."""
    mean = way.loss_percent / 100.0
    if way.burst_packets is None or not mean:
        return GilbertElliott(0.5, 0.5, mean, mean)
    bad, to_good = way.share_in_bursts, 1.0 / way.burst_packets
    in_bad, in_good = way.loss_in_burst_percent / 100.0, way.loss_between_percent / 100.0
    return GilbertElliott(min(to_good * bad / (1.0 - bad), 1.0), to_good, in_bad, in_good)


class Losses:
    """Draws packet by packet."""

    def __init__(self, model: GilbertElliott, rng: random.Random) -> None:
        self._model = model
        self._rng = rng
        self._bad = rng.random() < model.share_bad

    def next(self) -> bool:
        """Whether the next packet is lost."""
        model, draw = self._model, self._rng.random
        lost = draw() < (model.lost_in_bad if self._bad else model.lost_in_good)
        if draw() < (model.to_good if self._bad else model.to_bad):
            self._bad = not self._bad
        return lost
