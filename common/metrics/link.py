"""What a session counts of each topic, and of access control."""

from __future__ import annotations

from dataclasses import dataclass

from common.metrics.tree import Metrics


@dataclass(slots=True)
class TopicCounters(Metrics):
    """Counters of one topic in one session; they only grow."""

    sent: int = 0
    """Payloads that Zenoh took; under congestion it may still drop them."""
    put_errors: int = 0
    """Payloads that Zenoh refused."""
    received: int = 0
    """Payloads and questions that arrived."""
    duplicates: int = 0
    """Payloads that the other of two paths had brought already, or a newer one; see `[link.twin]`."""
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
    """Questions that no session answered, or that were answered with an error."""


@dataclass(frozen=True, slots=True)
class RefusalMetrics(Metrics):
    """Connections and messages that access control refused."""

    total: int
    handshakes: dict[str, int]
    """By reason."""
    messages: dict[str, dict[str, int]]
    """By certificate, then by kind and key."""


@dataclass(frozen=True, slots=True)
class AccessMetrics(Metrics):
    """Connected hosts, and refused ones, by certificate."""

    connected: dict[str, int]
    connections: dict[str, int]
    refused: RefusalMetrics | None
    """None without [link.tls], where nothing is refused."""
