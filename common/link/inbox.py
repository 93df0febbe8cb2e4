"""From Zenoh's thread to the loop: a latest-value slot and at most one wake-up under way."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import deque
from collections.abc import Callable

import zenoh

from common.clock import monotonic_ns
from common.errors import CodecError
from common.link.mailbox import MOST_KEYS, Mailbox
from common.link.twin import FirstArrivals
from common.log.throttle import LogThrottle
from common.metrics.link import TopicCounters

OVERTAKEN = 16
"""Messages by which the slower of two paths may lag and still fill a gap, where all are taken in turn."""

log = logging.getLogger(__name__)


class Inbox:
    """Hands a topic's payloads to `on_payload(key, payload, arrived_ns)` on the loop, each key's newest."""

    def __init__(
        self,
        key: str,
        on_payload: Callable[[str, bytes, int], None],
        loop: asyncio.AbstractEventLoop,
        counters: TopicCounters,
        most_keys: int = MOST_KEYS,
        behind: int = 0,
    ) -> None:
        """`most_keys`: senders whose newest values are kept apart until the loop takes them.

        `behind`: as `FirstArrivals` has it.
        """
        self._key = key
        self._on_payload = on_payload
        self._loop = loop
        self._counters = counters
        self._mailbox: Mailbox[tuple[bytes, int]] = Mailbox(most_keys)
        self._firsts = FirstArrivals(behind)
        self._taking = threading.Lock()
        """Two paths call in two threads: between "newer" and the mailbox no newer one may slip in."""
        self._throttle = LogThrottle()
        self._closed = False

    def on_sample(self, sample: zenoh.Sample) -> None:
        """Called in Zenoh's thread: stamp, copy, hand over, nothing else."""
        arrived_ns = monotonic_ns()
        if self._closed:
            return
        with self._taking:
            if not self._is_first(sample):
                return
            if self._mailbox.put(str(sample.key_expr), (sample.payload.to_bytes(), arrived_ns)):
                wake(self._loop, self._deliver)
            self._counters.received += 1

    def _is_first(self, sample: zenoh.Sample) -> bool:
        attachment = sample.attachment
        number = None if attachment is None else attachment.to_bytes()
        if self._firsts.is_first(str(sample.key_expr), number):
            return True
        self._counters.duplicates = self._firsts.dropped
        return False

    def close(self) -> None:
        """Deliver nothing from now on."""
        self._closed = True

    def _deliver(self) -> None:
        items = self._mailbox.take()
        self._counters.overwritten = self._mailbox.overwritten
        for key, (payload, arrived_ns) in items.items():
            if not self._closed:
                self._hand_over(key, payload, arrived_ns)

    def _hand_over(self, key: str, payload: bytes, arrived_ns: int) -> None:
        try:
            self._on_payload(key, payload, arrived_ns)
        except CodecError as error:
            self._counters.handler_errors += 1
            if self._throttle.passes(monotonic_ns()):
                log.warning("%s: received a message that cannot be decoded: %s", self._key, error)
        except Exception:
            # one bad message must not end the session, nor flood the log
            self._counters.handler_errors += 1
            if self._throttle.passes(monotonic_ns()):
                log.exception("%s: the handler failed", self._key)


class OrderedInbox(Inbox):
    """Hands over each payload in turn, as voice and video need it; of those that wait, the newest few."""

    def __init__(
        self,
        key: str,
        on_payload: Callable[[str, bytes, int], None],
        loop: asyncio.AbstractEventLoop,
        counters: TopicCounters,
        most: int,
    ) -> None:
        """`most`: payloads that wait for the loop; the oldest one goes where another comes."""
        super().__init__(key, on_payload, loop, counters, behind=OVERTAKEN)
        self._waiting: deque[tuple[str, bytes, int]] = deque(maxlen=most)

    def on_sample(self, sample: zenoh.Sample) -> None:
        """Called in Zenoh's thread."""
        arrived_ns = monotonic_ns()
        if self._closed:
            return
        with self._taking:
            if not self._is_first(sample):
                return
            self._counters.overwritten += len(self._waiting) == self._waiting.maxlen
            self._waiting.append((str(sample.key_expr), sample.payload.to_bytes(), arrived_ns))
            self._counters.received += 1
        wake(self._loop, self._deliver)

    def _deliver(self) -> None:
        while self._waiting and not self._closed:
            self._hand_over(*self._waiting.popleft())


def wake(loop: asyncio.AbstractEventLoop, callback: Callable[..., None], *args: object) -> None:
    """Run a callback on the loop, from any thread; a loop that is already closed needs nothing."""
    try:
        loop.call_soon_threadsafe(callback, *args)
    except RuntimeError:
        if not loop.is_closed():
            raise
