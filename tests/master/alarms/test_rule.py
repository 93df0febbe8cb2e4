"""When each tone is due, on a clock that only the test moves on."""

import itertools
from collections.abc import Callable

import pytest

from common.clock import to_ns
from master.alarms.alarm import Alarm
from master.alarms.rule import AlarmRule
from master.alarms.tones import burst_s

STEP_S = 0.05
NONE: frozenset[Alarm] = frozenset()


def played(
    active: Callable[[float], set[Alarm]], seconds: float, rule: AlarmRule | None = None
) -> list[tuple[float, Alarm]]:
    """(s, alarm) of each burst that begins."""
    rule, out = rule or AlarmRule(), []
    for k in range(round(seconds / STEP_S)):
        at_s = k * STEP_S
        alarm = rule.step(to_ns(at_s), active(at_s))
        if alarm is not None:
            out.append((round(at_s, 2), alarm))
    return out


def test_a_high_alarm_repeats_while_it_lasts_and_ends_with_its_cause() -> None:
    heard = played(lambda at: {Alarm.ESTOP} if 1.0 <= at < 20.0 else set(), 40.0)
    times = [at for at, _ in heard]
    assert times[0] == 1.0
    assert all(
        b - a == pytest.approx(5.0 + burst_s(Alarm.ESTOP), abs=0.06) for a, b in itertools.pairwise(times)
    )
    assert len(times) == 3


def test_a_hold_repeats_more_seldom() -> None:
    times = [at for at, _ in played(lambda _: {Alarm.HOLD}, 25.0)]
    assert times == pytest.approx([0.0, 11.0, 22.0], abs=0.1)


def test_a_low_one_is_told_once_however_long_it_lasts() -> None:
    assert played(lambda _: {Alarm.WARNING}, 120.0) == [(0.0, Alarm.WARNING)]


def test_a_clamp_that_comes_and_goes_makes_no_storm() -> None:
    times = [at for at, _ in played(lambda at: {Alarm.CLAMP} if int(10 * at) % 2 else set(), 60.0)]
    assert 3 <= len(times) <= 4
    assert all(b - a >= 15.0 for a, b in itertools.pairwise(times))


def test_a_hold_that_flickers_sounds_at_most_each_second_and_a_half_burst() -> None:
    times = [at for at, _ in played(lambda at: {Alarm.HOLD} if int(10 * at) % 2 else set(), 10.0)]
    assert all(b - a >= 3.5 - 1e-9 for a, b in itertools.pairwise(times))


def test_a_higher_priority_cuts_off_a_lower_one_at_once() -> None:
    heard = played(lambda at: {Alarm.HOLD, Alarm.ESTOP} if at >= 0.4 else {Alarm.HOLD}, 1.0)
    assert heard == [(0.0, Alarm.HOLD), (0.4, Alarm.ESTOP)]


def test_a_lower_one_waits_until_the_higher_has_ended() -> None:
    heard = played(lambda at: {Alarm.ESTOP, Alarm.WARNING} if at >= 0.2 else {Alarm.ESTOP}, 4.0)
    assert heard[0] == (0.0, Alarm.ESTOP)
    assert heard[1][1] is Alarm.WARNING
    assert heard[1][0] == pytest.approx(burst_s(Alarm.ESTOP), abs=0.06)


def test_of_two_of_one_priority_the_emergency_stop_comes_first_and_then_the_other() -> None:
    heard = played(lambda _: {Alarm.CONTACT, Alarm.ESTOP}, 7.0)
    assert [alarm for _, alarm in heard] == [Alarm.ESTOP, Alarm.CONTACT]


def test_a_pause_silences_what_is_active_and_not_what_begins() -> None:
    rule = AlarmRule()
    assert rule.step(0, {Alarm.HOLD}) is Alarm.HOLD
    rule.pause(to_ns(0.1), 60.0)
    assert rule.step(to_ns(30.0), {Alarm.HOLD}) is None
    assert rule.step(to_ns(31.0), {Alarm.HOLD, Alarm.ESTOP}) is Alarm.ESTOP
    assert rule.step(to_ns(60.0), {Alarm.HOLD}) is None
    assert rule.step(to_ns(60.1), {Alarm.HOLD}) is Alarm.HOLD


def test_a_paused_alarm_that_ends_and_comes_back_is_heard() -> None:
    rule = AlarmRule()
    rule.step(0, {Alarm.HOLD})
    rule.pause(to_ns(0.1), 60.0)
    assert rule.step(to_ns(20.0), NONE) is None
    assert rule.step(to_ns(21.0), {Alarm.HOLD}) is Alarm.HOLD
