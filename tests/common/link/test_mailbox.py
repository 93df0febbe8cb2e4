import threading

from common.link.mailbox import Mailbox


def test_the_newest_value_is_taken_once() -> None:
    box: Mailbox[int] = Mailbox()
    assert box.take() is None
    assert box.put(1)
    assert not box.put(2)
    assert not box.put(3)
    assert box.take() == 3
    assert box.take() is None
    assert box.overwritten == 2
    assert box.put(4)


def test_false_values_are_values() -> None:
    box: Mailbox[bytes] = Mailbox()
    box.put(b"")
    assert not box.put(b"")
    assert box.take() == b""
    assert box.overwritten == 1


def test_every_value_is_either_taken_or_counted_between_threads() -> None:
    box: Mailbox[int] = Mailbox()
    total, writers = 2000, 3
    woken = threading.Semaphore(0)

    def write() -> None:
        for i in range(total):
            if box.put(i):
                woken.release()

    threads = [threading.Thread(target=write) for _ in range(writers)]
    for thread in threads:
        thread.start()
    taken = 0
    while taken + box.overwritten < total * writers:
        assert woken.acquire(timeout=10), "a put into an empty box woke nobody"
        taken += box.take() is not None
    for thread in threads:
        thread.join(10)
    assert taken + box.overwritten == total * writers
    assert box.take() is None
