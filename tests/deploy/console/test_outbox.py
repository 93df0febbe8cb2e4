"""A page that stands still never gets the past: at most a window of it, then the newest alone."""

from __future__ import annotations

from common.clock import to_ns
from deploy.console.outbox import MOST_IN_ORDER, WINDOW, Outbox


def fill(outbox: Outbox, states: int, slot: str = "view", first: int = 0) -> list[str | bytes]:
    """Offer numbered states one after the other, and send what may be sent."""
    sent = []
    for state in range(first, first + states):
        outbox.offer(slot, lambda number, state=state: f"{number}: {state}")  # type: ignore[misc]
        while (message := outbox.take(to_ns(0.04 * state))) is not None:
            sent.append(message)
    return sent


def test_a_page_that_stands_still_gets_a_window_and_then_the_newest() -> None:
    outbox = Outbox()
    sent = fill(outbox, 100)
    assert len(sent) == WINDOW == 8
    assert outbox.replaced == 100 - WINDOW - 1
    outbox.acknowledge(WINDOW, to_ns(4.0))
    assert outbox.take(to_ns(4.0)) == "9: 99"
    assert outbox.take(to_ns(4.0)) is None


def test_a_page_that_keeps_up_gets_everything() -> None:
    outbox = Outbox()
    for state in range(50):
        assert len(fill(outbox, 1, first=state)) == 1
        assert outbox.acknowledge(outbox.number, to_ns(0.04 * state + 0.01))
    assert outbox.replaced == 0
    assert outbox.page_ms == 5.0


def test_slots_do_not_push_each_other_out() -> None:
    outbox = Outbox()
    fill(outbox, WINDOW)
    for slot in ("view", "picture head", "picture hand", "view"):
        outbox.offer(slot, lambda number, slot=slot: slot)  # type: ignore[misc]
    outbox.acknowledge(WINDOW, 0)
    assert [outbox.take(0) for _ in range(4)] == ["view", "picture head", "picture hand", None]


def test_an_acknowledgement_of_what_never_left_opens_no_window() -> None:
    outbox = Outbox()
    fill(outbox, 20)
    for number in (WINDOW + 1, 10**9, 0, -5):
        assert not outbox.acknowledge(number, 0)
    assert outbox.take(0) is None
    outbox.acknowledge(3, 0)
    outbox.acknowledge(1, 0)
    assert outbox.acknowledged == 3, "an older one takes nothing back"


def test_it_knows_since_when_the_page_owes() -> None:
    outbox = Outbox()
    assert outbox.owes_since_ns() is None
    fill(outbox, 3)
    assert outbox.owes_since_ns() == 0
    outbox.acknowledge(2, to_ns(1.0))
    assert outbox.owes_since_ns() == to_ns(0.08)
    outbox.acknowledge(3, to_ns(1.0))
    assert outbox.owes_since_ns() is None


def test_what_builds_on_the_one_before_waits_in_order_and_is_dropped_whole() -> None:
    box = Outbox()

    def offer(number: int, begins: bool = False) -> bool:
        return box.offer_in_order("picture head", number, lambda n: f"{number}", begins)

    assert offer(1, begins=True)
    assert all(offer(number) for number in range(2, MOST_IN_ORDER + 1))
    assert not offer(MOST_IN_ORDER + 1)  # one more than may wait: all go
    assert box.take(0) is None
    assert not offer(MOST_IN_ORDER + 2)  # builds on one that was dropped
    assert box.replaced == MOST_IN_ORDER + 2
    assert offer(20, begins=True)
    assert offer(21)
    assert [box.take(0), box.take(0), box.take(0)] == ["20", "21", None]


def test_one_that_begins_replaces_those_that_wait_and_no_other_camera_s() -> None:
    box = Outbox()
    for number in (1, 2, 3):
        box.offer_in_order("picture head", number, lambda n: f"head {n}", number == 1)
    box.offer_in_order("picture wrist", 1, lambda n: "wrist 1", True)
    box.offer_in_order("picture head", 4, lambda n: "newest head", True)
    assert [box.take(0), box.take(0), box.take(0)] == ["wrist 1", "newest head", None]
