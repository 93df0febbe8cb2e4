from __future__ import annotations

from common.can.quiet import OncePerSecond

SECOND = 1_000_000_000


def test_it_speaks_at_once_then_once_a_second_and_tells_what_it_held_back() -> None:
    quiet = OncePerSecond()
    assert quiet.ask("a", 0) == 1
    assert quiet.ask("a", 1) == 0
    assert quiet.ask("a", SECOND - 1) == 0
    assert quiet.ask("a", SECOND) == 3
    assert quiet.ask("a", SECOND + 1) == 0


def test_each_key_has_its_own_second() -> None:
    quiet = OncePerSecond()
    assert quiet.ask("a", 5) == 1
    assert quiet.ask("b", 6) == 1
    assert quiet.ask("a", 7) == 0
