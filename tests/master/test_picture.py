from __future__ import annotations

from common.metrics.master import VideoReceived
from common.wire.video import VideoFrame, encode_frame
from master.picture import VideoWatch

MS = 1_000_000


def payload(number: int) -> bytes:
    return encode_frame(VideoFrame(number, number, number, 320, 240, b"\xff\xd8\xff\xd9"))


def test_a_posture_is_of_the_newest_picture_here_at_its_sampling() -> None:
    watch = VideoWatch()
    assert watch.seen_by(10**12) == (0, 0)
    for number, arrived_ns in ((5, 100), (6, 200), (7, 300)):
        watch.on_payload(payload(number), arrived_ns)
    assert watch.seen_by(99) == (0, 0)
    assert watch.seen_by(200) == (6, 200)
    assert watch.seen_by(299) == (6, 200)
    assert watch.seen_by(1000) == (7, 300)


def test_late_repeated_and_broken_ones_are_counted_and_change_nothing() -> None:
    watch = VideoWatch()
    watch.on_payload(payload(5), 100)
    for wrong in (payload(4), payload(5), b"", payload(6)[:-1]):
        watch.on_payload(wrong, 200)
    assert watch.seen_by(300) == (5, 100)
    assert watch.metrics() == VideoReceived(received=3, late=2, undecodable=2)


def test_a_robot_that_started_anew_may_count_from_below() -> None:
    watch = VideoWatch()
    watch.on_payload(payload(500), 0)
    watch.on_payload(payload(3), 2500 * MS)
    assert watch.seen_by(3000 * MS) == (3, 2500 * MS)
