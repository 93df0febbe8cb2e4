"""The link of the virtual world: delay, jitter and loss, each flow in its own order."""

from __future__ import annotations

import math
import random

from deploy.troubles import Way

_SKEW = 0.8
"""Of the logarithm: queues make a few packets much later than most. The least delay lies 1.1 jitters below
the mean."""


class VirtualLink:
    """Says when a message that is sent now arrives, if it does.

    The delay of each message is drawn anew from a shifted log-normal distribution of mean `delay_ns` and
    standard deviation `jitter_ns`: harder than a real link, whose delay wanders. What would overtake an
    earlier message of its flow arrives with it, as over TCP or one QUIC stream.
    """

    def __init__(self, delay_ns: int, jitter_ns: int = 0, loss: float = 0.0, seed: int = 1) -> None:
        self._delay_ns = delay_ns
        self._loss = loss
        self._random = random.Random(seed)
        mean = math.exp(0.5 * _SKEW**2)
        self._scale_ns = jitter_ns / (mean * math.sqrt(math.expm1(_SKEW**2)))
        self._floor_ns = delay_ns - self._scale_ns * mean
        self._newest_ns: dict[Way, int] = {}

    def arrival_ns(self, way: Way, sent_ns: int) -> int | None:
        """When a message arrives that is sent at `sent_ns`; None where it is lost."""
        if self._loss and self._random.random() < self._loss:
            return None
        delay_ns = self._delay_ns
        if self._scale_ns:
            drawn_ns = self._floor_ns + self._scale_ns * math.exp(self._random.gauss(0.0, _SKEW))
            delay_ns = max(round(drawn_ns), 0)
        arrival_ns = max(sent_ns + delay_ns, self._newest_ns.get(way, 0))
        self._newest_ns[way] = arrival_ns
        return arrival_ns
