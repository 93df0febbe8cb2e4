from __future__ import annotations

from common.metrics.master import VideoReceived
from common.wire.video import VideoFrame, encode_frame
from master.picture import MOST_CAMERAS, CamerasWatch, VideoWatch

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


def h264(number: int, after: int) -> bytes:
    return encode_frame(VideoFrame(number, number, number, 320, 240, b"\0\0\0\1", "h264", after))


def test_a_picture_that_cannot_be_shown_is_not_acknowledged_and_another_is_asked_for() -> None:
    watch = VideoWatch()
    watch.on_payload(h264(5, 0), 100 * MS)
    assert not watch.asks_for_key(100 * MS)
    watch.on_payload(h264(7, 6), 200 * MS)  # 6 was lost
    assert watch.seen_by(300 * MS) == (5, 100 * MS)
    assert watch.frame is not None
    assert watch.frame.number == 5
    assert watch.asks_for_key(200 * MS)
    assert not watch.asks_for_key(499 * MS)
    assert watch.asks_for_key(500 * MS)
    watch.on_payload(h264(8, 0), 510 * MS)
    assert not watch.asks_for_key(900 * MS)
    watch.on_payload(h264(9, 8), 600 * MS)
    assert watch.seen_by(700 * MS) == (9, 600 * MS)
    assert watch.metrics() == VideoReceived(received=4, late=0, undecodable=0, not_shown=1)


def test_a_stream_that_is_never_whole_is_not_taken_for_a_robot_that_started_anew() -> None:
    watch = VideoWatch()
    watch.on_payload(h264(500, 0), 0)
    for i in range(30):
        watch.on_payload(h264(502 + i, 501 + i), 100 * (i + 1) * MS)
    watch.on_payload(h264(3, 0), 3100 * MS)
    assert watch.seen_by(4000 * MS) == (500, 0)
    assert watch.metrics().late == 1


def test_a_robot_that_started_anew_may_count_from_below() -> None:
    watch = VideoWatch()
    watch.on_payload(payload(500), 0)
    watch.on_payload(payload(3), 2500 * MS)
    assert watch.seen_by(3000 * MS) == (3, 2500 * MS)


def key(camera: str) -> str:
    return f"tandem/robot-1/video/{camera}"


def test_each_command_acknowledges_the_next_camera_that_has_a_new_picture() -> None:
    watch = CamerasWatch()
    assert watch.seen_by(10**12) == (0, 0)
    for number, camera in enumerate(("head", "hand", "room"), start=1):
        watch.on_payload(key(camera), payload(100 * number), number)
    assert [watch.seen_by(10)[0] for _ in range(3)] == [100, 200, 300]
    watch.on_payload(key("hand"), payload(201), 11)
    watch.on_payload(key("head"), payload(101), 12)
    # the room's camera stands still: it takes no turn while others have something new
    assert [watch.seen_by(20)[0] for _ in range(2)] == [101, 201]
    watch.on_payload(key("hand"), payload(202), 21)
    assert watch.seen_by(30)[0] == 202, "the only one with a new picture, although it has waited least"
    # nothing is new: each still says, in turn, what the operator has
    assert sorted(watch.seen_by(30)[0] for _ in range(3)) == [101, 202, 300]


def test_no_more_cameras_are_kept_than_a_robot_may_have() -> None:
    watch = CamerasWatch()
    for number in range(10):
        watch.on_payload(key(f"c{number}"), payload(number + 1), number)
    assert watch.metrics() == VideoReceived(MOST_CAMERAS, 0, 0, 0)


def test_a_picture_that_builds_on_a_lost_one_is_asked_for_of_its_own_camera_alone() -> None:
    watch = CamerasWatch()
    watch.on_payload(key("head"), payload(1), 1)
    broken = VideoFrame(9, 9, 9, 320, 240, b"\x00\x00\x00\x01", "h264", 8)
    watch.on_payload(key("hand"), encode_frame(broken), 2)
    assert watch.asks_for_key(3) == ["hand"]
