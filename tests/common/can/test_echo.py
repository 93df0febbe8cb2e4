"""Own echoes and a second sender, told apart by how often a frame was sent."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from common.can.echo import KEPT_NS, SentFrames
from common.clock import NS_PER_MS

SYNC = (0x80, b"")


def awake(echo: SentFrames, now_ns: int) -> int:
    """Past the first second, in which nothing is judged."""
    for _ in range(20):
        now_ns += KEPT_NS // 10
        echo.sent(1, b"", now_ns)
        echo.is_echo(1, b"", now_ns)
    return now_ns


def test_each_frame_comes_back_once() -> None:
    echo = SentFrames(comes_back=True)
    now_ns = awake(echo, 10**12)
    for _ in range(200):
        now_ns += 20 * NS_PER_MS
        echo.sent(*SYNC, now_ns)
        assert echo.is_echo(*SYNC, now_ns + NS_PER_MS)
        assert not echo.is_echo(*SYNC, now_ns + 2 * NS_PER_MS)
    assert not echo.is_echo(0x80, b"\1", now_ns)
    assert not echo.is_echo(0, b"\1\5", now_ns)


def test_without_an_echo_nothing_is_echo() -> None:
    echo = SentFrames(comes_back=False)
    echo.sent(*SYNC, 10**12)
    assert not echo.is_echo(*SYNC, 10**12)


def test_a_process_that_stood_still_accuses_nobody() -> None:
    echo = SentFrames(comes_back=True)
    now_ns = awake(echo, 10**12)
    for _ in range(40):
        echo.sent(*SYNC, now_ns)
    now_ns += 5 * KEPT_NS
    echo.sent(*SYNC, now_ns)
    assert all(echo.is_echo(*SYNC, now_ns) for _ in range(41))


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(1, 80), st.integers(0, 60)), min_size=1, max_size=200))
def test_echoes_within_a_tenth_of_a_second_are_never_a_second_sender(rows: list[tuple[int, int]]) -> None:
    echo = SentFrames(comes_back=True)
    now_ns = awake(echo, 10**12)
    due: list[tuple[int, int]] = []
    for gap_ms, late_ms in rows:
        now_ns += gap_ms * NS_PER_MS
        for at_ns, frame_id in sorted(item for item in due if item[0] <= now_ns):
            assert echo.is_echo(frame_id, b"", at_ns)
        due = [item for item in due if item[0] > now_ns]
        echo.sent(gap_ms % 3, b"", now_ns)
        due.append((now_ns + late_ms * NS_PER_MS, gap_ms % 3))
