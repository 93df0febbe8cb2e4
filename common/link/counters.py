"""What a link counts, per topic."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class TopicCounters:
    """Counters of one topic in one session; they only grow."""

    sent: int = 0
    """Payloads that Zenoh took; under congestion it may still drop them."""
    put_errors: int = 0
    """Payloads that Zenoh refused."""
    received: int = 0
    """Payloads and questions that arrived."""
    overwritten: int = 0
    """Payloads that a newer one replaced before the loop came to them."""
    handler_errors: int = 0
    """Exceptions out of this side's own handlers."""
    answered: int = 0
    """Questions answered."""
    refused: int = 0
    """Questions turned away because too many were waiting."""
    asked: int = 0
    timeouts: int = 0
    """Questions that got no answer in time."""
    unanswered: int = 0
    """Questions that nobody was there to answer, or whose answerer reported an error."""
