"""Opening counts at once, closing once it has lasted, and what nobody can know counts as open."""

from __future__ import annotations

from typing import Any

import pytest

from slave.stop_inputs import rule
from slave.stop_inputs.config import EstopConfig, StopInputConfig
from slave.stop_inputs.rule import StopInputs
from slave.stop_inputs.source import Level

TICK_NS = 5_000_000
BUTTON = StopInputConfig(name="red button", source="gpio", line="STOP", bias="pull_down")
"""On while it is closed."""


class Loop:
    """The servo loop's ticks, and one source that reads in each of them."""

    def __init__(self, config: StopInputConfig = BUTTON, **options: Any) -> None:
        self.inputs = StopInputs(EstopConfig(inputs=[config], **options))
        self.now_ns = 10**12
        self.level: Level | None = None
        """What the source told last; None: it is read now."""
        self.on: bool | None = True
        self.why = ""
        self.changed_ns = 0

    def tick(self, dt_ns: int = TICK_NS) -> str:
        self.now_ns += dt_ns
        level = self.level or Level(self.now_ns, self.on, self.why, self.changed_ns)
        return self.inputs.step(self.now_ns, [level]).get("red button", "")

    def ticks(self, count: int) -> list[str]:
        return [self.tick() for _ in range(count)]


def test_a_closed_contact_does_not_stop_from_the_first_tick_on() -> None:
    assert Loop().ticks(100) == [""] * 100


def test_opening_counts_in_the_very_tick_and_says_where() -> None:
    loop = Loop()
    loop.tick()
    loop.on = False
    assert loop.tick() == "gpio line STOP: pressed, or its wire is broken"


def test_a_contact_that_is_open_at_the_start_stops_at_the_first_tick() -> None:
    loop = Loop()
    loop.on = False
    assert loop.tick()


def test_closing_counts_after_it_has_lasted_and_not_a_tick_sooner() -> None:
    loop = Loop(settle_s=0.1)
    loop.on = False
    loop.tick()
    loop.on = True
    words = loop.ticks(21)
    assert all(words[:19])
    assert "closed for less than 0.1 s" in words[18]
    assert words[19:] == ["", ""]  # 100 ms after it was seen open


def test_a_contact_that_bounces_starts_the_time_anew() -> None:
    loop = Loop(settle_s=0.1)
    for _ in range(5):
        loop.on = False
        loop.tick()
        loop.on = True
        assert all(loop.ticks(19))
    assert loop.tick() == ""


def test_what_was_open_between_two_readings_stops_too() -> None:
    loop = Loop()
    loop.ticks(3)
    loop.changed_ns = loop.now_ns + 1
    assert loop.tick() == "gpio line STOP: pressed, or its wire is broken"
    assert all(loop.ticks(19))
    assert loop.tick() == ""


@pytest.mark.parametrize("on", [None, False])
def test_a_source_that_cannot_be_read_stops_and_says_why(on: bool | None) -> None:
    loop = Loop()
    loop.tick()
    loop.on, loop.why = on, "No such device"
    assert loop.tick() == "gpio line STOP: No such device"


def test_a_source_that_falls_silent_stops_at_its_bound() -> None:
    loop = Loop(silent_s=0.2)
    loop.tick()
    loop.level = Level(loop.now_ns, True)
    words = loop.ticks(41)
    assert words[:40] == [""] * 40
    assert words[40].startswith("gpio line STOP: not heard for 0.2")


def test_a_reading_from_the_future_is_no_reading() -> None:
    loop = Loop(silent_s=0.2)
    loop.ticks(50)
    loop.level = Level(loop.now_ns + 3_600 * 10**9, True)
    assert "not heard" in loop.tick()


def test_a_pause_of_the_slave_itself_is_no_silence_of_its_source() -> None:
    loop = Loop(silent_s=0.2)
    loop.ticks(3)
    loop.level = Level(loop.now_ns, True)
    assert loop.tick(10**9) == ""
    words = loop.ticks(41)
    assert words[:40] == [""] * 40
    assert words[40]


def test_a_slave_that_is_always_slow_notices_a_dead_source_all_the_same() -> None:
    loop = Loop(silent_s=0.2)
    loop.tick(150_000_000)
    loop.level = Level(loop.now_ns, True)
    assert any(loop.tick(150_000_000) for _ in range(3))


def test_a_normally_open_contact_stops_when_it_closes_and_hears_no_broken_wire() -> None:
    loop = Loop(BUTTON.model_copy(update={"normally_closed": False}))
    loop.on = False
    assert loop.ticks(3) == [""] * 3
    loop.on = True
    assert loop.tick() == "gpio line STOP: pressed"


def test_each_input_is_judged_by_itself() -> None:
    inputs = StopInputs(EstopConfig(inputs=[BUTTON, BUTTON.model_copy(update={"name": "b", "line": "B"})]))
    assert list(inputs.step(1, [Level(1, True), Level(1, False)])) == ["b"]


def _as_a_level(_: object, now_ns: int, level: Level, awake_ns: int) -> str:
    """The debounce and all else left out."""
    return "" if level.on else "pressed"


MUTANTS = {
    "closing": (rule.StopInput, "step", lambda self, *a: rule.StopInput._open(self, *a)),
    "all but the level": (rule.StopInput, "_open", _as_a_level),
    "levels": (rule.StopInput, "_open", lambda *_: ""),
}
STORIES = {
    "closing": test_closing_counts_after_it_has_lasted_and_not_a_tick_sooner,
    "all but the level": test_a_source_that_falls_silent_stops_at_its_bound,
    "levels": test_opening_counts_in_the_very_tick_and_says_where,
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_rule_that_lacks_it_is_noticed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(*MUTANTS[name])
    with pytest.raises(AssertionError):
        STORIES[name]()
