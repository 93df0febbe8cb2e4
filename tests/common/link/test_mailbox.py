import asyncio
import threading
from typing import cast

import zenoh

from common.link.inbox import OrderedInbox
from common.link.mailbox import MOST_KEYS, Mailbox
from common.metrics.link import TopicCounters


def test_the_newest_value_is_taken_once() -> None:
    box: Mailbox[int] = Mailbox()
    assert box.take() == {}
    assert box.put("a", 1)
    assert not box.put("a", 2)
    assert not box.put("a", 3)
    assert box.take() == {"a": 3}
    assert box.take() == {}
    assert box.overwritten == 2
    assert box.put("a", 4)


def test_one_sender_s_flood_overwrites_no_other_s_value() -> None:
    box: Mailbox[int] = Mailbox()
    box.put("anna", 1)
    for i in range(100):
        box.put("ben", i)
    assert box.take() == {"anna": 1, "ben": 99}
    assert box.overwritten == 99


def test_more_senders_than_it_keeps_apart_are_counted() -> None:
    box: Mailbox[int] = Mailbox()
    for i in range(MOST_KEYS + 3):
        box.put(str(i), i)
    assert not box.put("0", 7)
    assert len(box.take()) == MOST_KEYS
    assert box.overwritten == 4
    assert box.put("new", 1)


def test_false_values_are_values() -> None:
    box: Mailbox[bytes] = Mailbox()
    box.put("a", b"")
    assert not box.put("a", b"")
    assert box.take() == {"a": b""}
    assert box.overwritten == 1


def test_every_value_is_either_taken_or_counted_between_threads() -> None:
    box: Mailbox[int] = Mailbox()
    total, writers = 2000, 3
    woken = threading.Semaphore(0)

    def write() -> None:
        for i in range(total):
            if box.put("a", i):
                woken.release()

    threads = [threading.Thread(target=write) for _ in range(writers)]
    for thread in threads:
        thread.start()
    taken = 0
    while taken + box.overwritten < total * writers:
        assert woken.acquire(timeout=10), "a put into an empty box woke nobody"
        taken += len(box.take())
    for thread in threads:
        thread.join(10)
    assert taken + box.overwritten == total * writers
    assert box.take() == {}


class _Sample:
    """As Zenoh hands it over."""

    key_expr = "tandem/r/voice"
    attachment = None
    """Of one path: nothing to tell copies by."""

    def __init__(self, body: bytes) -> None:
        self.payload = self
        self._body = body

    def to_bytes(self) -> bytes:
        return self._body


def test_in_order_all_that_wait_are_handed_over_and_of_too_many_the_newest() -> None:
    heard: list[bytes] = []
    loop = asyncio.new_event_loop()
    counters = TopicCounters()
    inbox = OrderedInbox(
        "tandem/r/voice", lambda key, body, at_ns: heard.append(body), loop, counters, most=3
    )
    for body in (b"1", b"2", b"3", b"4"):
        inbox.on_sample(cast(zenoh.Sample, _Sample(body)))
    loop.run_until_complete(asyncio.sleep(0))
    assert heard == [b"2", b"3", b"4"]
    assert (counters.received, counters.overwritten) == (4, 1)
    inbox.close()
    inbox.on_sample(cast(zenoh.Sample, _Sample(b"5")))
    loop.run_until_complete(asyncio.sleep(0))
    loop.close()
    assert len(heard) == 3
